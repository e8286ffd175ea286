//! Gravity: potential energy of the vertices (paper, equation for L_g).
//!
//! `Σ m·g·y` with a third of the rest mass of its triangles at every vertex. Heights count from the origin, the pelvis of
//! the body: only differences mean something.

use super::{GarmentState, GarmentTerm, Material, Weighted};
use crate::mesh::TriMesh;
use crate::real::Real;

/// The potential energy of one garment.
#[derive(Debug, Clone)]
pub struct Gravity {
    /// Mass × acceleration of every vertex (N).
    weights: Vec<f64>,
}

impl Gravity {
    /// Lumps the rest mass of `rest` at its vertices; `acceleration` (m/s²) points along −y.
    pub fn new(rest: &TriMesh, material: &Material, acceleration: f64) -> Self {
        let mut weights = vec![0.0; rest.vertex_count()];
        for (f, face) in rest.faces().iter().enumerate() {
            let third = rest.face_area(f) * material.thickness * material.density * acceleration / 3.0;
            for &v in face {
                weights[v as usize] += third;
            }
        }
        Self { weights }
    }

    /// Energy (J) at `positions` `[V, 3]` (m); adds its weighted gradient to `target`.
    pub fn evaluate<T: Real>(&self, positions: &[[T; 3]], target: Option<Weighted<'_, T>>) -> f64 {
        if let Some(mut target) = target {
            for (v, weight) in self.weights.iter().enumerate() {
                target.add(v, [0.0, *weight, 0.0]);
            }
        }
        self.weights.iter().zip(positions).map(|(weight, p)| weight * p[1].to_f64()).sum()
    }
}

impl<T: Real> GarmentTerm<T> for Gravity {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.posed, target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_lifted_sheet_gains_its_weight_times_height() {
        let sheet = shapes::irregular_grid(0.5, 0.8, 7, 9, 0.3, 3);
        let gravity = Gravity::new(&sheet, &Material::default(), 9.81);
        let lifted = shapes::mapped(&sheet, |[x, y, z]| [x, y + 0.25, z]);
        let gained = gravity.evaluate(lifted.positions(), None) - gravity.evaluate(sheet.positions(), None);
        let expected = 0.4 * 0.2002 * 9.81 * 0.25;
        assert!((gained / expected - 1.0).abs() < 2e-4, "{gained} {expected}");
    }
}
