//! Takes cloth out of clearance again: afterwards the body yields only where it lies inside itself.

use super::body::Body;
use super::budget::Budget;
use super::clearance::Clearance;
use super::contact_orientation::ContactOrientation;
use super::count::certified;
use super::garment::at;
use super::outfit::Outfit;
use super::untangle::{untangled, untangled_keeping};
use super::{Layer, ResolveSettings, Resolved};

/// Longest and shortest step, as shares of the clearance that the body made, by which it is taken back.
const STEPS: (f64, f64) = (1.0 / 4.0, 1.0 / 32.0);
/// Gaps tried, as shares of the setting: a narrow place holds more sheets if they lie closer.
const GAPS: [f64; 2] = [1.0, 0.3];

/// A body that withdraws its clearance.
pub(super) struct ClearanceWithdrawal<'a, 'b> {
    pub body: &'a Body<'b>,
    /// The garments before the post-process.
    pub layers: &'a [Layer<'a>],
    pub clearance: Clearance,
    pub budget: &'a Budget,
}

impl ClearanceWithdrawal<'_, '_> {
    /// The result replaces `best` if it is better.
    pub fn improve(&self, best: &mut Resolved, settings: &ResolveSettings) {
        for share in GAPS {
            if best.certificate.narrow_triangle_pairs == 0 || self.budget.is_spent() {
                return;
            }
            let gap = share * settings.gap;
            let settings = ResolveSettings { gap, is_shallow: true, loosened: 1.0, ..*settings };
            self.at_once(best, &settings);
        }
    }

    /// All at once and, if no garment intersects another, step by step as well.
    fn at_once(&self, best: &mut Resolved, settings: &ResolveSettings) {
        let apart = (best.certificate.layer_triangle_pairs == 0).then(|| best.positions.clone());
        let now = at(self.layers, &best.positions);
        let none = self.clearance.with_share(0.0);
        let closer =
            self.body.with_clearance(none, |obstacle| untangled(obstacle, &now, settings, self.budget));
        let certificate = certified(&self.body.drawn, self.layers, &closer.positions);
        best.prefer(self.layers, closer.positions, certificate);
        if let Some(apart) = apart.filter(|_| !best.certificate.is_clear()) {
            self.slowly(best, apart, settings);
        }
    }

    /// Step by step from `now`, where no garment intersects another; cloth keeps its contact orientation.
    fn slowly(&self, best: &mut Resolved, mut now: Vec<Vec<[f64; 3]>>, settings: &ResolveSettings) {
        let outfit = Outfit::new(self.layers);
        let (mut share, mut step, mut with_body) = (1.0, STEPS.0, usize::MAX);
        while share > 0.0 && step >= STEPS.1 && !self.budget.is_spent() {
            let next = f64::max(share - step, 0.0);
            let orientation = ContactOrientation::of(&outfit, &now.concat(), None);
            let before = at(self.layers, &now);
            let found = self.body.with_clearance(self.clearance.with_share(next), |obstacle| {
                untangled_keeping(Some(&orientation), obstacle, &before, settings, self.budget)
            });
            let certificate = certified(&self.body.drawn, self.layers, &found.positions);
            if certificate.layer_triangle_pairs == 0 && found.with_body <= with_body {
                (share, with_body) = (next, found.with_body);
                now.clone_from(&found.positions);
            } else {
                step *= 0.5;
            }
            best.prefer(self.layers, found.positions, certificate);
        }
    }
}
