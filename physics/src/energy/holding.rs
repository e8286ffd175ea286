//! Holding: keeps garments that hang from nothing at their height (paper, equation for L_h).
//!
//! `Σ H·(y − y_ref)²` over vertices, `H` being 1 for the top tenth of the vertices at rest and `y` a height before skinning.
//! The paper reads `y` off the canonical positions `x + Δx`. These do not say where the garment is once the skin weights are
//! learned as well: ΔW can slide a waistband down for nothing. So training, refinement and the reference read it
//! off the posed positions, pulled back by the skinning that the garment started with: `y = (T₀⁻¹ x̂)_y`, with `T₀` blended
//! by the *initial* weights and held fixed. The gradient is then `T₀⁻ᵀ e_y 2(y − y_ref)` at posed positions. With
//! `Δx` alone (ΔW = 0) both are the same. [`super::SceneGarment::pull_back`] chooses.
//!
//! The paper's `y_ref` is the rest garment; training measures against the shape-transferred rest, because the printed form
//! punishes a garment for following its body: [`super::SceneGarment::holding_reference`].

use super::garment_term::HeightRow;
use super::{CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::mesh::TriMesh;
use crate::real::Real;
use crate::transform::{Transform, inverse};
use crate::vec3::{scale, to_f64};

/// Blended transforms with a smaller determinant have no height before skinning: half a turn between two bones flattens the
/// cloth that both carry. One of 0.05 belongs to bones of equal weight at 154°, beyond every joint limit.
const SMALLEST_HELD_DETERMINANT: f64 = 0.05;

/// The row of every one of `transforms`, canonical → posed; zero where there is none, whose vertices are then not held.
pub fn height_rows(transforms: &[Transform]) -> Vec<HeightRow> {
    transforms
        .iter()
        .map(|t| inverse(t, SMALLEST_HELD_DETERMINANT).map_or([0.0; 4], |rows| rows[1]))
        .collect()
}

/// The holding energy of one garment.
#[derive(Debug, Clone)]
pub struct Holding {
    /// Vertices, ascending.
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

    /// Every held vertex with its height above the reference (m), and how that changes with the position it is read off.
    fn raised<'a, T: Real>(
        &'a self,
        state: &'a GarmentState<'_, T>,
    ) -> impl Iterator<Item = (usize, f64, [f64; 3])> + 'a {
        self.held.iter().filter_map(move |&v| {
            let v = v as usize;
            let reference = state.holding_reference[v][1].to_f64();
            match state.pull_back {
                None => Some((v, state.canonical[v][1].to_f64() - reference, [0.0, 1.0, 0.0])),
                Some(rows) if rows[v] == [0.0; 4] => None,
                Some(rows) => {
                    let ([a, b, c, d], [x, y, z]) = (rows[v], to_f64(state.posed[v]));
                    Some((v, a * x + b * y + c * z + d - reference, [a, b, c]))
                }
            }
        })
    }
}

impl<T: Real> GarmentTerm<T> for Holding {
    /// Energy (m²).
    fn evaluate(&self, state: &GarmentState<'_, T>, mut target: Option<Weighted<'_, T>>) -> f64 {
        let mut energy = 0.0;
        for (v, raised, along) in self.raised(state) {
            energy += raised * raised;
            if let Some(target) = &mut target {
                target.add(v, scale(along, 2.0 * raised));
            }
        }
        energy
    }

    /// Exact: the energy is quadratic.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        for (v, _, along) in self.raised(state) {
            sink.add(v, v, along.map(|a| along.map(|b| 2.0 * a * b)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::EnergySettings;
    use crate::mesh::shapes;

    fn state<'a>(
        posed: &'a TriMesh,
        canonical: &'a TriMesh,
        rest: &'a TriMesh,
        pull_back: Option<&'a [HeightRow]>,
        settings: &'a EnergySettings,
    ) -> GarmentState<'a, f64> {
        GarmentState {
            posed: posed.positions(),
            canonical: canonical.positions(),
            holding_reference: rest.positions(),
            pull_back,
            thickness_below: &[],
            gaps: &[],
            settings,
        }
    }

    #[test]
    fn the_highest_tenth_is_held() {
        let sheet = shapes::grid(0.3, 0.9, 4, 9);
        let holding = Holding::new(&sheet, 0.1);
        // 50 vertices, rows of 5: the top row.
        assert_eq!(holding.held, [45, 46, 47, 48, 49]);
        assert!(Holding::new(&sheet, 0.0).held.is_empty());
        assert_eq!(Holding::new(&sheet, 1.0).held.len(), 50);
        let raised = shapes::mapped(&sheet, |[x, y, z]| [x + 1.0, y + 0.5, z]);
        let settings = EnergySettings::default();
        let energy = holding.evaluate(&state(&sheet, &raised, &sheet, None, &settings), None);
        assert!((energy - 5.0 * 0.25).abs() < 1e-12);
    }

    #[test]
    fn heights_are_those_before_skinning_and_of_flattened_cloth_there_is_none() {
        // Skinning turns the sheet about z by a right angle and lifts it: what was up points to −x.
        let sheet = shapes::grid(0.3, 0.9, 4, 9);
        let quarter: Transform = [[0.0, -1.0, 0.0, 0.2], [1.0, 0.0, 0.0, 0.7], [0.0, 0.0, 1.0, 0.0]];
        let mut transforms = vec![quarter; sheet.vertex_count()];
        let slid = shapes::mapped(&sheet, |[x, y, z]| [0.2 - (y - 0.04), x + 0.7, z]);
        let (holding, settings) = (Holding::new(&sheet, 0.1), EnergySettings::default());
        let value = |transforms: &[Transform]| {
            let rows = height_rows(transforms);
            // The canonical positions do not matter.
            holding.evaluate(&state(&slid, &slid, &sheet, Some(&rows), &settings), None)
        };
        assert!((value(&transforms) - 5.0 * 0.04 * 0.04).abs() < 1e-12);
        transforms[47] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1e-3, 0.0, 5.0], [0.0, 0.0, 1.0, 0.0]];
        assert!((value(&transforms) - 4.0 * 0.04 * 0.04).abs() < 1e-12);
    }
}
