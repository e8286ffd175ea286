//! Which of two states of an outfit is the better one.

/// What is wrong with a state. Less is better, compared in the order of the fields.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
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
