//! The body of an outfit: as it is drawn, and as it gives way to the garments.

use std::cell::OnceCell;

use super::Layer;
use super::garment::triangles;
use super::near::near_cloth;
use super::obstacle::BodyObstacle;
use super::relief::{Before, Relief, Room};
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
    with_body_after(Room::AMPLE, None, drawn, garments, with)
}

/// [`with_body`] that gives way as `room` says, a step after it did `before`.
pub(super) fn with_body_after<R>(
    room: Room,
    before: Option<Before<'_>>,
    mut drawn: BodyObstacle<'_>,
    garments: usize,
    with: impl FnOnce(&Body<'_>) -> R,
) -> R {
    let relief = Relief::of(&drawn, garments, room, before);
    if let Some(relief) = &relief {
        drawn.gives_way(relief);
    }
    with(&Body { drawn, garments, relief: relief.as_ref(), relieved: OnceCell::new() })
}

/// A posed body near some garments.
pub(super) struct Body<'a> {
    /// As it is drawn: what a certificate counts against. Faces that give way are noted.
    pub drawn: BodyObstacle<'a>,
    garments: usize,
    relief: Option<&'a Relief>,
    relieved: OnceCell<BodyObstacle<'a>>,
}

impl<'a> Body<'a> {
    /// What the garments have to stay out of while they are sorted out.
    pub fn obstacle(&self) -> &BodyObstacle<'a> {
        match self.relief {
            Some(relief) => self.relieved.get_or_init(|| BodyObstacle::relieved(relief, self.drawn.near)),
            None => &self.drawn,
        }
    }

    /// How far every vertex gives way (m).
    pub fn steps(&self) -> Vec<f64> {
        let none = || vec![0.0; self.drawn.surface.positions.len()];
        self.relief.map_or_else(none, |relief| relief.steps.clone())
    }

    /// Calls `with` what the garments have to stay out of where the body gives way as far as `room` says.
    pub fn with_room<R>(&self, room: Room, with: impl FnOnce(&BodyObstacle<'_>) -> R) -> R {
        match Relief::of(&self.drawn, self.garments, room, None) {
            Some(relief) => with(&BodyObstacle::relieved(&relief, self.drawn.near)),
            None => with(&self.drawn),
        }
    }
}
