//! Forces of the cloth itself, as displacements that would follow them.

use super::rings::Rings;
use crate::energy::{EnergySettings, GarmentState, SceneGarment, Term, Weighted};
use crate::vec3::{norm, scale, to_f64, zero};

/// Averaging passes between one scale of the forces and the next.
const PASSES: [usize; 2] = [4, 16];
/// Scales of the forces.
pub(super) const SCALES: usize = 1 + PASSES.len();
/// Unit of the displacements that forces stand for (m), and how many of it they come to at most.
const UNIT: f64 = 0.002;
const MOST: f64 = 5.0;

/// Elastic forces of a garment at `posed` over the stiffness of its cloth against stretch, in units of 2 mm and shorter than 5
/// of them, at every vertex and averaged over ever larger surroundings: what a solver would move the vertices by to relax short
/// waves, and longer ones.
pub(super) fn relaxing(
    garment: &SceneGarment<f32>,
    settings: &EnergySettings,
    rings: &Rings,
    posed: &[[f32; 3]],
) -> [Vec<[f64; 3]>; SCALES] {
    let state = GarmentState {
        posed,
        canonical: &[],
        holding_reference: &[],
        pull_back: None,
        thickness_below: &[],
        gaps: &[],
        settings,
    };
    let mut gradient = vec![zero(); posed.len()];
    let elastic = |term: &Term| matches!(term, Term::Strain | Term::Bending);
    for (term, energy) in garment.energies.terms().filter(|(term, _)| elastic(term)) {
        let target = Weighted { weight: garment.weights[term], gradient: &mut gradient };
        energy.evaluate(&state, Some(target));
    }
    let material = &settings.material;
    let stiffness = (material.lambda + 2.0 * material.mu) * material.thickness;
    let per_force = if stiffness > 0.0 { 1.0 / (stiffness * UNIT) } else { 0.0 };
    let mut forces: Vec<[f64; 3]> = gradient.iter().map(|g| scale(to_f64(*g), -per_force)).collect();
    let finest = forces.iter().map(|f| shortened(*f)).collect();
    let [coarse, coarsest] = PASSES.map(|passes| {
        (0..passes).for_each(|_| forces = rings.averaged(&forces));
        forces.iter().map(|f| shortened(*f)).collect()
    });
    [finest, coarse, coarsest]
}

/// The same direction, the length below [`MOST`].
fn shortened(v: [f64; 3]) -> [f64; 3] {
    scale(v, 1.0 / (1.0 + norm(v) / MOST))
}
