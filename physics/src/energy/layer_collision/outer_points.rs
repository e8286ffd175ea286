//! Where an outer garment is kept off an inner one.

use crate::energy::{ContactPoints, ContactSamples};
use crate::real::Real;

/// The contact points of an outer garment in its present position.
#[derive(Debug)]
pub struct OuterPoints<'a, T> {
    pub(super) points: &'a ContactPoints,
    /// `[P, 3]` (m).
    pub(super) at: Vec<[T; 3]>,
    /// What of a vertex each of them stands for.
    pub(super) share: f64,
}

impl<'a, T: Real> OuterPoints<'a, T> {
    /// Of the garment of `points` at `posed` `[V, 3]` (m).
    pub fn new(points: &'a ContactPoints, posed: &[[T; 3]], samples: ContactSamples) -> Self {
        Self { points, at: points.at(posed, samples), share: points.share(samples) }
    }
}
