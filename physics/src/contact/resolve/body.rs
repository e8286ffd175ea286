//! The body of an outfit: as it is drawn, and as it gives way to the garments.

use std::cell::OnceCell;

use super::Layer;
use super::clearance::{Before, Clearance, YieldedBody};
use super::garment::triangles;
use super::near::near_cloth;
use super::obstacle::BodyObstacle;
use crate::query::Surface;

/// Calls `with` the body of `surface` as it is drawn, near `layers`: the same garments once or, in several places, more often.
pub(super) fn with_drawn<R>(
    surface: &Surface<f64>,
    layers: &[Layer<'_>],
    with: impl FnOnce(BodyObstacle<'_>) -> R,
) -> R {
    let near = near_cloth(&surface.positions, &surface.faces, &triangles(layers));
    with(BodyObstacle::new(surface, &near))
}

/// Calls `with` a `drawn` body that can give way to `garments` garments.
pub(super) fn with_body<R>(drawn: BodyObstacle<'_>, garments: usize, with: impl FnOnce(&Body<'_>) -> R) -> R {
    with_body_after(Clearance::AMPLE, None, drawn, garments, with)
}

/// [`with_body`] that gives way as `clearance` says, a step after it did `before`.
pub(super) fn with_body_after<R>(
    clearance: Clearance,
    before: Option<Before<'_>>,
    mut drawn: BodyObstacle<'_>,
    garments: usize,
    with: impl FnOnce(&Body<'_>) -> R,
) -> R {
    let yielded = YieldedBody::of(&drawn, garments, clearance, before);
    if let Some(yielded) = &yielded {
        drawn.gives_way(yielded);
    }
    with(&Body { drawn, garments, yielded: yielded.as_ref(), yielded_obstacle: OnceCell::new() })
}

/// A posed body near some garments.
pub(super) struct Body<'a> {
    /// As it is drawn: what a certificate counts against. Faces that give way are noted.
    pub drawn: BodyObstacle<'a>,
    garments: usize,
    yielded: Option<&'a YieldedBody>,
    yielded_obstacle: OnceCell<BodyObstacle<'a>>,
}

impl<'a> Body<'a> {
    /// What the garments have to stay out of while they are sorted out.
    pub fn obstacle(&self) -> &BodyObstacle<'a> {
        match self.yielded {
            Some(yielded) => {
                self.yielded_obstacle.get_or_init(|| BodyObstacle::yielded_obstacle(yielded, self.drawn.near))
            }
            None => &self.drawn,
        }
    }

    /// How far every vertex gives way (m).
    pub fn steps(&self) -> Vec<f64> {
        let none = || vec![0.0; self.drawn.surface.positions.len()];
        self.yielded.map_or_else(none, |yielded| yielded.steps.clone())
    }

    /// Calls `with` what the garments have to stay out of where the body gives way as far as `clearance` says.
    pub fn with_clearance<R>(&self, clearance: Clearance, with: impl FnOnce(&BodyObstacle<'_>) -> R) -> R {
        match YieldedBody::of(&self.drawn, self.garments, clearance, None) {
            Some(yielded) => with(&BodyObstacle::yielded_obstacle(&yielded, self.drawn.near)),
            None => with(&self.drawn),
        }
    }
}
