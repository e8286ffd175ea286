//! States along a continuation path.

use std::sync::Arc;

use super::Layer;
use crate::query::Surface;
use crate::transform::{Transform, into_frame, out_of_frame};
use crate::vec3::{add_scaled, sub};

/// The body and the garments at one share of a continuation path, before they are resolved there.
#[derive(Clone)]
pub struct PathSample {
    /// The body.
    pub body: Arc<Surface<f64>>,
    /// The garments on it, `[V, 3]` each (m): skinned, or draped.
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms of all vertices, garment after garment, from one and the same state.
    pub transforms: Vec<Transform>,
}

/// Resolved garments from which a continuation path starts.
pub struct ContactState {
    /// The drape before the post-process, `[V, 3]` per garment (m).
    pub draped: Vec<Vec<[f64; 3]>>,
    /// The resolved positions, `[V, 3]` per garment (m).
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms, as in [`PathSample`].
    pub transforms: Vec<Transform>,
    /// Intersecting pairs with the body and between garments left in `positions`, without narrow and pinched ones.
    pub intersections: usize,
}

/// The end of a path: the drape that is to be resolved. It differs from the sample there, where garments are skinned. The
/// difference is faded in along the path, in the frames of the skinning transforms.
pub(super) struct PathEnd {
    /// The sample at 1, with that drape.
    pub sample: PathSample,
    /// The drape minus what was sampled, in the frames of all vertices (m).
    difference: Vec<[f64; 3]>,
}

impl PathEnd {
    /// The drape `end` in place of the one in `sample`.
    pub fn new(mut sample: PathSample, end: &[Layer<'_>]) -> Self {
        let pairs = end.iter().zip(&sample.draped).flat_map(|(end, draped)| end.positions.iter().zip(draped));
        let in_frame = |((p, q), transform): ((&[f64; 3], &[f64; 3]), _)| into_frame(transform, sub(*p, *q));
        let difference = pairs.zip(&sample.transforms).map(in_frame).collect();
        sample.draped = end.iter().map(|layer| layer.positions.to_vec()).collect();
        Self { sample, difference }
    }

    /// The `sample` at this share of the path, with as much of the difference.
    pub fn faded_in(&self, share: f64, mut sample: PathSample) -> PathSample {
        let difference = self.difference.iter().zip(&sample.transforms);
        for (p, (offset, transform)) in sample.draped.iter_mut().flatten().zip(difference) {
            *p = add_scaled(*p, share, out_of_frame(transform, *offset));
        }
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::super::RestGarment;
    use super::*;
    use crate::mesh::shapes;
    use crate::vec3::distance_squared;

    /// A sample where cloth at rest has been turned about the vertical by `angle`.
    fn turned(rest: &[[f64; 3]], angle: f64) -> PathSample {
        let (s, c) = angle.sin_cos();
        let turn = |[x, y, z]: [f64; 3]| [c * x + s * z, y, c * z - s * x];
        PathSample {
            body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
            draped: vec![rest.iter().map(|p| turn(*p)).collect()],
            transforms: vec![[[c, 0.0, s, 0.0], [0.0, 1.0, 0.0, 0.0], [-s, 0.0, c, 0.0]]; rest.len()],
        }
    }

    #[test]
    fn the_difference_of_the_end_grows_along_the_path_and_turns_with_the_body() {
        let mesh = shapes::grid(0.2, 0.1, 5, 4);
        let garment = RestGarment::new(&mesh);
        let rest = mesh.positions();
        // A centimetre along what was x, which has been turned to −z.
        let end: Vec<[f64; 3]> = turned(rest, 1.5).draped[0]
            .iter()
            .map(|p| add_scaled(*p, 0.01, [1.5_f64.cos(), 0.0, -1.5_f64.sin()]))
            .collect();
        let layers = [Layer { garment: &garment, positions: &end }];
        let path_end = PathEnd::new(turned(rest, 1.5), &layers);
        for share in [0.0, 0.5, 1.0] {
            let sample = path_end.faded_in(share, turned(rest, 1.5 * share));
            let moved: Vec<[f64; 3]> = rest.iter().map(|p| [p[0] + 0.01 * share, p[1], p[2]]).collect();
            for (p, q) in sample.draped[0].iter().zip(&turned(&moved, 1.5 * share).draped[0]) {
                assert!(distance_squared(*p, *q) < 1e-24, "at {share}: {p:?} {q:?}");
            }
        }
        assert_eq!(path_end.sample.draped[0], end, "to the last bit");
    }
}
