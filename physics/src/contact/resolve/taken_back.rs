//! Drapes taken back, where crossings are left, towards the garments as skinning alone puts them.
//!
//! On a body far from those it was trained on a network may fold cloth into itself. No garment over such a fold can be sorted
//! out: its neighbourhood would have to be unfolded by more than the limits of a vertex. What the drape began from has no folds.

use rayon::prelude::*;

use super::certificate::{Certificate, Crossed};
use super::{Layer, PathSample};
use crate::query::VertexIndex;
use crate::vec3::{add_scaled, sub};

/// Within this distance of a crossing (m), in the T-pose, a drape is taken back wholly…
const REACH: f64 = 0.1;
/// …and beyond this one not at all.
const END: f64 = 3.0 * REACH;

/// How far every vertex is taken back, 0–1, `[V]` per garment, around what is `left` of crossings with the body and between
/// garments. `places` are the garments in the T-pose, where no limb is near another one.
pub(super) fn shares(left: &Certificate, layers: &[Layer<'_>], places: &[Vec<[f64; 3]>]) -> Vec<Vec<f64>> {
    let corners = |garment: usize, triangle: usize| {
        layers[garment].garment.faces()[triangle].map(|v| places[garment][v as usize])
    };
    let mut crossed: Vec<[f64; 3]> = Vec::new();
    for pair in left.remaining.iter().filter(|pair| !pair.is_pinched && pair.crosses != Crossed::Itself) {
        crossed.extend(corners(pair.garment, pair.triangle));
        if let Crossed::Layer(inner) = pair.crosses {
            crossed.extend(corners(inner, pair.other_triangle));
        }
    }
    let crossed = VertexIndex::new(&crossed);
    let share = |p: &[f64; 3]| smooth_step((END - crossed.nearest(*p).1.sqrt()) / (END - REACH));
    places.iter().map(|places| places.par_iter().map(share).collect()).collect()
}

/// The drape at `stage`, by `shares` taken back to where it began.
pub(super) fn taken_back(mut stage: PathSample, shares: &[Vec<f64>]) -> PathSample {
    for ((draped, skinned), shares) in stage.draped.iter_mut().zip(&stage.skinned).zip(shares) {
        for ((p, start), share) in draped.iter_mut().zip(skinned).zip(shares) {
            *p = add_scaled(*p, *share, sub(*start, *p));
        }
    }
    stage
}

/// 0 up to 0, 1 from 1 on, without a kink.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

#[cfg(test)]
mod tests {
    use super::super::certificate::RemainingPair;
    use super::super::{ResolveError, ResolveSettings, RestGarment, resolve_along};
    use super::*;
    use crate::mesh::{TriMesh, shapes};
    use crate::query::Surface;
    use crate::transform::IDENTITY;
    use crate::vec3::{add, norm};
    use std::sync::Arc;

    /// A sheet of 1.2 m in the plane y = `height`.
    fn sheet(height: f64) -> TriMesh {
        let grid = shapes::irregular_grid(1.2, 1.2, 40, 40, 0.25, 4);
        shapes::mapped(&grid, |[x, y, _]| [y - 0.6, height, x - 0.6])
    }

    fn pair(garment: usize, crosses: Crossed, is_pinched: bool) -> RemainingPair {
        RemainingPair { garment, triangle: 0, crosses, other_triangle: 0, is_pinched }
    }

    #[test]
    fn shares_are_whole_at_a_crossing_and_end_smoothly() {
        let mesh = sheet(0.0);
        let garment = RestGarment::new(&mesh);
        let layers = [0, 1].map(|_| Layer { garment: &garment, positions: mesh.positions() });
        let places = [mesh.positions().to_vec(), sheet(0.01).positions().to_vec()];
        let shares_of = |pairs: &[RemainingPair]| {
            let left = Certificate { remaining: pairs.to_vec(), ..Certificate::default() };
            shares(&left, &layers, &places)
        };
        let of_pair = shares_of(&[pair(1, Crossed::Layer(0), false)]);
        let corners = mesh.faces()[0].map(|v| mesh.positions()[v as usize]);
        for (places, shares) in places.iter().zip(&of_pair) {
            for (p, share) in places.iter().zip(shares) {
                let distance = corners.iter().map(|c| norm(sub(*p, *c))).fold(f64::INFINITY, f64::min);
                assert!((0.0..=1.0).contains(share));
                assert!(*share == 1.0 || distance > REACH - 0.01, "{distance}: {share}");
                assert!(*share == 0.0 || distance < END + 0.01, "{distance}: {share}");
            }
        }
        for edge in garment.topology.edges.iter().map(|e| e.map(|v| v as usize)) {
            let step = (of_pair[0][edge[0]] - of_pair[0][edge[1]]).abs();
            assert!(step < 0.4, "{step}");
        }
        // A crossing with the body counts, one of a garment with itself or in a pinched place does not.
        assert_eq!(shares_of(&[pair(0, Crossed::Body, false)])[0][0], 1.0);
        for ignored in [pair(0, Crossed::Itself, false), pair(1, Crossed::Layer(0), true)] {
            assert!(shares_of(&[ignored]).iter().flatten().all(|share| *share == 0.0));
        }
    }

    /// Two sheets over a ball. The drape has put the outer one 20 cm too low around the middle, through the inner one
    /// and the ball: farther than a vertex may go.
    #[test]
    fn a_drape_that_cannot_be_sorted_out_goes_back_around_what_is_wrong_and_nowhere_else() {
        let (inner, outer) = (sheet(0.10), sheet(0.13));
        let garments = [&inner, &outer].map(RestGarment::new);
        let sunk =
            |p: &[f64; 3]| add(*p, [0.0, 0.01 - 0.2 * (-(norm([p[0], 0.0, p[2]]) / 0.1).powi(2)).exp(), 0.0]);
        let draped = vec![inner.positions().to_vec(), outer.positions().iter().map(sunk).collect()];
        let ball = Arc::new(Surface::from_mesh(&shapes::icosphere(0.08, 3)));
        let stage = |skinned: [&TriMesh; 2]| -> Result<PathSample, ResolveError> {
            Ok(PathSample {
                body: ball.clone(),
                draped: draped.clone(),
                skinned: skinned.map(|mesh| mesh.positions().to_vec()).to_vec(),
                transforms: vec![IDENTITY; inner.vertex_count() + outer.vertex_count()],
            })
        };
        let layers: Vec<Layer<'_>> =
            garments.iter().zip(&draped).map(|(garment, positions)| Layer { garment, positions }).collect();
        let settings = ResolveSettings { loosened: 1.0, ..ResolveSettings::default() };
        let along = |skinned: [&TriMesh; 2]| {
            let start = skinned.map(|mesh| mesh.positions().to_vec());
            resolve_along(&ball, &layers, &start, &settings, |_| stage(skinned)).unwrap()
        };
        let back = along([&inner, &outer]);
        assert!(back.certificate.is_clear(), "{:?}", back.certificate);
        let far = |p: &[f64; 3]| norm([p[0], 0.0, p[2]]) > 0.55;
        let mut counted = 0;
        for (p, q) in draped[1].iter().zip(&back.positions[1]).filter(|(p, _)| far(p)) {
            assert_eq!(p, q);
            counted += 1;
        }
        assert!(counted > 100);
        // Where skinning is no better it is of no help.
        let sunk = [inner.clone(), outer.with_positions(draped[1].clone()).unwrap()];
        let stuck = along([&sunk[0], &sunk[1]]);
        assert!(!stuck.certificate.is_clear());
    }
}
