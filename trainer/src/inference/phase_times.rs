//! Where the time of a drape goes.

use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use std::time::Instant;

/// Wall time by phase (ms); all garments together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhaseTimes {
    /// Binding, constants of the energies, operators.
    pub preparation: f64,
    /// The embedding network, or reading what it made before.
    pub embedding: f64,
    /// Shape, pose and skinning transforms.
    pub posing: f64,
    /// The forward pass: single draping, skinning and untangling.
    pub networks: f64,
    /// Judging what they made beside skinning.
    pub acceptance: f64,
    /// The static solver, if asked for.
    pub refine: f64,
    /// The post-process, without its certificate.
    pub resolve: f64,
    /// Counting all pairs of the result.
    pub certificate: f64,
}

impl AddAssign for PhaseTimes {
    fn add_assign(&mut self, other: Self) {
        for (own, (_, more)) in self.each_mut().into_iter().zip(other.phases()) {
            *own += more;
        }
    }
}

impl PhaseTimes {
    /// Every phase with its name, in order.
    pub fn phases(&self) -> [(&'static str, f64); 8] {
        [
            ("preparation", self.preparation),
            ("embedding", self.embedding),
            ("posing", self.posing),
            ("networks", self.networks),
            ("acceptance", self.acceptance),
            ("refine", self.refine),
            ("resolve", self.resolve),
            ("certificate", self.certificate),
        ]
    }

    fn each_mut(&mut self) -> [&mut f64; 8] {
        let Self { preparation, embedding, posing, networks, acceptance, refine, resolve, certificate } =
            self;
        [preparation, embedding, posing, networks, acceptance, refine, resolve, certificate]
    }

    /// So much of every phase.
    pub(super) fn scaled(mut self, share: f64) -> Self {
        self.each_mut().into_iter().for_each(|ms| *ms *= share);
        self
    }

    /// Sum of all phases.
    pub fn total(&self) -> f64 {
        self.phases().iter().map(|(_, ms)| ms).sum()
    }
}

/// Time since `clock` (ms).
pub(super) fn elapsed(clock: Instant) -> f64 {
    1e3 * clock.elapsed().as_secs_f64()
}
