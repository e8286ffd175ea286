//! The best of several states of a scene, by the losses that the networks were trained with.
//!
//! A correction network may make worse what is unlike anything that it was trained on. The losses need no ground truth, so that
//! this can be seen at inference, and what was not better is not taken.

use crate::evaluate::Draped;
use crate::felt::Company;
use clothcombo_physics::energy::{SceneEnergy, SceneGarment, TermMap};

/// The one of `states` with the least energy: of the outfit, or of every garment by itself where it is `Alone`. Energies that are
/// not finite count as infinite; of equal ones the first is taken.
///
/// # Panics
/// Without any state.
pub fn least_energy(states: &[Draped], energy: &SceneEnergy<f32>, company: Company) -> Draped {
    match company {
        Company::Together => {
            let values = states.iter().map(|s| energy.value(&s.posed, &s.canonical).total);
            states[least(values)].clone()
        }
        Company::Alone => {
            let energy = energy.without_layers();
            let values: Vec<Vec<f64>> = states.iter().map(|state| of_garments(&energy, state)).collect();
            let mut best = states[0].clone();
            let mut first = 0;
            for (i, garment) in energy.garments.iter().enumerate() {
                let rows = first..first + garment.energies.vertex_count();
                first = rows.end;
                let chosen = &states[least(values.iter().map(|of_state| of_state[i]))];
                best.posed[rows.clone()].copy_from_slice(&chosen.posed[rows.clone()]);
                best.canonical[rows.clone()].copy_from_slice(&chosen.canonical[rows]);
            }
            best
        }
    }
}

/// Weighted energy of every garment.
fn of_garments(energy: &SceneEnergy<f32>, state: &Draped) -> Vec<f64> {
    let raw = energy.value(&state.posed, &state.canonical).garments;
    let weighted = |(garment, raw): (&SceneGarment<f32>, &TermMap<Option<f64>>)| {
        raw.iter().map(|(term, value)| garment.weights[term] * value.unwrap_or(0.0)).sum()
    };
    energy.garments.iter().zip(&raw).map(weighted).collect()
}

/// Where the least value is; the first of equal ones, and of none that is finite.
fn least(values: impl Iterator<Item = f64>) -> usize {
    let mut best = (0, f64::INFINITY);
    for (i, value) in values.enumerate() {
        if value < best.1 {
            best = (i, value);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::energy::{EnergySettings, GarmentEnergies, Term};
    use clothcombo_physics::mesh::{Topology, shapes};
    use clothcombo_physics::query::Surface;
    use std::sync::Arc;

    /// Two tubes over each other with strain alone, and their rest positions.
    fn scene() -> (SceneEnergy<f32>, Vec<[f32; 3]>) {
        let settings = EnergySettings::default();
        let tubes = [shapes::tube(0.1, 0.3, 12, 6), shapes::tube(0.12, 0.3, 12, 6)];
        let garment = |tube| SceneGarment {
            energies: Arc::new(
                GarmentEnergies::new(tube, &Topology::new(tube), &settings, false).expect("a garment"),
            ),
            holding_reference: Vec::new(),
            weights: TermMap::from_fn(|term| if term == Term::Strain { 1.0 } else { 0.0 }),
        };
        let energy = SceneEnergy {
            body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
            garments: tubes.iter().map(garment).collect(),
            layers: Vec::new(),
            settings,
        };
        let rest = tubes.iter().flat_map(|t| t.positions()).map(|p| p.map(|x| x as f32)).collect();
        (energy, rest)
    }

    /// The two halves of `rest`, each made larger by a factor of its own.
    fn stretched(rest: &[[f32; 3]], by: [f32; 2]) -> Draped {
        let half = rest.len() / 2;
        let posed: Vec<[f32; 3]> =
            rest.iter().enumerate().map(|(v, p)| p.map(|x| x * by[v / half])).collect();
        Draped { canonical: posed.clone(), posed }
    }

    #[test]
    fn an_outfit_is_taken_as_a_whole_and_garments_alone_one_by_one() {
        let (energy, rest) = scene();
        let states = [[1.2, 1.0], [1.0, 1.1], [1.3, 1.3]].map(|by| stretched(&rest, by));
        let together = least_energy(&states, &energy, Company::Together);
        assert_eq!(together.posed, states[1].posed);
        let alone = least_energy(&states, &energy, Company::Alone);
        assert_eq!(alone.posed, rest);
        assert_eq!(alone.canonical, rest);
    }

    #[test]
    fn what_is_not_finite_is_never_better() {
        let (energy, rest) = scene();
        let (good, bad) = (stretched(&rest, [1.1, 1.1]), stretched(&rest, [f32::NAN, 1.0]));
        for company in [Company::Together, Company::Alone] {
            let found = least_energy(&[bad.clone(), good.clone()], &energy, company);
            assert_eq!(found.posed[0], good.posed[0]);
            // Where there is nothing better, the first stays.
            let found = least_energy(std::slice::from_ref(&bad), &energy, company);
            assert!(found.posed[0][0].is_nan());
        }
    }
}
