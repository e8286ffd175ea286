//! The body of an outfit: as given, and with its yield to the garments.

use std::cell::OnceCell;

use super::Layer;
use super::clearance::{Before, Clearance, YieldedBody};
use super::garment::triangles;
use super::near::near_cloth;
use super::obstacle::BodyObstacle;
use crate::query::Surface;

/// Calls `with` the body of `surface` as given, near `layers`: the same garments once or, at several positions, more often.
pub(super) fn with_drawn<R>(
    surface: &Surface<f64>,
    layers: &[Layer<'_>],
    with: impl FnOnce(BodyObstacle<'_>) -> R,
) -> R {
    let near = near_cloth(&surface.positions, &surface.faces, &triangles(layers));
    with(BodyObstacle::new(surface, &near))
}

/// Calls `with` a `drawn` body that can yield to `garments` garments.
pub(super) fn with_body<R>(drawn: BodyObstacle<'_>, garments: usize, with: impl FnOnce(&Body<'_>) -> R) -> R {
    with_body_after(Clearance::AMPLE, None, drawn, garments, with)
}

/// [`with_body`] that yields as `clearance` says, a step after its yield was `before`.
pub(super) fn with_body_after<R>(
    clearance: Clearance,
    before: Option<Before<'_>>,
    mut drawn: BodyObstacle<'_>,
    garments: usize,
    with: impl FnOnce(&Body<'_>) -> R,
) -> R {
    let yielded = YieldedBody::of(&drawn, garments, clearance, before);
    if let Some(yielded) = &yielded {
        drawn.yields(yielded);
    }
    with(&Body { drawn, garments, yielded: yielded.as_ref(), yielded_obstacle: OnceCell::new() })
}

/// A posed body near some garments.
pub(super) struct Body<'a> {
    /// As given: what a certificate counts against. Faces that yield are noted.
    pub drawn: BodyObstacle<'a>,
    garments: usize,
    yielded: Option<&'a YieldedBody>,
    yielded_obstacle: OnceCell<BodyObstacle<'a>>,
}

impl<'a> Body<'a> {
    /// The obstacle of the garments while they are untangled.
    pub fn obstacle(&self) -> &BodyObstacle<'a> {
        match self.yielded {
            Some(yielded) => {
                self.yielded_obstacle.get_or_init(|| BodyObstacle::yielded_obstacle(yielded, self.drawn.near))
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
            Some(yielded) => with(&BodyObstacle::yielded_obstacle(&yielded, self.drawn.near)),
            None => with(&self.drawn),
        }
    }
}
