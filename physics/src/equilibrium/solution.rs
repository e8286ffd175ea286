//! What the solver reports.

use std::fmt;

/// Why the solver stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stop {
    /// The relative gradient is within the tolerance.
    Converged,
    /// All iterations were used.
    Iterations,
    /// The time was used up.
    Time,
    /// The last 10 steps together gained less than a millionth of the tolerance of what all gained (1e-10 with the
    /// usual one): the energy stands still, though the forces of some vertices at creases of the contact do not
    /// balance.
    Settled,
    /// No step along the descent direction lowers the energy, however short: some vertices rest against a jump of the energy.
    Stalled,
    /// A vertex went farther from its start than allowed: nothing holds that part of the garment.
    Escaped,
    /// The observer asked to stop.
    Cancelled,
}

impl Stop {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Iterations => "iterations",
            Self::Time => "time",
            Self::Settled => "settled",
            Self::Stalled => "stalled",
            Self::Escaped => "escaped",
            Self::Cancelled => "cancelled",
        }
    }
}

impl fmt::Display for Stop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// One point of the history; the first is the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Accepted steps so far.
    pub iteration: usize,
    /// Weighted sum of all energies (J); never above the one before.
    pub energy: f64,
    /// Largest displacement of a vertex in this step (m).
    pub displacement: f64,
    /// Wall time so far (ms).
    pub milliseconds: f64,
}

/// What the observer sees after every iteration, and before the first.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Where the solver is.
    pub step: &'a Step,
    /// Posed positions there `[ΣV, 3]` (m).
    pub positions: &'a [[f64; 3]],
}

/// The result of [`super::solve`].
#[derive(Debug, Clone)]
pub struct Solution {
    /// Posed positions of the last, lowest state `[ΣV, 3]` (m).
    pub positions: Vec<[f64; 3]>,
    /// Why it is the last.
    pub stop: Stop,
    /// Relative gradient there (see [`super`]).
    pub relative_gradient: f64,
    /// Start and every accepted step.
    pub history: Vec<Step>,
}

impl Solution {
    /// The last entry of the history.
    pub fn last(&self) -> &Step {
        self.history.last().expect("the history holds the start")
    }

    /// Weighted sum of all energies at the end (J).
    pub fn energy(&self) -> f64 {
        self.last().energy
    }

    /// Accepted steps.
    pub fn iterations(&self) -> usize {
        self.history.len() - 1
    }
}
