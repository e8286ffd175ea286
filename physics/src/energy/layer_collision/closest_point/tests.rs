//! The closest-point form against brute force, and where the paper's form jumps. Its gradient and its curvature are checked with
//! all others.

use super::super::InnerLayer;
use super::*;
use crate::energy::{ContactPoints, LayerContact, LayerGate};
use crate::mesh::shapes::{self, SplitMix};
use crate::query::brute_force;
use crate::vec3::norm;

const EPSILON: f64 = 0.002;

fn settings() -> EnergySettings {
    EnergySettings { layer_collision_epsilon: EPSILON, ..EnergySettings::default() }
}

fn garment(mesh: &TriMesh) -> InnerLayer {
    InnerLayer::new(mesh, &Topology::new(mesh))
}

/// Points without a garment.
fn loose(points: &[[f64; 3]]) -> OuterPoints<'static, f64> {
    let none = Box::leak(Box::new(ContactPoints::of_vertices(points.len())));
    OuterPoints::new(none, points, Default::default())
}

#[test]
fn is_the_sum_over_the_exact_distances() {
    // Closed, so that there is no hem.
    let inner = shapes::icosphere(0.15, 3);
    let mut random = SplitMix::new(5);
    let outer: Vec<[f64; 3]> = (0..200)
        .map(|_| {
            let p: [f64; 3] = std::array::from_fn(|_| random.symmetric());
            scale(p, (0.15 + 0.004 * random.symmetric()) / norm(p))
        })
        .collect();
    let depth = |p: &[f64; 3]| {
        let distance = brute_force::distance_to_surface(inner.positions(), inner.faces(), *p);
        let is_inside = brute_force::winding_number(inner.positions(), inner.faces(), *p) > 0.5;
        EPSILON + if is_inside { distance } else { -distance }
    };
    let expected: f64 = outer.iter().map(|p| depth(p).max(0.0).powi(3)).sum();
    let (garment, p) = (garment(&inner), inner.positions());
    let found =
        garment.evaluate(p, &garment.posed(p, LayerContact::ClosestPoint), loose(&outer), &settings(), None);
    assert!(found > 0.0 && (found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
}

/// The largest jump of the energy of one vertex between neighbouring places on a straight line, as a share of the largest energy.
fn largest_jump(inner: &TriMesh, from: [f64; 3], to: [f64; 3], contact: LayerContact) -> f64 {
    const STEPS: usize = 4000;
    let (garment, p) = (garment(inner), inner.positions());
    let posed = garment.posed(p, contact);
    let at = |i: usize| add_scaled(from, i as f64 / STEPS as f64, sub(to, from));
    let energy = |i: usize| garment.evaluate(p, &posed, loose(&[at(i)]), &settings(), None);
    let energies: Vec<f64> = (0..=STEPS).map(energy).collect();
    let jumps = energies.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    jumps.fold(0.0, f64::max) / energies.iter().fold(0.0, |m: f64, e| m.max(*e))
}

#[test]
fn has_no_jumps_along_the_cloth_and_past_a_hem() {
    let inner = shapes::tube(0.15, 0.4, 40, 16);
    // 1 mm under the cloth; around it, and down past the hem.
    let lines = [([0.149, 0.2, 0.02], [0.149, 0.2, -0.02]), ([0.1485, 0.1, 0.013], [0.1485, -0.1, 0.013])];
    for (from, to) in lines {
        let smooth = largest_jump(&inner, from, to, LayerContact::ClosestPoint);
        assert!(smooth < 0.01, "{smooth}");
    }
    // The paper's form ends at the gate.
    let [_, (from, to)] = lines;
    assert!(largest_jump(&inner, from, to, LayerContact::NearestVertex) > 0.5);
}

/// Cloth under a hem that others push past it rests there: no force may end at once.
#[test]
fn the_force_fades_out_towards_a_hem() {
    let inner = shapes::tube(0.15, 0.4, 40, 16);
    let (garment, p) = (garment(&inner), inner.positions());
    let posed = garment.posed(p, LayerContact::ClosestPoint);
    let hem = p.iter().fold(f64::INFINITY, |low: f64, p| low.min(p[1]));
    // 5 mm under the cloth, so many metres above the hem.
    let energy =
        |height: f64| garment.evaluate(p, &posed, loose(&[[0.1445, hem + height, 0.003]]), &settings(), None);
    let step = 1e-8;
    let force = |height: f64| (energy(height + step) - energy(height - step)) / (2.0 * step);
    let largest = (1..50).map(|i| force(5e-4 * f64::from(i)).abs()).fold(0.0, f64::max);
    assert!(largest > 0.0);
    for height in [1e-5, -1e-5] {
        assert!(force(height).abs() < 0.01 * largest, "{height}: {} {largest}", force(height));
    }
}

/// The limit that the module names: over one sheet and under another of the same garment.
#[test]
fn jumps_between_two_sheets() {
    let sheets = [0.15, 0.14].map(|radius| shapes::tube(radius, 0.4, 40, 16));
    let inner = shapes::union(&sheets.each_ref());
    let jump = largest_jump(&inner, [0.148, 0.2, 0.0], [0.142, 0.2, 0.0], LayerContact::ClosestPoint);
    assert!(jump > 0.5, "{jump}");
}

#[test]
fn deep_cloth_fades_out_smoothly() {
    let depth = LayerGate::default().depth;
    for i in 1..2000 {
        let (d, step) = (EPSILON - 0.06 * f64::from(i) / 2000.0, 1e-7);
        let [value, slope, _] = penalty(d, EPSILON, depth);
        let [above, below] = [step, -step].map(|s| penalty(d + s, EPSILON, depth)[0]);
        assert!((slope - (above - below) / (2.0 * step)).abs() < 1e-8, "{d}: {slope}");
        assert!(value >= 0.0 && (value == 0.0) == (d <= -depth), "{d}");
    }
}

/// The blocks of one vertex with itself.
struct Own(usize, [[f64; 3]; 3]);

impl CurvatureSink for Own {
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        if i == self.0 && j == self.0 {
            self.1 = std::array::from_fn(|r| add(self.1[r], block[r]));
        }
    }
}

#[test]
fn curvature_is_exact_for_a_vertex_over_flat_cloth() {
    let inner = shapes::grid(1.0, 1.0, 5, 5);
    let (garment, settings) = (garment(&inner), settings());
    let posed = garment.posed(inner.positions(), LayerContact::ClosestPoint);
    let vertex = inner.vertex_count();
    let p = [0.47, 0.53, 0.0007];
    let mut own = Own(vertex, [[0.0; 3]; 3]);
    garment.curvature(&posed, &loose(&[p]), &settings, [0, vertex], &mut own);
    let gradient = |p: [f64; 3]| {
        let (mut of_inner, mut of_outer) = (vec![[0.0; 3]; vertex], vec![[0.0; 3]; 1]);
        let [a, b] = [&mut of_inner[..], &mut of_outer[..]].map(|g| Weighted { weight: 1.0, gradient: g });
        garment.evaluate(inner.positions(), &posed, loose(&[p]), &settings, Some([a, b]));
        of_outer[0]
    };
    let step = 1e-7;
    for k in 0..3 {
        let mut moved = [p, p];
        moved[0][k] += step;
        moved[1][k] -= step;
        let column = scale(sub(gradient(moved[0]), gradient(moved[1])), 0.5 / step);
        let error = norm(sub(column, [own.1[0][k], own.1[1][k], own.1[2][k]]));
        assert!(error < 1e-6 * own.1[2][2], "{k}: {error}");
    }
    assert!((own.1[2][2] / (6.0 * (EPSILON - p[2])) - 1.0).abs() < 1e-9);
}
