//! Depth of garment vertices inside a body.

/// How deep the vertices of a garment lie inside a body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Penetration {
    /// Vertices looked at.
    pub vertices: usize,
    /// Vertices with a negative gap, and those that are nowhere (NaN or infinite).
    pub inside: usize,
    /// Vertices deeper than the given threshold.
    pub deep: usize,
    /// Largest depth (m), 0 when no vertex is inside, infinite when one is nowhere.
    pub max_depth: f64,
}

impl Penetration {
    /// Of `vertices` vertices of which some lie inside, at `depths` (m), or deeper than `threshold` (m).
    pub(super) fn new(vertices: usize, depths: impl Iterator<Item = f64> + Clone, threshold: f64) -> Self {
        Self {
            vertices,
            inside: depths.clone().count(),
            deep: depths.clone().filter(|d| *d > threshold).count(),
            max_depth: depths.fold(0.0, f64::max),
        }
    }
}

/// Depth (m) for a signed distance: none outside, infinite for NaN.
pub(super) fn depth(distance: f64) -> Option<f64> {
    let depth = if distance.is_nan() { f64::INFINITY } else { -distance };
    (depth > 0.0).then_some(depth)
}
