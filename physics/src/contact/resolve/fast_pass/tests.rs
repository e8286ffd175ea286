//! Drapes that are slightly wrong, judged by all pairs of triangles.

use super::super::garment::at;
use super::super::tests::layers;
use super::*;
use crate::contact::resolve::budget::Budget;
use crate::contact::resolve::{RestGarment, certify};
use crate::mesh::TriMesh;
use crate::mesh::shapes::{self, SplitMix};
use crate::query::Surface;

/// Tubes over each other around a trunk, each with slight bulges that reach into its neighbours.
fn scene(random: &mut SplitMix, layers: usize, bulge: f64) -> (Surface<f64>, Vec<TriMesh>) {
    let trunk = shapes::icosphere(0.15, 3);
    let tube = |i: usize| {
        let [a, b, c] = std::array::from_fn(|_| 3.0 * random.symmetric());
        let tube = shapes::tube(0.154 + 0.004 * i as f64, 0.12, 40 + 3 * i, 10 + i);
        shapes::mapped(&tube, |[x, y, z]| {
            let angle = z.atan2(x);
            let grow =
                1.0 + bulge * ((60.0 * y + a).sin() * (3.0 * angle + b).sin() + (2.0 * angle + c).cos());
            [x * grow, y - 0.06, z * grow]
        })
    };
    let tubes = (0..layers).map(tube).collect();
    (Surface::from_mesh(&trunk), tubes)
}

fn passed(body: &Surface<f64>, meshes: &[TriMesh]) -> Option<Resolved> {
    let garments: Vec<RestGarment> = meshes.iter().map(RestGarment::new).collect();
    let layers = layers(&garments, meshes.iter().map(TriMesh::positions));
    let settings = &ResolveSettings::default();
    let task = Task { layers: &layers, settings, budget: &Budget::new(settings, layers.len()) };
    let found = fast_pass(&BodyObstacle::near_layers(body, &layers), task);
    if let Some(found) = &found {
        let mut again = certify(body, &at(&layers, &found.positions)).unwrap();
        again.strain_added = found.certificate.strain_added;
        assert_eq!(again, found.certificate);
        assert!(again.is_clear());
    }
    found
}

#[test]
fn slight_penetrations_are_cleared_and_cloth_hardly_stretches() {
    let mut random = SplitMix::new(2);
    for round in 0..6 {
        let (body, tubes) = scene(&mut random, 1 + round % 3, 0.02);
        let found = passed(&body, &tubes).unwrap();
        assert!(found.garments[0].rounds > 0);
        assert!(found.garments.iter().all(|work| work.largest_move < 0.015), "{:?}", found.garments);
        assert_eq!((found.certificate.vertices_inside, found.certificate.self_triangle_pairs), (0, 0));
    }
}

#[test]
fn a_clean_drape_stays_to_the_bit_and_one_in_the_wrong_order_is_left_to_others() {
    let (body, tubes) = scene(&mut SplitMix::new(3), 2, 0.0);
    let found = passed(&body, &tubes).unwrap();
    assert!(found.positions.iter().zip(&tubes).all(|(p, mesh)| p == mesh.positions()));
    let reversed: Vec<TriMesh> = tubes.into_iter().rev().collect();
    assert!(passed(&body, &reversed).is_none());
}

#[test]
fn results_do_not_depend_on_threads() {
    let (body, tubes) = scene(&mut SplitMix::new(4), 3, 0.02);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| passed(&body, &tubes)).unwrap()
    };
    assert!(with(1).positions == with(4).positions);
}
