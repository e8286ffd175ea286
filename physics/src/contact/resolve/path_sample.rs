//! States along a continuation path.

use std::sync::Arc;

use crate::query::Surface;
use crate::transform::Transform;

/// The body and the garments at one share of a continuation path, before they are resolved there.
#[derive(Clone)]
pub struct PathSample {
    /// The body.
    pub body: Arc<Surface<f64>>,
    /// The garments on it, `[V, 3]` each (m): skinned, or draped.
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms of all vertices, garment after garment, from one and the same state.
    pub transforms: Vec<Transform>,
}

/// Resolved garments from which a continuation path starts.
pub struct ContactState {
    /// The drape before the post-process, `[V, 3]` per garment (m).
    pub draped: Vec<Vec<[f64; 3]>>,
    /// The resolved positions, `[V, 3]` per garment (m).
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms, as in [`PathSample`].
    pub transforms: Vec<Transform>,
    /// Intersecting pairs with the body and between garments left in `positions`, without narrow and pinched ones.
    pub intersections: usize,
}
