//! Takes cloth out of clearance again: afterwards the body yields only where it lies inside itself.

use super::body::SoftBody;
use super::certificate::Certificate;
use super::clearance::Clearance;
use super::contact_orientation::ContactOrientation;
use super::count::certified;
use super::garment::at;
use super::packed_cloth::PackedCloth;
use super::task::Task;
use super::untangle::{Untangled, untangled};
use super::{ResolveSettings, Resolved};

/// Longest and shortest step, as shares of the clearance that the body made, by which it is taken back.
const WITHDRAWAL_STEPS: (f64, f64) = (1.0 / 4.0, 1.0 / 32.0);
/// Gaps tried, as shares of the setting: a narrow place holds more sheets if they lie closer.
const GAPS: [f64; 2] = [1.0, 0.3];

/// A body that withdraws its clearance.
pub(super) struct ClearanceWithdrawal<'a, 'b> {
    pub body: &'a SoftBody<'b>,
    pub task: Task<'a>,
    pub clearance: Clearance,
}

impl ClearanceWithdrawal<'_, '_> {
    /// The result replaces `best` if it is better.
    pub fn improve(&self, best: &mut Resolved) {
        for share in GAPS {
            if best.certificate.narrow_triangle_pairs == 0 || self.task.budget.is_spent() {
                return;
            }
            let gap = share * self.task.settings.gap;
            let settings = ResolveSettings { gap, is_shallow: true, loosened: 1.0, ..*self.task.settings };
            self.at_once(best, &settings);
        }
    }

    /// All at once and, if no garment intersects another, step by step as well.
    fn at_once(&self, best: &mut Resolved, settings: &ResolveSettings) {
        let apart = (best.certificate.layer_triangle_pairs == 0).then(|| best.positions.clone());
        let (closer, certificate) = self.untangled_at(0.0, &best.positions, None, settings);
        best.prefer(self.task.layers, closer.positions, certificate);
        if let Some(apart) = apart.filter(|_| !best.certificate.is_clear()) {
            self.slowly(best, apart, settings);
        }
    }

    /// Step by step from `now`, where no garment intersects another; cloth keeps its contact orientation.
    fn slowly(&self, best: &mut Resolved, mut now: Vec<Vec<[f64; 3]>>, settings: &ResolveSettings) {
        let outfit = PackedCloth::new(self.task.layers);
        let (mut share, mut step, mut with_body) = (1.0, WITHDRAWAL_STEPS.0, usize::MAX);
        while share > 0.0 && step >= WITHDRAWAL_STEPS.1 && !self.task.budget.is_spent() {
            let next = f64::max(share - step, 0.0);
            let orientation = ContactOrientation::of(&outfit, &now.concat(), None);
            let (found, certificate) = self.untangled_at(next, &now, Some(&orientation), settings);
            if certificate.layer_triangle_pairs == 0 && found.with_body <= with_body {
                (share, with_body) = (next, found.with_body);
                now.clone_from(&found.positions);
            } else {
                step *= 0.5;
            }
            best.prefer(self.task.layers, found.positions, certificate);
        }
    }

    /// Untangles the garments from `now` at a `share` of the clearance.
    fn untangled_at(
        &self,
        share: f64,
        now: &[Vec<[f64; 3]>],
        orientation: Option<&ContactOrientation>,
        settings: &ResolveSettings,
    ) -> (Untangled, Certificate) {
        let Task { layers, budget, .. } = self.task;
        let task = Task { layers: &at(layers, now), settings, budget };
        let clearance = self.clearance.with_share(share);
        let found = self.body.with_clearance(clearance, |obstacle| untangled(obstacle, task, orientation));
        let certificate = certified(&self.body.drawn, layers, &found.positions);
        (found, certificate)
    }
}
