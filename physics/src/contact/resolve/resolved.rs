//! The result of the post-process.

use std::time::Duration;

use super::Layer;

use super::budget::Budget;
use super::certificate::Certificate;
use crate::vec3;

/// Garments that were resolved.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Resolved {
    /// New positions of every garment, `[V, 3]` (m), in the order given.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// What is left.
    pub certificate: Certificate,
    /// What was done, per garment.
    pub garments: Vec<GarmentWork>,
    /// Steps tried on a continuation path: from the T-pose, by [`super::resolve_along`] (0 if the drape needed no path), or from
    /// the frame before, by [`super::resolve_after`].
    pub steps: usize,
    /// Rounds of detection and relaxation of all attempts but the fast pass.
    pub rounds: usize,
    /// Time to prepare the body.
    pub body_time: Duration,
    /// Time for the certificate.
    pub certificate_time: Duration,
}

/// What was done to one garment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct GarmentWork {
    /// Rounds of detection and relaxation.
    pub rounds: usize,
    /// Vertices that moved.
    pub moved: usize,
    /// The largest move (m).
    pub largest_move: f64,
    /// Its share, by vertices, of the wall time for all garments together.
    pub time: Duration,
}

impl Resolved {
    /// The better of two results for the same drape, `self` if they are equally good. It counts the work of both.
    #[must_use]
    pub fn or(mut self, mut other: Self) -> Self {
        if other.certificate.defects() < self.certificate.defects() {
            std::mem::swap(&mut self, &mut other);
        }
        self.body_time += other.body_time;
        self.certificate_time += other.certificate_time;
        self.steps += other.steps;
        self.rounds += other.rounds;
        for (work, further) in self.garments.iter_mut().zip(&other.garments) {
            work.rounds += further.rounds;
            work.time += further.time;
        }
        self
    }

    /// Takes another state of the garments, which were `layers` before the post-process, if it is better.
    pub(super) fn prefer(
        &mut self,
        layers: &[Layer<'_>],
        positions: Vec<Vec<[f64; 3]>>,
        mut certificate: Certificate,
    ) {
        self.certificate.compare_strain(layers);
        certificate.compare_strain(layers);
        if certificate.defects() < self.certificate.defects() {
            (self.positions, self.certificate) = (positions, certificate);
        }
    }

    /// Sets moves and strain relative to `layers`, and the time that `budget` counted.
    pub(super) fn compare_since(&mut self, layers: &[Layer<'_>], budget: &Budget) {
        (self.body_time, self.certificate_time) = (budget.body_time.get(), budget.certificate_time.get());
        let time = budget.elapsed().saturating_sub(self.body_time + self.certificate_time);
        self.rounds = budget.spent();
        let count: usize = self.positions.iter().map(Vec::len).sum();
        let work = |(layer, positions): (&Layer<'_>, &Vec<[f64; 3]>)| {
            let moves = layer.positions.iter().zip(positions).map(|(p, q)| vec3::norm(vec3::sub(*q, *p)));
            GarmentWork {
                rounds: self.rounds,
                moved: moves.clone().filter(|m| *m > 0.0).count(),
                largest_move: moves.fold(0.0, f64::max),
                time: time.mul_f64(positions.len() as f64 / count.max(1) as f64),
            }
        };
        self.garments = layers.iter().zip(&self.positions).map(work).collect();
        self.certificate.compare_strain(layers);
        self.certificate.is_stopped = budget.is_nearly_spent() && !self.certificate.is_clear();
    }
}
