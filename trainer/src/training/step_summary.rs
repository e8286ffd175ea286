//! Loss and energies of a step over its scenes, wherever they were computed.

use crate::dataset::PreparedScene;
use crate::training::learner::{Computed, larger};
use clothcombo_physics::energy::Term;
use std::collections::BTreeMap;

/// Means over the bodies of a scene and the scenes of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepSummary {
    /// Weighted loss.
    pub loss: f64,
    /// Garments of the largest scene.
    pub layers: usize,
    /// Largest gradient norm of a scene, as in [`Computed`].
    pub largest_norm: f64,
    /// Raw energies, summed over garments and pairs.
    pub raw: BTreeMap<&'static str, f64>,
    /// The same times their weights.
    pub weighted: BTreeMap<&'static str, f64>,
}

impl StepSummary {
    /// What `scenes`, some of the `total` scenes of a step, contribute, as `computed` has it.
    pub fn of(scenes: &[PreparedScene], computed: &Computed, total: usize) -> Self {
        let mut summary = Self {
            loss: computed.loss,
            layers: scenes.iter().map(|s| s.sample.garments.len()).max().unwrap_or(0),
            largest_norm: computed.largest_norm,
            ..Self::default()
        };
        for (scene, outputs) in scenes.iter().zip(&computed.scenes) {
            let share = 1.0 / (scene.bodies.len() * total) as f64;
            for (body, value) in scene.bodies.iter().zip(outputs.iter().map(|s| s.value())) {
                let energy = &body.energy;
                let weights = energy
                    .garments
                    .iter()
                    .map(|g| &g.weights)
                    .chain(energy.layers.iter().map(|l| &l.weights));
                for (values, weights) in value.garments.iter().chain(&value.layers).zip(weights) {
                    for term in Term::ALL {
                        if let Some(v) = values[term] {
                            *summary.raw.entry(term.name()).or_insert(0.0) += v * share;
                            *summary.weighted.entry(term.name()).or_insert(0.0) += v * weights[term] * share;
                        }
                    }
                }
            }
        }
        summary
    }

    /// All of it as numbers, always as many.
    pub fn to_row(&self) -> Vec<f64> {
        let mut row = vec![self.loss, self.layers as f64, self.largest_norm];
        for term in Term::ALL {
            let of = |values: &BTreeMap<&'static str, f64>| values.get(term.name()).copied();
            let present = of(&self.raw).is_some();
            row.extend([
                f64::from(u8::from(present)),
                of(&self.raw).unwrap_or(0.0),
                of(&self.weighted).unwrap_or(0.0),
            ]);
        }
        row
    }

    /// The summary of a step from the [rows](Self::to_row) of its parts.
    pub fn joined(rows: &[Vec<f64>]) -> Self {
        let mut summary = Self::default();
        for row in rows {
            summary.loss += row[0];
            summary.layers = summary.layers.max(row[1] as usize);
            summary.largest_norm = larger(summary.largest_norm, row[2]);
            for (term, values) in Term::ALL.into_iter().zip(row[3..].chunks_exact(3)) {
                if values[0] != 0.0 {
                    *summary.raw.entry(term.name()).or_insert(0.0) += values[1];
                    *summary.weighted.entry(term.name()).or_insert(0.0) += values[2];
                }
            }
        }
        summary
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_a_missing_term_stays_missing() {
        let part = |loss, layers, terms: &[(&'static str, f64)]| StepSummary {
            loss,
            layers,
            largest_norm: loss,
            raw: terms.iter().copied().collect(),
            weighted: terms.iter().map(|(name, v)| (*name, 2.0 * v)).collect(),
        };
        let [first, second] =
            [part(1.0, 3, &[("strain", 0.5)]), part(0.25, 1, &[("strain", 1.0), ("gravity", -1.0)])];
        let found = StepSummary::joined(&[first.to_row(), second.to_row()]);
        let sum = part(1.25, 3, &[("strain", 1.5), ("gravity", -1.0)]);
        assert_eq!(found, StepSummary { largest_norm: 1.0, ..sum });
        assert_eq!(StepSummary::joined(&[first.to_row()]), first);
        let broken = StepSummary { largest_norm: f64::NAN, ..first.clone() };
        for parts in [[&broken, &second], [&second, &broken]] {
            let found = StepSummary::joined(&parts.map(StepSummary::to_row));
            assert!(found.largest_norm.is_nan(), "one broken scene breaks the step");
        }
    }
}
