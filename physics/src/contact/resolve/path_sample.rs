//! A pose on the path to another, and garments that are resolved there.

use std::sync::Arc;

use crate::query::Surface;
use crate::transform::Transform;

/// What is somewhere along the path.
#[derive(Clone)]
pub struct PathSample {
    /// The body.
    pub body: Arc<Surface<f64>>,
    /// The drape on it, `[V, 3]` per garment (m).
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms of all vertices, garment after garment, from one and the same state.
    pub transforms: Vec<Transform>,
}

/// Garments that are resolved, as far as they could be: where a path starts.
pub struct Reached {
    /// Their drape before that, `[V, 3]` each (m).
    pub draped: Vec<Vec<[f64; 3]>>,
    /// Where they are now.
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Skinning transforms, as in [`PathSample`].
    pub transforms: Vec<Transform>,
    /// Pairs with the body and between garments that are left in `positions`, but for narrow and pinched ones.
    pub crossings: usize,
}
