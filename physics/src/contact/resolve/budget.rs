//! The rounds and time that the post-process of one outfit may spend.

use std::cell::Cell;
use std::time::{Duration, Instant};

use super::ResolveSettings;
use crate::contact::self_triangle_pairs;
use crate::query::Surface;

/// Pairs of a body's own triangles from which on its parts leave cloth hardly any clearance.
const OVERLAPPING: usize = 1000;
/// Such a body gets one in so many of the rounds.
const SHORTER: usize = 4;
/// One in so many of the rounds is kept for the end of a path.
const LAST_SHARE: usize = 10;

/// Counts rounds, which do not depend on the machine, and, where a limit is asked for, wall time.
pub(super) struct Budget {
    start: Instant,
    time: Option<Duration>,
    rounds: Cell<usize>,
    spent: Cell<usize>,
    /// Time to prepare bodies.
    pub body_time: Cell<Duration>,
    /// Time for certificates.
    pub certificate_time: Cell<Duration>,
}

impl Budget {
    /// Of `settings` for so many `garments`; wall time counts from now on.
    pub fn new(settings: &ResolveSettings, garments: usize) -> Self {
        let all = |limit: Duration| limit.checked_mul(garments as u32).unwrap_or(Duration::MAX);
        Self {
            start: Instant::now(),
            time: settings.time.map(all),
            rounds: settings.total_rounds.into(),
            spent: Cell::default(),
            body_time: Cell::default(),
            certificate_time: Cell::default(),
        }
    }

    /// Takes most of it away where `body` overlaps itself so much that few garments come out clear.
    pub fn shorten_for(&self, body: &Surface<f64>) {
        if self_triangle_pairs(&body.positions, &body.faces).len() > OVERLAPPING {
            self.rounds.set(self.rounds.get() / SHORTER);
        }
    }

    /// Counts one round of detection and relaxation.
    pub fn spend_round(&self) {
        self.spent.set(self.spent.get() + 1);
    }

    /// Rounds so far.
    pub fn spent(&self) -> usize {
        self.spent.get()
    }

    /// Whether nothing new may begin.
    pub fn is_spent(&self) -> bool {
        self.spent() >= self.rounds.get() || self.is_late()
    }

    /// Whether the time is over: what takes no rounds may begin as long as it is not.
    pub fn is_late(&self) -> bool {
        self.time.is_some_and(|limit| self.elapsed() > limit)
    }

    /// Whether only the last rounds are left: what is under way had better come to its end.
    pub fn is_nearly_spent(&self) -> bool {
        self.spent() >= self.rounds.get() - self.rounds.get() / LAST_SHARE || self.is_late()
    }

    /// What `prepare` returns; its time counts as that to prepare a body.
    pub fn preparing<R>(&self, prepare: impl FnOnce() -> R) -> R {
        timed(&self.body_time, prepare)
    }

    /// What `certify` returns; its time counts as that for a certificate.
    pub fn certifying<R>(&self, certify: impl FnOnce() -> R) -> R {
        timed(&self.certificate_time, certify)
    }

    /// Wall time since it began.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}

/// What `run` returns; its time is added to `total`.
fn timed<R>(total: &Cell<Duration>, run: impl FnOnce() -> R) -> R {
    let start = Instant::now();
    let done = run();
    total.set(total.get() + start.elapsed());
    done
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn with_time(time: Duration) -> Budget {
        Budget::new(&ResolveSettings { time: Some(time), ..ResolveSettings::default() }, 12)
    }

    #[test]
    fn a_time_without_end_is_never_over() {
        assert!(!with_time(Duration::MAX).is_spent());
        let none = with_time(Duration::ZERO);
        std::thread::sleep(Duration::from_millis(1));
        assert!(none.is_spent());
    }

    #[test]
    fn a_body_that_overlaps_itself_a_lot_gets_a_quarter_of_the_rounds() {
        let settings = ResolveSettings { total_rounds: 8, ..ResolveSettings::default() };
        let ball = shapes::icosphere(0.1, 4);
        // Turned a little, so that nearly every triangle of one ball intersects some of the other.
        let turned = shapes::mapped(&ball, |[x, y, z]| [x + 0.02 * y, y - 0.02 * x, z + 0.01 * x]);
        for (body, rounds) in [(ball.clone(), 8), (shapes::union(&[&ball, &turned]), 2)] {
            let budget = Budget::new(&settings, 1);
            budget.shorten_for(&Surface::from_mesh(&body));
            for _ in 0..rounds {
                assert!(!budget.is_spent());
                budget.spend_round();
            }
            assert!(budget.is_spent());
        }
    }
}
