//! What a certificate counts.

use super::*;
use crate::contact::resolve::count::certified;
use crate::contact::resolve::obstacle::BodyObstacle;

/// Depths under the body and under inner layers are counted apart.
#[test]
fn the_certificate_counts_vertices_inside_the_body_only() {
    let trunk = shapes::icosphere(0.15, 4);
    let tube = |radius, sides| moved(&shapes::tube(radius, 0.2, sides, 15), [0.0, -0.1, 0.0]);
    // The second lies under the first, the third over both.
    let scene = Scene::new(&trunk, &[tube(0.175, 48), tube(0.165, 44), tube(0.185, 52)]);
    let found = certify(&scene.body, &scene.layers()).unwrap();
    assert!(found.is_clear() && found.order_violations > 0.2, "{found:?}");
    assert_eq!(found.vertices_inside, 0);
    // The middle of a tube that is too tight, twice, with a wide one between.
    let tight = tube(0.14, 60);
    let inside = tight.positions().iter().filter(|p| norm(**p) < 0.15).count();
    let scene = Scene::new(&trunk, &[tight.clone(), tube(0.175, 48), tight]);
    let found = certify(&scene.body, &scene.layers()).unwrap();
    assert!(inside > 100 && found.vertices_inside == 2 * inside, "{inside} {found:?}");
}

/// The body was prepared near where the sheet was; it is certified where it ended up, at another ball.
#[test]
fn what_went_far_is_certified_against_all_that_is_there() {
    let ball = shapes::icosphere(0.1, 3);
    let body = shapes::union(&[&ball, &moved(&ball, [0.0, 0.6, 0.0])]);
    let scene = Scene::new(&body, &[sheet(0.3, 12, -0.15)]);
    let layers = scene.layers();
    let up = vec![scene.positions[0].iter().map(|p| add(*p, [0.0, 0.75, 0.0])).collect::<Vec<_>>()];
    let faces = scene.garments[0].faces();
    let expected = brute_force_pairs(&[(body.positions(), body.faces()), (&up[0], faces)]);
    let found = certified(&BodyObstacle::near_layers(&scene.body, &layers), &layers, &up);
    assert!(expected > 20 && found.body_triangle_pairs == expected);
}
