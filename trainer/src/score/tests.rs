//! The score against scenes whose answer is known.

use super::*;
use clothcombo_physics::mesh::shapes::{icosphere, mapped, tube, union};
use std::path::Path;

/// A ball as body; two sleeves around it, the outer one with room between.
fn scene() -> (TriMesh, TriMesh, TriMesh) {
    let sleeve = |radius: f64| mapped(&tube(radius, 0.8, 40, 16), |[x, y, z]| [x, y - 0.4, z]);
    (icosphere(0.3, 4), sleeve(0.305), sleeve(0.33))
}

fn draped<'a>(name: &'a str, mesh: &'a TriMesh) -> DrapedGarment<'a> {
    DrapedGarment { name, rest: mesh, positions: mesh.positions(), canonical: None }
}

#[test]
fn weights_are_the_papers() {
    let (body, inner, _) = scene();
    let score = score(&body, &[draped("a", &inner)], ScoreDistance::NearestVertex).unwrap();
    let garment = &score.garments[0];
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/paper.toml");
    let paper = crate::config::load(&paper, &[]).unwrap().losses;
    assert_eq!(garment.raw.len(), 5);
    for (name, raw) in &garment.raw {
        let term = Term::ALL.into_iter().find(|term| term.name() == *name).unwrap();
        let weight = paper.weight(term).at(1.0);
        assert!((garment.weighted[name] - weight * raw).abs() <= 1e-15 * raw.abs(), "{name}");
    }
}

#[test]
fn a_garment_at_rest_over_its_body_has_no_strain_and_intersects_nothing() {
    let (body, inner, outer) = scene();
    let garments = [draped("inner", &inner), draped("outer", &outer)];
    let right = score(&body, &garments, ScoreDistance::Surface).unwrap();
    for garment in &right.garments {
        assert!(garment.raw["strain"].abs() < 1e-20);
        assert_eq!(garment.raw["body_collision"], 0.0);
        assert_eq!(garment.penetration.body_triangle_pairs, 0);
        assert_eq!(garment.penetration.vertices_inside, 0.0);
    }
    let layer = right.layers[0];
    assert_eq!(
        (layer.inner, layer.outer, layer.triangle_pairs, layer.order_violations_nearest_vertex),
        (0, 1, 0, 0.0)
    );
    assert_eq!((layer.layer_collision, layer.layer_distance), (0.0, 0.0));

    // The same in the wrong order: every vertex near the other garment violates it.
    let wrong = score(&body, &[garments[1], garments[0]], ScoreDistance::Surface).unwrap();
    assert!(wrong.layers[0].order_violations_nearest_vertex > 0.99, "{:?}", wrong.layers);
    assert!(wrong.layers[0].layer_collision > 0.0 && wrong.layers[0].layer_distance > 0.0);
    assert_eq!(wrong.garments[0].raw, right.garments[1].raw);
}

#[test]
fn holding_is_measured_where_canonical_positions_are_given_and_strain_is_the_printed_one() {
    // A sleeve with one needle among its triangles: a vertex pulled to a tenth of a millimetre of the opposite edge.
    let (body, sleeve, _) = scene();
    let [a, b, c] = sleeve.faces()[0];
    let mut positions = sleeve.positions().to_vec();
    let middle = |k: usize| 0.5 * (positions[a as usize][k] + positions[b as usize][k]);
    let [x, y, z] = [middle(0), middle(1), middle(2)];
    positions[c as usize] = [x, y + 1e-4, z];
    let rest = sleeve.with_positions(positions).unwrap();
    let positions = mapped(&rest, |[x, y, z]| [1.02 * x, y + 0.01 * x, z]).positions().to_vec();
    let canonical = mapped(&rest, |[x, y, z]| [x, 1.1 * y, z]).positions().to_vec();
    let garment =
        DrapedGarment { canonical: Some(&canonical), positions: &positions, ..draped("tee", &rest) };
    let found = score(&body, &[garment], ScoreDistance::default()).unwrap().garments.remove(0);
    assert_eq!(found.raw.len(), 6);

    // Both formulas as the paper prints them.
    let material = clothcombo_physics::energy::Material::default();
    let sub = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let norm = |p: [f64; 3]| dot(p, p).sqrt();
    let strain: f64 = rest
        .faces()
        .iter()
        .map(|face| {
            let edge = |k: usize, p: &[[f64; 3]]| sub(p[face[(k + 1) % 3] as usize], p[face[k] as usize]);
            let length = |k: &usize| norm(edge(*k, rest.positions()));
            // In a frame along the longest edge, where a needle loses no digits.
            let first = (0..3).max_by(|k, l| length(k).total_cmp(&length(l))).unwrap();
            let edges = |p: &[[f64; 3]]| [edge(first, p), edge((first + 2) % 3, p).map(|x| -x)];
            let ([base, side], [d1, d2]) = (edges(rest.positions()), edges(&positions));
            let x1 = norm(base);
            let x2 = dot(side, base) / x1;
            let [a, b, c] = base;
            let [d, e, f] = side;
            let y2 = norm([b * f - c * e, c * d - a * f, a * e - b * d]) / x1;
            let f1 = d1.map(|x| x / x1);
            let f2: [f64; 3] = std::array::from_fn(|k| (d2[k] - d1[k] * x2 / x1) / y2);
            let [g11, g12, g22] = [0.5 * (dot(f1, f1) - 1.0), 0.5 * dot(f1, f2), 0.5 * (dot(f2, f2) - 1.0)];
            let square = g11 * g11 + 2.0 * g12 * g12 + g22 * g22;
            let density = 0.5 * material.lambda * (g11 + g22).powi(2) + material.mu * square;
            0.5 * x1 * y2 * material.thickness * density
        })
        .sum();
    assert!((found.raw["strain"] / strain - 1.0).abs() < 1e-12, "{} {strain}", found.raw["strain"]);
    let mut heights: Vec<f64> = rest.positions().iter().map(|p| p[1]).collect();
    heights.sort_by(|a, b| b.total_cmp(a));
    let held = heights.len().div_ceil(10);
    let holding: f64 = heights[..held].iter().map(|y| (0.1 * y).powi(2)).sum();
    assert!((found.raw["holding"] / holding - 1.0).abs() < 1e-12, "{} {holding}", found.raw["holding"]);
    let part = DrapedGarment { canonical: Some(&canonical[1..]), ..garment };
    let error = score(&body, &[part], ScoreDistance::default()).unwrap_err().to_string();
    assert!(error.contains("garment 'tee'") && error.contains("positions"), "{error}");
}

#[test]
fn a_lifted_body_intersects_the_sleeve_and_is_measured_in_millimetres() {
    let (body, inner, _) = scene();
    let moved = mapped(&body, |[x, y, z]| [x + 0.02, y, z]);
    for distance in [ScoreDistance::NearestVertex, ScoreDistance::Surface] {
        let score = score(&moved, &[draped("a", &inner)], distance).unwrap();
        let found = score.garments[0].penetration;
        assert!((found.max_depth_mm - 15.0).abs() < 2.0, "{found:?}");
        assert!(found.vertices_inside > 0.03 && found.vertices_inside < 0.5);
        assert!(found.body_triangle_pairs > 20);
    }
}

#[test]
fn stray_vertices_of_the_body_change_nothing_and_its_self_intersections_are_apart() {
    let (body, inner, _) = scene();
    let garments = [draped("a", &inner)];
    let plain = score(&body, &garments, ScoreDistance::NearestVertex).unwrap();
    let mut positions = body.positions().to_vec();
    positions.splice(0..0, inner.positions().iter().copied());
    let first = inner.vertex_count() as u32;
    let faces = body.faces().iter().map(|f| f.map(|v| v + first)).collect();
    let stray = TriMesh::new(positions, faces).unwrap();
    assert_eq!(score(&stray, &garments, ScoreDistance::NearestVertex).unwrap(), plain);

    let second = mapped(&body, |[x, y, z]| [x, y + 0.55, z + 0.001]);
    let twice = score(&union(&[&body, &second]), &garments, ScoreDistance::Surface).unwrap();
    assert!(twice.body.self_triangle_pairs > 0);
    assert_eq!(twice.garments[0].penetration.self_triangle_pairs, 0);
}

#[test]
fn what_cannot_be_scored_is_named() {
    let (body, inner, _) = scene();
    let short = DrapedGarment { positions: &inner.positions()[1..], ..draped("tee", &inner) };
    let said = |garment| score(&body, &[garment], ScoreDistance::default()).unwrap_err().to_string();
    let error = said(short);
    assert!(error.contains("garment 'tee'") && error.contains("positions"), "{error}");
    let flat = mapped(&inner, |_| [0.0; 3]);
    let error = said(draped("flat", &flat));
    assert!(error.contains("garment 'flat'") && error.contains("area"), "{error}");
    let huge = mapped(&inner, |p| p.map(|x| 1e160 * x));
    let far = DrapedGarment { positions: huge.positions(), ..draped("huge", &inner) };
    let error = said(far);
    assert!(error.contains("'huge' has a "), "{error}");
}
