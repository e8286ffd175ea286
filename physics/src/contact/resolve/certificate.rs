//! The certificate: what intersects, counted exactly.

use serde::{Deserialize, Serialize};

use super::obstacle::BodyObstacle;
use super::{Defects, Layer};
use crate::contact::{Report, TrianglePairs};

/// Proof of the state of dressed garments: every number comes from exact predicates over all pairs of triangles, or (depths)
/// from the closest surface point of every vertex.
///
/// Pairs in pinched regions (where the body lies inside itself: see [`super`]) are in [`pinched`](Self::pinched) and in no
/// other number.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// Pairs of a garment triangle and a body triangle that share a point.
    pub body_triangle_pairs: usize,
    /// Those of them where another part of the body is so near that hardly any cloth fits between (see `docs/resolve.md`).
    #[serde(default)]
    pub narrow_triangle_pairs: usize,
    /// Pairs of triangles of two garments that share a point.
    pub layer_triangle_pairs: usize,
    /// Pairs of triangles of one garment that share more than their common vertices.
    pub self_triangle_pairs: usize,
    /// Length of the curves in which all those pairs intersect (mm).
    pub contour_length_mm: f64,
    /// Depth of the deepest vertex under the body's surface or under an inner garment (mm); 0 when there is none.
    pub max_depth_mm: f64,
    /// Mean depth of the vertices that lie under one (mm).
    pub mean_depth_mm: f64,
    /// Vertices inside the body.
    pub vertices_inside: usize,
    /// Share of the vertices over or under an inner garment that lie under it, 0–1, by the closest point of its surface; a vertex
    /// counts once for each inner garment.
    pub order_violations: f64,
    /// Rise of the strain energy by the post-process, as a share of the energy before; `None` where there was none before, or
    /// nothing was done.
    pub strain_added: Option<f64>,
    /// Whether the post-process had spent its budget (`ResolveSettings::total_rounds`, `ResolveSettings::time`) when pairs with
    /// the body or between garments were left.
    #[serde(default)]
    pub is_stopped: bool,
    /// Pairs where the body lies inside itself.
    pub pinched: PinchedPairs,
    /// Every pair that is left, pinched ones included.
    pub remaining: Vec<RemainingPair>,
    /// Per garment, innermost first.
    pub garments: Vec<GarmentCertificate>,
    /// Per pair of layers.
    #[serde(default)]
    pub layers: Vec<LayerCertificate>,
}

/// Pairs that no cloth could avoid: where one part of the body lies inside another.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PinchedPairs {
    /// With the body.
    pub body_triangle_pairs: usize,
    /// Of two garments.
    pub layer_triangle_pairs: usize,
    /// Of a garment with itself.
    pub self_triangle_pairs: usize,
}

impl PinchedPairs {
    /// All of them.
    pub fn count(&self) -> usize {
        self.body_triangle_pairs + self.layer_triangle_pairs + self.self_triangle_pairs
    }
}

/// The share of one garment.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct GarmentCertificate {
    /// Pairs with the body.
    pub body_triangle_pairs: usize,
    /// Pairs with garments under it.
    pub layer_triangle_pairs: usize,
    /// Pairs with itself.
    pub self_triangle_pairs: usize,
    /// Strain energy (J).
    pub strain_joule: f64,
}

/// The share of two layers. Indices are 0-based.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct LayerCertificate {
    /// The inner garment.
    pub inner: usize,
    /// The outer garment.
    pub outer: usize,
    /// Pairs of their triangles.
    pub triangle_pairs: usize,
    /// Share of the outer one's vertices over or under the inner one that lie under it, 0–1.
    pub order_violations: f64,
}

/// What a garment triangle intersects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntersectedSurface {
    /// The body.
    Body,
    /// Another garment, by its index.
    Layer(usize),
    /// The same garment.
    Itself,
}

/// Two triangles that intersect. Indices are 0-based.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct RemainingPair {
    /// The garment; of two, the outer one.
    pub garment: usize,
    /// Its triangle.
    pub triangle: usize,
    /// What it intersects.
    pub intersects: IntersectedSurface,
    /// The triangle there.
    pub other_triangle: usize,
    /// Whether the body lies inside itself there.
    pub is_pinched: bool,
}

impl Certificate {
    /// A view of `report`, whose layers are all pairs of garments, by outer, then inner index; `strains`: the strain energy of
    /// every garment (J).
    pub(super) fn new(report: &Report, strains: impl Iterator<Item = f64>) -> Self {
        let mut found = Self::default();
        let mut depths: Vec<f64> = Vec::new();
        for ((garment, of_garment), strain_joule) in report.garments.iter().enumerate().zip(strains) {
            let mut own = GarmentCertificate { strain_joule, ..GarmentCertificate::default() };
            depths.extend(&of_garment.depths);
            own.body_triangle_pairs = found.list(garment, IntersectedSurface::Body, &of_garment.with_body);
            for layer in report.layers.iter().filter(|layer| layer.outer == garment) {
                depths.extend(&layer.depths);
                own.layer_triangle_pairs +=
                    found.list(garment, IntersectedSurface::Layer(layer.inner), &layer.pairs);
                found.layers.push(LayerCertificate {
                    inner: layer.inner,
                    outer: layer.outer,
                    triangle_pairs: layer.pairs.pairs.len(),
                    order_violations: layer.order().share(),
                });
            }
            own.self_triangle_pairs =
                found.list(garment, IntersectedSurface::Itself, &of_garment.with_itself);
            found.body_triangle_pairs += own.body_triangle_pairs;
            found.layer_triangle_pairs += own.layer_triangle_pairs;
            found.self_triangle_pairs += own.self_triangle_pairs;
            found.pinched.body_triangle_pairs += of_garment.with_body.pinched.len();
            found.pinched.self_triangle_pairs += of_garment.with_itself.pinched.len();
            found.vertices_inside += of_garment.depths.len();
            found.garments.push(own);
        }
        found.pinched.layer_triangle_pairs = report.layers.iter().map(|l| l.pairs.pinched.len()).sum();
        found.max_depth_mm = 1e3 * depths.iter().fold(0.0, |a: f64, b| a.max(*b));
        // The sum of none is −0.
        found.mean_depth_mm = 1e3 * depths.iter().fold(0.0, |sum, d| sum + d) / depths.len().max(1) as f64;
        found.order_violations = report.order().share();
        found
    }

    /// Lists pairs of garment `garment` and returns how many are not pinched.
    fn list(&mut self, garment: usize, intersects: IntersectedSurface, found: &TrianglePairs) -> usize {
        self.contour_length_mm += 1e3 * found.contour_length;
        for (pairs, is_pinched) in [(&found.pairs, false), (&found.pinched, true)] {
            self.remaining.extend(pairs.iter().map(|&(f, g)| RemainingPair {
                garment,
                triangle: f as usize,
                intersects,
                other_triangle: g as usize,
                is_pinched,
            }));
        }
        found.pairs.len()
    }

    /// One certificate for several `frames` of the same garments: numbers of pairs are sums, depths and strain the worst
    /// frame's; of more than one frame no pair is listed.
    pub fn of_frames<'a>(frames: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut frames = frames.into_iter();
        let Some(first) = frames.next() else { return Self::default() };
        frames.fold(first.clone(), |sum, frame| sum.with_frame(frame))
    }

    fn with_frame(mut self, more: &Self) -> Self {
        self.body_triangle_pairs += more.body_triangle_pairs;
        self.narrow_triangle_pairs += more.narrow_triangle_pairs;
        self.layer_triangle_pairs += more.layer_triangle_pairs;
        self.self_triangle_pairs += more.self_triangle_pairs;
        self.contour_length_mm += more.contour_length_mm;
        self.vertices_inside += more.vertices_inside;
        self.pinched.body_triangle_pairs += more.pinched.body_triangle_pairs;
        self.pinched.layer_triangle_pairs += more.pinched.layer_triangle_pairs;
        self.pinched.self_triangle_pairs += more.pinched.self_triangle_pairs;
        self.max_depth_mm = self.max_depth_mm.max(more.max_depth_mm);
        self.mean_depth_mm = self.mean_depth_mm.max(more.mean_depth_mm);
        self.order_violations = self.order_violations.max(more.order_violations);
        self.is_stopped |= more.is_stopped;
        self.strain_added = match (self.strain_added, more.strain_added) {
            (Some(a), Some(b)) => Some(a.max(b)),
            (a, b) => a.or(b),
        };
        for (own, more) in self.garments.iter_mut().zip(&more.garments) {
            own.body_triangle_pairs += more.body_triangle_pairs;
            own.layer_triangle_pairs += more.layer_triangle_pairs;
            own.self_triangle_pairs += more.self_triangle_pairs;
            own.strain_joule = own.strain_joule.max(more.strain_joule);
        }
        for (own, more) in self.layers.iter_mut().zip(&more.layers) {
            own.triangle_pairs += more.triangle_pairs;
            own.order_violations = own.order_violations.max(more.order_violations);
        }
        self.remaining.clear();
        self
    }

    /// Pairs that are not pinched.
    pub fn pairs(&self) -> usize {
        self.body_triangle_pairs + self.layer_triangle_pairs + self.self_triangle_pairs
    }

    /// Pairs with the body and between garments that are not pinched.
    pub fn between(&self) -> usize {
        self.body_triangle_pairs + self.layer_triangle_pairs
    }

    /// Those of them that are not narrow either: more work might mend them.
    pub fn intersections(&self) -> usize {
        self.between().saturating_sub(self.narrow_triangle_pairs)
    }

    /// Whether no garment intersects the body or another garment, pinched regions left out.
    pub fn is_clear(&self) -> bool {
        self.between() == 0
    }

    /// How many times over the strain energy has risen by half of what it was: 0 where cloth is merely pulled straight,
    /// more where it is stretched out of shape, which shows.
    pub fn excess_strain(&self) -> usize {
        self.strain_added.map_or(0, |added| (added / EXCESS_STRAIN) as usize)
    }

    /// What is wrong.
    pub fn defects(&self) -> Defects {
        Defects {
            intersections: self.intersections(),
            narrow: self.narrow_triangle_pairs,
            excess_strain: self.excess_strain(),
            self_intersections: self.self_triangle_pairs,
        }
    }

    /// Strain energy of all garments (J).
    pub(super) fn strain_joule(&self) -> f64 {
        self.garments.iter().map(|g| g.strain_joule).sum()
    }

    /// Counts the pairs with the body where it yields.
    pub(super) fn count_narrow(&mut self, body: &BodyObstacle<'_>) {
        let is_narrow = |pair: &&RemainingPair| {
            pair.intersects == IntersectedSurface::Body
                && !pair.is_pinched
                && body.yielded(pair.other_triangle as u32)
        };
        self.narrow_triangle_pairs = self.remaining.iter().filter(is_narrow).count();
    }

    /// Notes by how much the strain energy has risen from that of the garments as they were `before` the post-process.
    pub fn compare_strain(&mut self, before: &[Layer<'_>]) {
        let (before, after) = (strain_joule(before), self.strain_joule());
        self.strain_added = (before > NO_STRAIN).then(|| after / before - 1.0);
    }
}

/// Strain energy of all garments (J).
pub(super) fn strain_joule(layers: &[Layer<'_>]) -> f64 {
    layers.iter().map(|l| l.garment.strain_energy(l.positions)).sum()
}

/// Less strain energy than this (J) is rounding of a garment in its rest shape.
const NO_STRAIN: f64 = 1e-9;
/// A rise of the strain energy, as a share, from which cloth is visibly stretched.
const EXCESS_STRAIN: f64 = 0.5;
