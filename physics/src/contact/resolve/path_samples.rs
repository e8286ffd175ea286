//! A cache of a path's samples, which ends with the drape that is to be resolved. A step that is halved asks for the same
//! samples again.
//!
//! The drape at the end differs from the sample at 1, where garments are skinned. The difference is faded in along the path, in
//! the frames of the skinning transforms.

use super::{Layer, PathSample};
use crate::transform::{into_frame, out_of_frame};
use crate::vec3::{add_scaled, sub};

/// Samples in the cache: some megabytes each.
const MOST: usize = 64;

/// Samples by their share of the path: the end, and the most recently used others.
pub(super) struct PathSamples<'a> {
    end: &'a [Layer<'a>],
    /// None before the first request.
    last: Option<Last>,
    kept: Vec<(f64, PathSample)>,
}

/// The end of the path.
struct Last {
    sample: PathSample,
    /// The drape minus the sample, in the frames of all vertices (m).
    difference: Vec<[f64; 3]>,
}

impl<'a> PathSamples<'a> {
    /// For a path to the drape `end`.
    pub fn to(end: &'a [Layer<'a>]) -> Self {
        Self { end, last: None, kept: Vec::new() }
    }

    /// The sample at `share`, `made` if it is not cached.
    pub fn at<E>(
        &mut self,
        share: f64,
        mut made: impl FnMut(f64) -> Result<PathSample, E>,
    ) -> Result<PathSample, E> {
        let last = match &mut self.last {
            Some(last) => last,
            None => {
                let last = Last::of(made(1.0)?, self.end);
                self.last.insert(last)
            }
        };
        if share == 1.0 {
            return Ok(last.sample.clone());
        }
        let entry = match self.kept.iter().position(|(known, _)| *known == share) {
            Some(i) => self.kept.remove(i),
            None => (share, last.faded_in(share, made(share)?)),
        };
        let sample = entry.1.clone();
        if self.kept.len() == MOST {
            self.kept.remove(0);
        }
        self.kept.push(entry);
        Ok(sample)
    }
}

impl Last {
    /// The drape `end` in place of the one in `sample`.
    fn of(mut sample: PathSample, end: &[Layer<'_>]) -> Self {
        let pairs = end.iter().zip(&sample.draped).flat_map(|(end, draped)| end.positions.iter().zip(draped));
        let in_frame = |((p, q), transform): ((&[f64; 3], &[f64; 3]), _)| into_frame(transform, sub(*p, *q));
        let difference = pairs.zip(&sample.transforms).map(in_frame).collect();
        sample.draped = end.iter().map(|layer| layer.positions.to_vec()).collect();
        Self { sample, difference }
    }

    fn faded_in(&self, share: f64, mut sample: PathSample) -> PathSample {
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
    use crate::query::Surface;
    use crate::vec3::distance_squared;
    use std::sync::Arc;

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
        let mut samples = PathSamples::to(&layers);
        for share in [0.0, 0.5, 1.0] {
            let sample = samples.at(share, |share| Ok::<_, ()>(turned(rest, 1.5 * share))).unwrap();
            let moved: Vec<[f64; 3]> = rest.iter().map(|p| [p[0] + 0.01 * share, p[1], p[2]]).collect();
            for (p, q) in sample.draped[0].iter().zip(&turned(&moved, 1.5 * share).draped[0]) {
                assert!(distance_squared(*p, *q) < 1e-24, "at {share}: {p:?} {q:?}");
            }
        }
        let last = samples.at(1.0, |_| Err("is known")).unwrap();
        assert_eq!(last.draped[0], end, "to the last bit");
    }

    #[test]
    fn a_sample_is_made_once_while_it_is_cached() {
        let mut samples = PathSamples::to(&[]);
        let mut made = Vec::new();
        let mut ask = |share: f64| {
            let sample = samples.at(share, |share| {
                made.push(share);
                Ok::<_, ()>(turned(&[[1.0; 3]], share))
            });
            assert_eq!(sample.unwrap().draped.len(), usize::from(share != 1.0));
        };
        let early = |i: usize| i as f64 / MOST as f64;
        (0..MOST).for_each(|i| ask(early(i)));
        // The end was made first of all and stays; so does what is asked for again.
        [early(0), 0.999, early(0), early(1), 1.0].into_iter().for_each(&mut ask);
        let expected: Vec<f64> =
            [1.0].into_iter().chain((0..MOST).map(early)).chain([0.999, early(1)]).collect();
        assert_eq!(made, expected);
        assert_eq!(samples.kept.len(), MOST);
    }

    #[test]
    fn a_failed_sample_is_not_cached() {
        let mut samples = PathSamples::to(&[]);
        assert_eq!(samples.at(0.5, |_| Err("no")).err(), Some("no"));
        assert!(samples.kept.is_empty() && samples.last.is_none());
    }
}
