//! Everything that is wrong between a body and the garments on it, counted in one pass: vertices inside the body, layers in
//! the wrong order, intersecting triangle pairs.
//!
//! The certificate of the post-process, the score of draped garments and the evaluation of a model are views of it.

use std::cell::OnceCell;
use std::sync::OnceLock;

use rayon::prelude::*;

use super::contours::{Contour, contours, self_contours};
use super::inner_surface::{InnerSurface, LayerTopology};
use super::layer_order::{LayerOrder, ORDER_RADIUS, OrderViolations, nearest_vertex_heights};
use super::penetration::{Penetration, depth};
use crate::query::triangle_pair::Triangle;
use crate::query::triangle_tree::TriangleTree;
use crate::query::{Distance, Surface};

/// The body of a report, and the rules by which garments are counted against it.
pub trait ReportBody: Sync {
    /// Its triangles.
    fn tree(&self) -> &TriangleTree<'_>;

    /// Signed distance of a point to it (m), and the direction away from it; `None` where it is not to be counted.
    fn distance(&self, p: [f64; 3]) -> Option<(f64, [f64; 3])>;

    /// [`distance`](Self::distance) of all vertices of a garment, given by its number.
    fn distances(&self, _garment: usize, positions: &[[f64; 3]]) -> Vec<Option<(f64, [f64; 3])>> {
        positions.par_iter().with_min_len(128).map(|p| self.distance(*p)).collect()
    }

    /// The intersecting pairs of a garment, as [`TriangleTree`] finds them, if they are known: with another one under it, or with
    /// itself, given by its number, or with the body.
    fn known_pairs(&self, _garment: usize, _with: Option<usize>) -> Option<Vec<(u32, u32)>> {
        None
    }

    /// Whether pairs with this face of it are pinched: no cloth could avoid them.
    fn is_pinched(&self, _face: u32) -> bool {
        false
    }

    /// Whether a garment triangle lies where pairs of two such are pinched.
    fn is_pinched_at(&self, _triangle: &Triangle) -> bool {
        false
    }
}

/// A posed body that counts everywhere, by one [`Distance`].
pub struct CountedBody<'a> {
    surface: &'a Surface<f64>,
    distance: Distance,
    tree: OnceLock<TriangleTree<'a>>,
}

impl<'a> CountedBody<'a> {
    /// Penetration counts by `distance`.
    pub fn new(surface: &'a Surface<f64>, distance: Distance) -> Self {
        Self { surface, distance, tree: OnceLock::new() }
    }
}

impl ReportBody for CountedBody<'_> {
    fn tree(&self) -> &TriangleTree<'_> {
        self.tree.get_or_init(|| TriangleTree::new(&self.surface.positions, &self.surface.faces))
    }

    fn distance(&self, p: [f64; 3]) -> Option<(f64, [f64; 3])> {
        let gap = self.surface.gap(p, self.distance);
        Some((gap.gap, gap.gradient))
    }
}

/// A garment in its present position.
#[derive(Clone, Copy, Debug)]
pub struct ReportGarment<'a> {
    /// Positions `[V, 3]` (m).
    pub positions: &'a [[f64; 3]],
    /// Faces `[F, 3]`.
    pub faces: &'a [[u32; 3]],
}

/// What a report counts besides the vertices inside the body.
#[derive(Clone, Copy, Debug)]
pub struct Selection<'a> {
    /// Pairs (inner, outer) of garments.
    pub layers: &'a [(usize, usize)],
    /// How the order of two layers is judged.
    pub order: LayerOrder<'a>,
    /// Whether intersecting triangle pairs of the garments are counted.
    pub triangles: bool,
    /// Whether those of the body with itself are.
    pub body_itself: bool,
}

/// All pairs (inner, outer) of so many garments, by outer, then inner index.
pub fn all_layers(garments: usize) -> Vec<(usize, usize)> {
    (0..garments).flat_map(|outer| (0..outer).map(move |inner| (inner, outer))).collect()
}

/// Numbers of the intersections of two surfaces, or of one with itself.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Intersections {
    /// Intersecting triangle pairs (of one surface: those that share more than their common vertices).
    pub pairs: usize,
    /// Length of the curves in which they intersect (m); triangles in one plane add none.
    pub contour_length: f64,
}

impl std::iter::Sum for Intersections {
    fn sum<I: Iterator<Item = Self>>(iter: I) -> Self {
        iter.fold(Self::default(), |a, b| Self {
            pairs: a.pairs + b.pairs,
            contour_length: a.contour_length + b.contour_length,
        })
    }
}

/// The intersecting triangle pairs of two surfaces, or of one with itself. Exact.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrianglePairs {
    /// Faces of both, ascending.
    pub pairs: Vec<(u32, u32)>,
    /// Those in pinched regions, which are in no other number.
    pub pinched: Vec<(u32, u32)>,
    /// Length of the curves in which `pairs` intersect (m).
    pub contour_length: f64,
}

impl TrianglePairs {
    fn new(
        all: Vec<(u32, u32)>,
        is_pinched: impl Fn(&(u32, u32)) -> bool,
        contours: impl Fn(&[(u32, u32)]) -> Vec<Contour>,
    ) -> Self {
        let (pinched, pairs): (Vec<_>, Vec<_>) = all.into_iter().partition(is_pinched);
        // Contours need trees, which are only made where something needs them.
        let contour_length =
            if pairs.is_empty() { 0.0 } else { contours(&pairs).iter().map(|c| c.length).sum() };
        Self { pairs, pinched, contour_length }
    }

    /// Their numbers, without the pinched ones.
    pub fn numbers(&self) -> Intersections {
        Intersections { pairs: self.pairs.len(), contour_length: self.contour_length }
    }
}

/// One garment of a report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct GarmentReport {
    /// Its vertices.
    pub vertices: usize,
    /// Depths of those inside the body (m), in order.
    pub depths: Vec<f64>,
    /// Pairs (face of the garment, face of the body).
    pub with_body: TrianglePairs,
    /// Pairs of its faces.
    pub with_itself: TrianglePairs,
}

impl GarmentReport {
    /// Its vertices inside the body, and those deeper than `threshold` (m).
    pub fn penetration(&self, threshold: f64) -> Penetration {
        Penetration::new(self.vertices, self.depths.iter().copied(), threshold)
    }
}

/// Two garments of a report.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LayerReport {
    /// The garment nearer to the body (0 = innermost).
    pub inner: usize,
    /// The garment over it.
    pub outer: usize,
    /// Pairs (face of the outer garment, face of the inner one).
    pub pairs: TrianglePairs,
    /// Vertices of the outer garment within [`ORDER_RADIUS`] of the inner one.
    pub counted: usize,
    /// Depths of those under it (m), in order.
    pub depths: Vec<f64>,
}

impl LayerReport {
    /// Violations of the order.
    pub fn order(&self) -> OrderViolations {
        OrderViolations { counted: self.counted, violations: self.depths.len() }
    }
}

/// What is wrong between a body and its garments.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// Each garment, inner to outer.
    pub garments: Vec<GarmentReport>,
    /// Every two garments that were selected, in that order.
    pub layers: Vec<LayerReport>,
    /// The body with itself (an armpit, thighs that touch): no garment can avoid it, so no total counts it.
    pub body_itself: Intersections,
}

impl Report {
    /// Counts what is selected of `garments`, inner to outer, on `body`. The same for any number of threads.
    pub fn count(body: &impl ReportBody, garments: &[ReportGarment<'_>], selection: &Selection<'_>) -> Self {
        let counted: Vec<CountedGarment<'_>> =
            garments.iter().enumerate().map(|(g, garment)| CountedGarment::new(g, *garment, body)).collect();
        let is_inner = |g: usize| selection.layers.iter().any(|(inner, _)| *inner == g);
        let surfaces: Vec<Option<InnerSurface<'_>>> = match selection.order {
            LayerOrder::NearestVertex => counted.iter().map(|_| None).collect(),
            LayerOrder::ClosestPoint(topologies) => {
                let surface = |(g, counted): (usize, &CountedGarment<'_>)| {
                    is_inner(g).then(|| counted.inner_surface(topologies[g]))
                };
                counted.iter().enumerate().map(surface).collect()
            }
        };
        let layer = |&(inner, outer): &(usize, usize)| {
            let (under, over) = (&counted[inner], &counted[outer]);
            let heights = over.heights(under, surfaces[inner].as_ref());
            LayerReport {
                inner,
                outer,
                pairs: if selection.triangles {
                    over.pairs_with(under, body)
                } else {
                    TrianglePairs::default()
                },
                counted: heights.len(),
                depths: heights.iter().filter(|h| **h < 0.0).map(|h| -h).collect(),
            }
        };
        Self {
            garments: counted.iter().map(|g| g.report(body, selection.triangles)).collect(),
            layers: selection.layers.iter().map(layer).collect(),
            body_itself: match selection.body_itself {
                true => {
                    let tree = body.tree();
                    let all = tree.self_pairs();
                    TrianglePairs::new(all, |_| false, |pairs| self_contours(tree, pairs)).numbers()
                }
                false => Intersections::default(),
            },
        }
    }

    /// Penetration of all garments together; `threshold` (m) as in [`GarmentReport::penetration`].
    pub fn penetration(&self, threshold: f64) -> Penetration {
        let depths = self.garments.iter().flat_map(|g| g.depths.iter().copied());
        Penetration::new(self.garments.iter().map(|g| g.vertices).sum(), depths, threshold)
    }

    /// Violations of the order of all layers together.
    pub fn order(&self) -> OrderViolations {
        self.layers.iter().map(LayerReport::order).sum()
    }

    /// Intersections that a garment takes part in; those of the body with itself are left out.
    pub fn intersections(&self) -> Intersections {
        let garments = self.garments.iter().flat_map(|g| [&g.with_body, &g.with_itself]);
        garments.chain(self.layers.iter().map(|l| &l.pairs)).map(TrianglePairs::numbers).sum()
    }
}

/// A garment that is being counted.
struct CountedGarment<'a> {
    number: usize,
    garment: ReportGarment<'a>,
    /// Made where triangles are asked for.
    tree: OnceCell<TriangleTree<'a>>,
    /// [`ReportBody::distances`].
    distances: Vec<Option<(f64, [f64; 3])>>,
}

impl<'a> CountedGarment<'a> {
    fn new(number: usize, garment: ReportGarment<'a>, body: &impl ReportBody) -> Self {
        let distances = body.distances(number, garment.positions);
        Self { number, garment, tree: OnceCell::new(), distances }
    }

    fn tree(&self) -> &TriangleTree<'a> {
        self.tree.get_or_init(|| TriangleTree::new(self.garment.positions, self.garment.faces))
    }

    fn report(&self, body: &impl ReportBody, with_triangles: bool) -> GarmentReport {
        let mut report = GarmentReport {
            vertices: self.distances.len(),
            depths: self.distances.iter().flatten().filter_map(|(distance, _)| depth(*distance)).collect(),
            ..GarmentReport::default()
        };
        if with_triangles {
            let known = body.known_pairs(self.number, None);
            report.with_body = TrianglePairs::new(
                known.unwrap_or_else(|| self.tree().pairs_with(body.tree())),
                |(_, b)| body.is_pinched(*b),
                |pairs| contours(self.tree(), body.tree(), pairs),
            );
            let known = body.known_pairs(self.number, Some(self.number));
            report.with_itself = TrianglePairs::new(
                known.unwrap_or_else(|| self.tree().self_pairs()),
                |(f, g)| self.is_pinched(body, *f) && self.is_pinched(body, *g),
                |pairs| self_contours(self.tree(), pairs),
            );
        }
        report
    }

    /// Pairs with a garment under it.
    fn pairs_with(&self, under: &Self, body: &impl ReportBody) -> TrianglePairs {
        let known = body.known_pairs(self.number, Some(under.number));
        TrianglePairs::new(
            known.unwrap_or_else(|| self.tree().pairs_with(under.tree())),
            |(f, g)| self.is_pinched(body, *f) && under.is_pinched(body, *g),
            |pairs| contours(self.tree(), under.tree(), pairs),
        )
    }

    /// Whether one of its faces lies where the body is pinched.
    fn is_pinched(&self, body: &impl ReportBody, face: u32) -> bool {
        let ReportGarment { positions, faces } = self.garment;
        body.is_pinched_at(&faces[face as usize].map(|v| positions[v as usize]))
    }

    /// Heights of its vertices near a garment under it (m), negative under that; `surface` is that of the other for the
    /// closest point.
    fn heights(&self, under: &Self, surface: Option<&InnerSurface<'_>>) -> Vec<f64> {
        let (ReportGarment { positions, faces }, outer) = (under.garment, self.garment.positions);
        match surface {
            None => nearest_vertex_heights(positions, faces, outer),
            Some(surface) => {
                outer.par_iter().with_min_len(128).filter_map(|p| surface.height(*p, ORDER_RADIUS)).collect()
            }
        }
    }

    fn inner_surface<'b>(&self, topology: &'b LayerTopology) -> InnerSurface<'b> {
        let outward = |v: usize| self.distances[v].map_or([0.0; 3], |(_, outward)| outward);
        let facing = topology.facing(self.garment.positions, self.garment.faces, outward);
        InnerSurface::new(topology, self.tree(), facing)
    }
}
