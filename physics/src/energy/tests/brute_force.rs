//! Accelerated sums against double loops that follow the paper's formulas.

use super::scenes::{body, garment, jittered, only, paper_weights, scene, scene_of};
use crate::energy::repulsion::Repulsion;
use crate::energy::{EnergySettings, Term, TermMap, Weighted};
use crate::mesh::{Topology, vertex_normals};
use crate::query::brute_force::nearest as nearest_vertex;
use crate::vec3;

/// `Σ −log d²` over close pairs without an edge, and its gradient.
fn repulsion(positions: &[[f64; 3]], topology: &Topology, radius: f64) -> (f64, Vec<[f64; 3]>) {
    let mut sum = 0.0;
    let mut gradient = vec![[0.0; 3]; positions.len()];
    for i in 0..positions.len() {
        for j in i + 1..positions.len() {
            let offset = vec3::sub(positions[i], positions[j]);
            let squared = vec3::norm_squared(offset);
            if squared < radius * radius && !topology.edges.contains(&[i as u32, j as u32]) {
                sum -= squared.ln();
                vec3::axpy(&mut gradient[i], -2.0 / squared, offset);
                vec3::axpy(&mut gradient[j], 2.0 / squared, offset);
            }
        }
    }
    (sum, gradient)
}

#[test]
fn repulsion_is_the_double_loop() {
    for (radius, seed) in [(0.1, 1), (0.06, 2), (0.5, 3)] {
        let rest = garment(0.12, 17, 8, seed);
        let posed = jittered(&rest, 0.02, seed + 9);
        let topology = Topology::new(&rest);
        let (sum, expected) = repulsion(posed.positions(), &topology, radius);
        assert!(sum > 0.0);
        let count = rest.vertex_count() as f64;
        for (normalised, scale) in [(true, 1.0 / count), (false, 1.0)] {
            let mut gradient = vec![[0.0; 3]; rest.vertex_count()];
            let target = Weighted { weight: 1.0 / scale, gradient: &mut gradient };
            let settings = EnergySettings {
                repulsion_radius: radius,
                repulsion_normalised: normalised,
                ..EnergySettings::default()
            };
            let value = Repulsion::new(&topology).evaluate(posed.positions(), &settings, Some(target));
            assert!((value / (scale * sum) - 1.0).abs() < 1e-12, "{value} {}", scale * sum);
            let largest = super::scenes::largest(&expected);
            for (g, e) in gradient.iter().zip(&expected) {
                assert!(vec3::norm(vec3::sub(*g, *e)) < 1e-11 * largest);
            }
        }
    }
}

#[test]
fn random_subsets_are_unbiased_estimates_of_the_full_sum() {
    let rest = garment(0.12, 17, 8, 1);
    let posed = jittered(&rest, 0.02, 4);
    let (topology, count) = (Topology::new(&rest), rest.vertex_count());
    let evaluate = |subset: Option<usize>, sample: u32| {
        let mut gradient = vec![[0.0; 3]; count];
        let target = Weighted { weight: 1.0, gradient: &mut gradient };
        let settings = EnergySettings {
            repulsion_subset: subset,
            repulsion_sample: sample,
            ..EnergySettings::default()
        };
        let value = Repulsion::new(&topology).evaluate(posed.positions(), &settings, Some(target));
        (value, gradient)
    };
    let (full, full_gradient) = evaluate(None, 0);
    const SAMPLES: u32 = 4000;
    let (mut sum, mut squares, mut gradients) = (0.0, 0.0, vec![[0.0; 3]; count]);
    for sample in 0..SAMPLES {
        let (value, gradient) = evaluate(Some(4), sample);
        assert_eq!((value, &gradient), (evaluate(Some(4), sample).0, &gradient));
        sum += value;
        squares += value * value;
        gradients.iter_mut().zip(gradient).for_each(|(all, own)| vec3::axpy(all, 1.0, own));
    }
    let mean = sum / f64::from(SAMPLES);
    let deviation = (squares / f64::from(SAMPLES) - mean * mean).sqrt();
    assert!(deviation > 0.01 * full, "samples differ: {deviation}");
    assert!((mean - full).abs() < 4.0 * deviation / f64::from(SAMPLES).sqrt(), "{mean} {full} {deviation}");
    let difference =
        |g: &[f64; 3], e: &[f64; 3]| vec3::norm(vec3::sub(vec3::scale(*g, 1.0 / f64::from(SAMPLES)), *e));
    let off: f64 = gradients.iter().zip(&full_gradient).map(|(g, e)| difference(g, e)).sum();
    let size: f64 = full_gradient.iter().map(|g| vec3::norm(*g)).sum();
    assert!(off < 0.15 * size, "{off} of {size}");
    // As many partners as there are: the full sum itself.
    assert_eq!(evaluate(Some(count / 2), 3).0, full);
}

#[test]
fn body_collision_is_the_double_loop() {
    let scene = scene::<f64>(EnergySettings::default(), only(Term::BodyCollision), 3);
    let surface = &scene.energy.body;
    let first = scene.rest[0].vertex_count();
    let mut sums = [0.0, 0.0];
    for (v, p) in scene.posed.iter().enumerate() {
        let b = nearest_vertex(&surface.positions, *p).0 as usize;
        let d = vec3::dot(vec3::sub(*p, surface.positions[b]), surface.normals[b]);
        sums[usize::from(v >= first)] += (0.002f64 - d).max(0.0).powi(3);
    }
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    for (raw, sum) in value.garments.iter().zip(sums) {
        assert!((raw[Term::BodyCollision].unwrap_or(0.0) / sum - 1.0).abs() < 1e-12);
    }
}

#[test]
fn layer_collision_is_the_double_loop() {
    for gate in [None, EnergySettings::default().layer_gate] {
        let settings = EnergySettings { layer_gate: gate, ..EnergySettings::default() };
        let scene = scene::<f64>(settings, only(Term::LayerCollision), 4);
        let (inner, outer) = scene.posed.split_at(scene.rest[0].vertex_count());
        let normals = vertex_normals(inner, scene.rest[0].faces());
        let mut sum = 0.0;
        for p in outer {
            let v = nearest_vertex(inner, *p).0 as usize;
            let offset = vec3::sub(*p, inner[v]);
            let d = vec3::dot(offset, normals[v]);
            let tangential = vec3::norm(vec3::add_scaled(offset, -d, normals[v]));
            let edge = scene.rest[0].median_edge_length();
            if gate.is_none_or(|g| d.abs() <= g.depth && tangential <= g.tangential_edges * edge) {
                sum += (0.002 - d).max(0.0).powi(3);
            }
        }
        let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
        let raw = value.layers[0][Term::LayerCollision].unwrap_or(0.0);
        // The regularised normal is 5e-9 short of a unit one at rest, more where triangles have shrunk.
        assert!((raw / sum - 1.0).abs() < 1e-6, "{raw} {sum}");
    }
}

#[test]
fn layer_distance_is_the_double_loop() {
    // Dense garments on a coarse body: several vertices of each per bucket.
    let rest = vec![garment(0.121, 40, 30, 1), garment(0.121, 36, 34, 2)];
    let settings = EnergySettings { layer_distance_radius: 0.006, ..EnergySettings::default() };
    let scene = scene_of::<f64>(rest, &body(2), settings, only(Term::LayerDistance), 0.008, 2);
    let surface = &scene.energy.body;
    let near: Vec<(usize, f64, [f64; 3])> = scene
        .posed
        .iter()
        .map(|p| {
            let b = nearest_vertex(&surface.positions, *p).0 as usize;
            (b, vec3::dot(vec3::sub(*p, surface.positions[b]), surface.normals[b]), surface.normals[b])
        })
        .collect();
    let (inner, outer) = near.split_at(scene.rest[0].vertex_count());
    let mut sum = 0.0;
    let mut pairs = 0;
    let mut expected = vec![[0.0; 3]; near.len()];
    for (i, (bi, di, ni)) in inner.iter().enumerate() {
        for (j, (bj, dj, nj)) in outer.iter().enumerate() {
            if bi == bj && *di < 0.006 && *dj < 0.006 && di > dj {
                sum += (di - dj).powi(3);
                let slope = 3.0 * (di - dj).powi(2);
                vec3::axpy(&mut expected[i], slope, *ni);
                vec3::axpy(&mut expected[inner.len() + j], -slope, *nj);
                pairs += 1;
            }
        }
    }
    assert!(pairs > 500);
    let value = scene.energy.evaluate(&scene.posed, &scene.canonical);
    let raw = value.layers[0][Term::LayerDistance].unwrap_or(0.0);
    assert!((raw / sum - 1.0).abs() < 1e-10, "{raw} {sum}");
    let largest = super::scenes::largest(&expected);
    for (g, e) in value.posed_gradient.iter().zip(&expected) {
        assert!(vec3::norm(vec3::sub(*g, *e)) < 1e-10 * largest);
    }
}

#[test]
fn pairs_of_many_layers_add_up() {
    let rest = vec![garment(0.121, 17, 8, 1), garment(0.122, 15, 9, 2), garment(0.123, 16, 7, 3)];
    let layer_weights = TermMap::from_fn(|t| if t.is_layer_term() { paper_weights()[t] } else { 0.0 });
    let all = scene_of::<f64>(rest, &body(1), EnergySettings::default(), layer_weights, 0.008, 1);
    let together = all.energy.evaluate(&all.posed, &all.canonical);
    let mut total = 0.0;
    for pair in 0..3 {
        let mut one = all.energy.clone();
        one.layers = vec![all.energy.layers[pair].clone()];
        let value = one.evaluate(&all.posed, &all.canonical);
        assert_eq!(value.layers[0], together.layers[pair]);
        total += value.total;
    }
    assert!(total > 0.0 && (together.total / total - 1.0).abs() < 1e-12);
}
