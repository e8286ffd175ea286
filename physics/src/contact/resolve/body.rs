//! The body of an outfit: as given, and with its yield to the garments.

use std::cell::OnceCell;

use super::clearance::{Clearance, YieldedBody};
use super::obstacle::BodyObstacle;

/// A posed body near some garments.
pub(super) struct SoftBody<'a> {
    /// As given: what a certificate counts against. Faces that yield are noted.
    pub drawn: BodyObstacle<'a>,
    garments: usize,
    yielded: Option<&'a YieldedBody>,
    yielded_obstacle: OnceCell<BodyObstacle<'a>>,
}

impl<'a> SoftBody<'a> {
    /// The body that is `drawn` near so many `garments`, and how it has `yielded` to them, if it has.
    pub fn new(mut drawn: BodyObstacle<'a>, garments: usize, yielded: Option<&'a YieldedBody>) -> Self {
        if let Some(yielded) = yielded {
            drawn.yields(yielded);
        }
        Self { drawn, garments, yielded, yielded_obstacle: OnceCell::new() }
    }

    /// The obstacle of the garments while they are untangled.
    pub fn obstacle(&self) -> &BodyObstacle<'a> {
        match self.yielded {
            Some(yielded) => {
                let made = || BodyObstacle::yielded_obstacle(yielded, &self.drawn.near);
                self.yielded_obstacle.get_or_init(made)
            }
            None => &self.drawn,
        }
    }

    /// The yield of every vertex (m).
    pub fn steps(&self) -> Vec<f64> {
        let none = || vec![0.0; self.drawn.surface.positions.len()];
        self.yielded.map_or_else(none, |yielded| yielded.steps.clone())
    }

    /// Calls `with` the obstacle whose yield is what `clearance` says.
    pub fn with_clearance<R>(&self, clearance: Clearance, with: impl FnOnce(&BodyObstacle<'_>) -> R) -> R {
        match YieldedBody::of(&self.drawn, self.garments, clearance, None) {
            Some(yielded) => with(&BodyObstacle::yielded_obstacle(&yielded, &self.drawn.near)),
            None => with(&self.drawn),
        }
    }
}
