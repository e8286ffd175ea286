//! What is known about a file, and the limits of what fits.

use super::placement::{Unit, UpAxis};
use crate::asset::Category;

/// Most vertices a garment may have after welding.
pub const MAX_VERTICES: usize = 1_000_000;

/// What is left longer than this many times its length by the push out of the body is stretched.
pub(super) const MOST_STRETCH: f64 = 1.5;
/// Share of its edges from which a stretched garment does not fit.
pub(super) const MOST_STRETCHED: f64 = 0.1;
/// Fewest triangles that can be a garment.
pub const MIN_TRIANGLES: usize = 20;

/// What is known about a file; `None` is found out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitSettings {
    /// Unit of the file.
    pub unit: Option<Unit>,
    /// Up axis of the file.
    pub up: Option<UpAxis>,
    /// Whether the arms are lowered (A-pose) or not (T-pose).
    pub arms_lowered: Option<bool>,
    /// Category; otherwise guessed from the shape.
    pub category: Option<Category>,
}
