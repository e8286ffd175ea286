//! Which of two states of an outfit is the better one.

use std::cmp::Ordering;

/// What is wrong with a state. A state without intersections, narrow ones included, is better than any other one; otherwise less
/// excess strain counts first, since it shows more than intersections, then fewer intersections, narrow pairs and
/// self-intersections.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Defects {
    /// Intersecting triangle pairs with the body and between garments; while garments are relaxed, all pairs and vertices on the
    /// wrong side.
    pub intersections: usize,
    /// Intersecting triangle pairs with the body where it leaves hardly any clearance for cloth.
    pub narrow: usize,
    /// How many times over the strain energy has risen by half of what it was, where that is known.
    pub excess_strain: usize,
    /// Intersecting triangle pairs of garments with themselves.
    pub self_intersections: usize,
}

impl Ord for Defects {
    fn cmp(&self, other: &Self) -> Ordering {
        let rank = |d: &Self| {
            let intersects = d.intersections + d.narrow > 0;
            (intersects, d.excess_strain, d.intersections, d.narrow, d.self_intersections)
        };
        rank(self).cmp(&rank(other))
    }
}

impl PartialOrd for Defects {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
