//! Every intersection of a dressed body in one object.

use super::contours::{Contour, contours, self_contours};
use super::intersections::TriangleTree;

/// Intersections of two surfaces, or of one with itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Intersections {
    /// Pairs of triangles that share a point (of one surface: beyond the vertices they share).
    pub pairs: usize,
    /// Length of the curves in which they cross (m); triangles in one plane add none.
    pub contour_length: f64,
}

impl Intersections {
    fn new(pairs: &[(u32, u32)], contours: &[Contour]) -> Self {
        Self { pairs: pairs.len(), contour_length: contours.iter().map(|c| c.length).sum() }
    }

    /// Those of two surfaces. Exact.
    pub fn between(a: &TriangleTree, b: &TriangleTree) -> Self {
        let pairs = a.pairs_with(b);
        Self::new(&pairs, &contours(a, b, &pairs))
    }

    /// Those of a surface with itself. Exact.
    pub fn within(mesh: &TriangleTree) -> Self {
        Self::of_self_pairs(mesh, &mesh.self_pairs())
    }

    /// The same where `pairs`, those of [`TriangleTree::self_pairs`], are known already.
    pub fn of_self_pairs(mesh: &TriangleTree, pairs: &[(u32, u32)]) -> Self {
        Self::new(pairs, &self_contours(mesh, pairs))
    }
}

impl std::iter::Sum for Intersections {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::default(), |a, b| Self {
            pairs: a.pairs + b.pairs,
            contour_length: a.contour_length + b.contour_length,
        })
    }
}

/// Intersections of two garments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerIntersections {
    /// The garment nearer to the body (0 = innermost).
    pub inner: usize,
    /// The garment over it; `outer > inner`.
    pub outer: usize,
    /// What they share.
    pub intersections: Intersections,
}

/// Intersections of a body and its garments, inner to outer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IntersectionReport {
    /// Each garment with the body.
    pub garment_body: Vec<Intersections>,
    /// Every two garments, by inner, then outer index.
    pub garment_garment: Vec<LayerIntersections>,
    /// Each garment with itself.
    pub garment_self: Vec<Intersections>,
    /// The body with itself (an armpit, thighs that touch): no garment can mend it, so no total counts it.
    pub body_self: Intersections,
}

impl IntersectionReport {
    /// Looks at the body and at every garment and every two garments. Exact and the same for any number of threads.
    pub fn new(body: &TriangleTree, garments: &[TriangleTree]) -> Self {
        let garment_garment = (0..garments.len())
            .flat_map(|inner| (inner + 1..garments.len()).map(move |outer| (inner, outer)))
            .map(|(inner, outer)| LayerIntersections {
                inner,
                outer,
                intersections: Intersections::between(&garments[inner], &garments[outer]),
            })
            .collect();
        Self {
            garment_body: garments.iter().map(|g| Intersections::between(g, body)).collect(),
            garment_garment,
            garment_self: garments.iter().map(Intersections::within).collect(),
            body_self: Intersections::within(body),
        }
    }

    /// Everything a garment takes part in; the body with itself is left out.
    pub fn total(&self) -> Intersections {
        let layers = self.garment_garment.iter().map(|l| l.intersections);
        self.garment_body.iter().copied().chain(layers).chain(self.garment_self.iter().copied()).sum()
    }

    /// Whether no garment intersects anything.
    pub fn is_clear(&self) -> bool {
        self.total().pairs == 0
    }
}
