//! What one attempt works on.

use super::budget::Budget;
use super::{Layer, ResolveSettings};

/// The garments before the attempt, how they are resolved, and what may be spent on it.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub layers: &'a [Layer<'a>],
    pub settings: &'a ResolveSettings,
    pub budget: &'a Budget,
}
