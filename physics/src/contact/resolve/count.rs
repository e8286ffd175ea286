//! Counts what is left, from nothing: all pairs of triangles, and where every vertex lies.

use rayon::prelude::*;

use super::body::{with_body, with_drawn};
use super::certificate::{Certificate, Crossed, GarmentCertificate, LayerCertificate, RemainingPair};
use super::inner_garment::{InnerGarment, facing};
use super::obstacle::{BodyObstacle, BodyView};
use super::{Layer, ResolveError};
use crate::contact::{Contour, ORDER_RADIUS, TriangleTree, contours, self_contours};
use crate::query::Surface;

/// Counts what crosses what. `layers` from the body outwards. The same for any number of threads.
///
/// # Errors
/// When positions do not fit their garment or are not finite, or the body has no surface.
pub fn certify(body: &Surface<f64>, layers: &[Layer<'_>]) -> Result<Certificate, ResolveError> {
    super::check(body, layers)?;
    Ok(certified_around(body, layers))
}

/// [`certify`] for valid arguments.
pub(super) fn certified_around(body: &Surface<f64>, layers: &[Layer<'_>]) -> Certificate {
    with_drawn(body, layers, |drawn| {
        let mut found = certificate(&drawn, layers);
        if found.body_triangle_pairs > 0 {
            with_body(drawn, layers.len(), |body| found.count_narrow(&body.drawn));
        }
        found
    })
}

/// [`certified_around`] near a `body` that is prepared; where that gives way is as it was noted.
pub(super) fn certificate(body: &BodyObstacle<'_>, layers: &[Layer<'_>]) -> Certificate {
    let mut count = Count { body, found: Certificate::default(), depths: Vec::new(), judged: 0, wrong: 0 };
    let mut inner: Vec<InnerGarment> = Vec::new();
    for (index, layer) in layers.iter().enumerate() {
        let Layer { garment, positions } = *layer;
        let tree = TriangleTree::new(positions, &garment.faces);
        let views: Vec<_> = positions.par_iter().with_min_len(128).map(|p| body.look(*p)).collect();
        let own = GarmentCertificate {
            body_triangle_pairs: count.with_body(index, &tree, &views),
            layer_triangle_pairs: inner.iter().enumerate().map(|i| count.with_inner(index, &tree, i)).sum(),
            self_triangle_pairs: count.with_itself(index, &tree),
            strain_joule: garment.strain_energy(positions),
        };
        count.found.body_triangle_pairs += own.body_triangle_pairs;
        count.found.layer_triangle_pairs += own.layer_triangle_pairs;
        count.found.self_triangle_pairs += own.self_triangle_pairs;
        count.found.garments.push(own);
        if index + 1 < layers.len() {
            let outward = |v: usize| -> [f64; 3] {
                views[v].and_then(|view| view.plane).map_or([0.0; 3], |plane| plane.normal)
            };
            let facing = facing(garment, positions, outward);
            inner.push(InnerGarment::new(garment, tree, facing));
        }
    }
    let Count { mut found, depths, judged, wrong, .. } = count;
    found.max_depth_mm = 1e3 * depths.iter().fold(0.0, |a: f64, b| a.max(*b));
    // The sum of none is −0.
    found.mean_depth_mm = 1e3 * depths.iter().fold(0.0, |sum, d| sum + d) / depths.len().max(1) as f64;
    found.order_violations = wrong as f64 / judged.max(1) as f64;
    found.count_narrow(body);
    found
}

/// A certificate that is being counted. What counts a garment returns its pairs that are not pinched.
struct Count<'a, 'b> {
    body: &'a BodyObstacle<'b>,
    found: Certificate,
    /// Of every vertex inside the body or under an inner garment [m].
    depths: Vec<f64>,
    /// Vertices over or under an inner garment, once for each of them…
    judged: usize,
    /// …and those under it.
    wrong: usize,
}

impl Count<'_, '_> {
    /// The garment `index` with the body; `views`: what its vertices see of it.
    fn with_body(&mut self, index: usize, tree: &TriangleTree<'_>, views: &[Option<BodyView>]) -> usize {
        let planes = views.iter().filter_map(|view| view.and_then(|v| v.plane));
        let before = self.depths.len();
        self.depths.extend(planes.filter(|p| p.distance < 0.0).map(|p| -p.distance));
        self.found.vertices_inside += self.depths.len() - before;

        let all = tree.pairs_with(&self.body.tree);
        let (pinched, pairs): (Vec<_>, Vec<_>) = all.into_iter().partition(|&(_, b)| self.body.is_pinched(b));
        self.found.pinched.body_triangle_pairs += pinched.len();
        self.list(index, Crossed::Body, (&pairs, &pinched), &contours(tree, &self.body.tree, &pairs));
        pairs.len()
    }

    /// The garment `index` with one under it.
    fn with_inner(
        &mut self,
        index: usize,
        tree: &TriangleTree<'_>,
        (i, under): (usize, &InnerGarment<'_>),
    ) -> usize {
        let all = tree.pairs_with(&under.tree);
        let is_pinched = |&(f, g): &(u32, u32)| self.is_pinched(tree, f) && self.is_pinched(&under.tree, g);
        let (pinched, pairs): (Vec<_>, Vec<_>) = all.into_iter().partition(is_pinched);
        self.found.pinched.layer_triangle_pairs += pinched.len();
        self.list(index, Crossed::Layer(i), (&pairs, &pinched), &contours(tree, &under.tree, &pairs));

        let vertices = tree.positions().par_iter().with_min_len(128);
        let distances: Vec<f64> = vertices.filter_map(|p| under.signed_distance(*p, ORDER_RADIUS)).collect();
        let before = self.depths.len();
        self.depths.extend(distances.iter().filter(|d| **d < 0.0).map(|d| -d));
        let below = self.depths.len() - before;
        self.found.layers.push(LayerCertificate {
            inner: i,
            outer: index,
            triangle_pairs: pairs.len(),
            order_violations: below as f64 / distances.len().max(1) as f64,
        });
        self.judged += distances.len();
        self.wrong += below;
        pairs.len()
    }

    /// The garment `index` with itself.
    fn with_itself(&mut self, index: usize, tree: &TriangleTree<'_>) -> usize {
        let all = tree.self_pairs();
        let is_pinched = |&(f, g): &(u32, u32)| self.is_pinched(tree, f) && self.is_pinched(tree, g);
        let (pinched, pairs): (Vec<_>, Vec<_>) = all.into_iter().partition(is_pinched);
        self.found.pinched.self_triangle_pairs += pinched.len();
        self.list(index, Crossed::Itself, (&pairs, &pinched), &self_contours(tree, &pairs));
        pairs.len()
    }

    fn is_pinched(&self, tree: &TriangleTree<'_>, f: u32) -> bool {
        tree.triangle(f).is_some_and(|triangle| self.body.is_pinch_at(&triangle))
    }

    /// Lists pairs and pinched ones; `contours` are those of the former.
    fn list(
        &mut self,
        garment: usize,
        crosses: Crossed,
        (pairs, pinched): (&[(u32, u32)], &[(u32, u32)]),
        contours: &[Contour],
    ) {
        self.found.contour_length_mm += 1e3 * contours.iter().map(|c| c.length).sum::<f64>();
        for (pairs, is_pinched) in [(pairs, false), (pinched, true)] {
            self.found.remaining.extend(pairs.iter().map(|&(f, g)| RemainingPair {
                garment,
                triangle: f as usize,
                crosses,
                other_triangle: g as usize,
                is_pinched,
            }));
        }
    }
}
