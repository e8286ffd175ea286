//! Curvature of the energies: a positive semidefinite approximation of their second derivatives, by which the
//! static solver chooses its steps.
//!
//! An approximation is enough, because the solver's line search only trusts values and gradients; positive semidefinite,
//! because only then is its step a descent direction. Every term states in its file what it keeps and what it leaves out
//! (Gauss–Newton parts stay, parts of either sign go).

/// Receives the 3×3 blocks of a symmetric matrix over vertices.
pub trait CurvatureSink {
    /// Adds `block` at row `i`, column `j` of vertices, and, for `i ≠ j`, its transpose at row `j`, column `i`.
    ///
    /// Off the diagonal, the vertex pairs a term adds to should not depend on positions, but for contact between
    /// garments: the solver orders its matrix anew whenever a pair is new.
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]);
}

/// A sink for one garment of a scene: its vertices start at `offset`, and everything is multiplied by `weight`.
pub(super) struct Scaled<'a, 'b> {
    pub sink: &'a mut (dyn CurvatureSink + 'b),
    pub offset: usize,
    pub weight: f64,
}

impl CurvatureSink for Scaled<'_, '_> {
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        let block = block.map(|row| row.map(|x| self.weight * x));
        self.sink.add(self.offset + i, self.offset + j, block);
    }
}

/// `s·a bᵀ`.
#[inline(always)]
pub(super) fn outer(s: f64, a: [f64; 3], b: [f64; 3]) -> [[f64; 3]; 3] {
    a.map(|x| b.map(|y| s * x * y))
}
