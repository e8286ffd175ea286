//! Watches the numbers of a run: counts steps that were skipped, and notices gradients far out of the ordinary.

use crate::config::GuardConfig;
use std::collections::VecDeque;

/// Norms the usual one is the median of.
const NORMS: usize = 100;
/// Norms that must have been seen before any can be unusual.
const FEWEST_NORMS: usize = 20;

/// Watches a run.
pub struct Guard {
    config: GuardConfig,
    /// Skipped steps within the window, ascending.
    incidents: VecDeque<u64>,
    norms: VecDeque<f64>,
}

/// What the guard makes of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GuardVerdict {
    /// Nothing unusual.
    Fine,
    /// The gradient norm is far above the usual one.
    Spike {
        /// Median of the norms before.
        usual: f64,
    },
    /// The step was skipped; `count` of the last steps were.
    Skipped {
        /// Skipped steps within the window, this one included.
        count: usize,
        /// Whether that is too many.
        is_over: bool,
    },
}

impl Guard {
    /// Goes on with the incidents that a checkpoint remembers.
    pub fn new(config: GuardConfig, incidents: &[u64]) -> Self {
        Self { config, incidents: incidents.iter().copied().collect(), norms: VecDeque::new() }
    }

    /// Skipped steps within the window: what a checkpoint must remember.
    pub fn incidents(&self) -> Vec<u64> {
        self.incidents.iter().copied().collect()
    }

    /// The first of the skipped steps, one after the other, that end with the last one; 0 without any.
    pub fn first_of_last_incidents(&self) -> u64 {
        let mut first = self.incidents.back().copied().unwrap_or(0);
        for &step in self.incidents.iter().rev().skip(1) {
            if step + 1 == first {
                first = step;
            }
        }
        first
    }

    /// Takes note of step `step`; `skipped` if its loss or gradient was not finite.
    pub fn watch(&mut self, step: u64, gradient_norm: f64, skipped: bool) -> GuardVerdict {
        while self.incidents.front().is_some_and(|first| first.saturating_add(self.config.window) <= step) {
            self.incidents.pop_front();
        }
        if skipped {
            self.incidents.push_back(step);
            let count = self.incidents.len();
            return GuardVerdict::Skipped { count, is_over: count >= self.config.max_incidents };
        }
        let usual = self.usual();
        // A scene in which nothing depends on what is trained has no gradient, and says nothing about that of others.
        if gradient_norm > 0.0 {
            self.norms.push_back(gradient_norm);
        }
        if self.norms.len() > NORMS {
            self.norms.pop_front();
        }
        match usual {
            Some(usual)
                if self.config.spike_factor > 0.0 && gradient_norm > self.config.spike_factor * usual =>
            {
                GuardVerdict::Spike { usual }
            }
            _ => GuardVerdict::Fine,
        }
    }

    fn usual(&self) -> Option<f64> {
        if self.norms.len() < FEWEST_NORMS {
            return None;
        }
        let mut norms: Vec<f64> = self.norms.iter().copied().collect();
        let middle = norms.len() / 2;
        Some(*norms.select_nth_unstable_by(middle, f64::total_cmp).1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(max_incidents: usize, window: u64) -> Guard {
        Guard::new(GuardConfig { max_incidents, window, spike_factor: 10.0, ..GuardConfig::default() }, &[])
    }

    #[test]
    fn incidents_count_within_the_window_only() {
        let mut guard = guard(3, 100);
        let skipped = |count, is_over| GuardVerdict::Skipped { count, is_over };
        assert_eq!(guard.watch(10, f64::NAN, true), skipped(1, false));
        assert_eq!(guard.watch(60, f64::NAN, true), skipped(2, false));
        assert_eq!(guard.watch(110, f64::NAN, true), skipped(2, false), "step 10 is out of the window");
        assert_eq!(guard.first_of_last_incidents(), 110);
        assert_eq!(Guard::new(guard.config.clone(), &[3, 7, 8, 9]).first_of_last_incidents(), 7);
        assert_eq!(Guard::new(guard.config.clone(), &[]).first_of_last_incidents(), 0);
        let mut continued = Guard::new(guard.config.clone(), &guard.incidents());
        assert_eq!(continued.watch(120, f64::NAN, true), skipped(3, true), "a checkpoint remembers them");
    }

    #[test]
    fn a_norm_far_above_the_median_is_a_spike() {
        let mut guard = guard(3, 100);
        for step in 0..50 {
            assert_eq!(guard.watch(step, 1.0 + 0.1 * (step % 5) as f64, false), GuardVerdict::Fine);
        }
        // Steps without a gradient change nothing, however many.
        for step in 50..150 {
            assert_eq!(guard.watch(step, 0.0, false), GuardVerdict::Fine);
        }
        assert_eq!(guard.watch(50, 11.0, false), GuardVerdict::Fine);
        assert!(
            matches!(guard.watch(51, 13.0, false), GuardVerdict::Spike { usual } if usual > 1.0 && usual < 1.4)
        );
    }
}
