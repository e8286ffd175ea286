//! Loss and energies of a step over its scenes, wherever they were computed.

use super::learner::{StepOutput, larger};
use crate::dataset::PreparedScene;
use crate::evaluation::weighted_terms;
use crate::run::event::StepRecord;
use clothcombo_physics::energy::Term;

impl StepRecord {
    /// What `scenes`, some of the `total` scenes of a step, contribute, as `output` has it: loss, energies, largest number of
    /// garments, gradient norm.
    pub fn of(scenes: &[PreparedScene], output: &StepOutput, total: usize) -> Self {
        let mut record = Self {
            loss: output.loss,
            layers: scenes.iter().map(|s| s.sample.garments.len()).max().unwrap_or(0),
            grad_norm: output.gradient_norm,
            ..Self::default()
        };
        for (scene, outputs) in scenes.iter().zip(&output.scenes) {
            let share = 1.0 / (scene.bodies.len() * total) as f64;
            for (body, value) in scene.bodies.iter().zip(outputs.iter().map(|s| s.value())) {
                for (term, raw, weight) in weighted_terms(&body.energy, &value.garments, &value.layers) {
                    record.add(term, raw * share, raw * weight * share);
                }
            }
        }
        record
    }

    fn add(&mut self, term: Term, raw: f64, weighted: f64) {
        *self.raw.entry(term.name()).or_insert(0.0) += raw;
        *self.weighted.entry(term.name()).or_insert(0.0) += weighted;
    }

    /// What [`of`](Self::of) found, as numbers, always as many.
    pub fn to_row(&self) -> Vec<f64> {
        let mut row = vec![self.loss, self.layers as f64, self.grad_norm];
        for term in Term::ALL.map(Term::name) {
            let present = self.raw.contains_key(term);
            row.push(f64::from(u8::from(present)));
            row.extend([&self.raw, &self.weighted].map(|values| values.get(term).copied().unwrap_or(0.0)));
        }
        row
    }

    /// The record of a step from the [rows](Self::to_row) of its parts.
    pub fn joined(rows: &[Vec<f64>]) -> Self {
        let mut record = Self::default();
        for row in rows {
            record.loss += row[0];
            record.layers = record.layers.max(row[1] as usize);
            record.grad_norm = larger(record.grad_norm, row[2]);
            for (term, values) in Term::ALL.into_iter().zip(row[3..].chunks_exact(3)) {
                if values[0] != 0.0 {
                    record.add(term, values[1], values[2]);
                }
            }
        }
        record
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_a_missing_term_stays_missing() {
        let part = |loss, layers, terms: &[(&'static str, f64)]| StepRecord {
            loss,
            layers,
            grad_norm: loss,
            raw: terms.iter().copied().collect(),
            weighted: terms.iter().map(|(name, v)| (*name, 2.0 * v)).collect(),
            ..StepRecord::default()
        };
        let [first, second] =
            [part(1.0, 3, &[("strain", 0.5)]), part(0.25, 1, &[("strain", 1.0), ("gravity", -1.0)])];
        let found = StepRecord::joined(&[first.to_row(), second.to_row()]);
        let sum = part(1.25, 3, &[("strain", 1.5), ("gravity", -1.0)]);
        assert_eq!(found, StepRecord { grad_norm: 1.0, ..sum });
        assert_eq!(StepRecord::joined(&[first.to_row()]), first);
        let broken = StepRecord { grad_norm: f64::NAN, ..first.clone() };
        for parts in [[&broken, &second], [&second, &broken]] {
            let found = StepRecord::joined(&parts.map(StepRecord::to_row));
            assert!(found.grad_norm.is_nan(), "one broken scene breaks the step");
        }
    }
}
