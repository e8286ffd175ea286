//! Holding: keeps garments that hang from nothing at their height (paper, equation for L_h).
//!
//! `Σ H·(y − y_ref)²` over vertices, on canonical positions (before skinning), `H` being 1 for the top tenth of the vertices
//! at rest. The paper's `y_ref` is the rest garment; training measures against the shape-transferred rest, because the
//! printed form punishes a garment for following its body. The caller chooses through
//! [`super::SceneGarment::holding_reference`].

use super::{CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::mesh::TriMesh;
use crate::real::Real;

/// The holding energy of one garment.
#[derive(Debug, Clone)]
pub struct Holding {
    held: Vec<u32>,
}

impl Holding {
    /// Holds the `fraction` (rounded up to a vertex) of the vertices that is highest at rest; of equally high ones the first.
    pub fn new(rest: &TriMesh, fraction: f64) -> Self {
        let positions = rest.positions();
        let mut held: Vec<u32> = (0..positions.len() as u32).collect();
        held.sort_by(|&a, &b| positions[b as usize][1].total_cmp(&positions[a as usize][1]));
        // Rounding up must not turn 0.1·30 = 3.0000000000000004 into 4.
        held.truncate((fraction * positions.len() as f64 - 1e-9).ceil().max(0.0) as usize);
        held.sort_unstable();
        Self { held }
    }

    /// The held vertices, ascending.
    pub fn held(&self) -> &[u32] {
        &self.held
    }

    /// Energy [m²] at canonical `positions` against `reference`, both `[V, 3]` [m]; adds its weighted gradient to `target`.
    pub fn evaluate<T: Real>(
        &self,
        positions: &[[T; 3]],
        reference: &[[T; 3]],
        mut target: Option<Weighted<'_, T>>,
    ) -> f64 {
        let mut energy = 0.0;
        for &v in &self.held {
            let v = v as usize;
            let raised = positions[v][1].to_f64() - reference[v][1].to_f64();
            energy += raised * raised;
            if let Some(target) = &mut target {
                target.add(v, [0.0, 2.0 * raised, 0.0]);
            }
        }
        energy
    }
}

impl<T: Real> GarmentTerm<T> for Holding {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.canonical, state.holding_reference, target)
    }

    /// Exact: the energy is quadratic.
    fn curvature(&self, _state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        for &v in &self.held {
            sink.add(v as usize, v as usize, [[0.0; 3], [0.0, 2.0, 0.0], [0.0; 3]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_highest_tenth_is_held() {
        let sheet = shapes::grid(0.3, 0.9, 4, 9);
        let holding = Holding::new(&sheet, 0.1);
        // 50 vertices, rows of 5: the top row.
        assert_eq!(holding.held(), [45, 46, 47, 48, 49]);
        assert!(Holding::new(&sheet, 0.0).held().is_empty());
        assert_eq!(Holding::new(&sheet, 1.0).held().len(), 50);
        let raised = shapes::mapped(&sheet, |[x, y, z]| [x + 1.0, y + 0.5, z]);
        let energy = holding.evaluate(raised.positions(), sheet.positions(), None);
        assert!((energy - 5.0 * 0.25).abs() < 1e-12);
    }
}
