//! Counts the certificate from nothing: all pairs of triangles, and the depth of every vertex.

use super::body::SoftBody;
use super::certificate::Certificate;
use super::clearance::YieldedBody;
use super::garment::{at, check};
use super::near::NEAR_MARGIN;
use super::obstacle::BodyObstacle;
use super::{Layer, ResolveError};
use crate::contact::{
    LayerOrder, LayerTopology, Report, ReportBody, ReportGarment, Selection, Triangle, TriangleTree,
    all_layers,
};
use crate::query::Surface;
use crate::vec3;

/// Counts what intersects what. `layers` from the body outwards. The same for any number of threads.
///
/// # Errors
/// When positions do not fit their garment or are not finite, a garment has a face twice, or the body has no surface.
pub fn certify(body: &Surface<f64>, layers: &[Layer<'_>]) -> Result<Certificate, ResolveError> {
    check(body, layers)?;
    Ok(certified_around(body, layers))
}

/// [`certify`] for valid arguments.
pub(super) fn certified_around(body: &Surface<f64>, layers: &[Layer<'_>]) -> Certificate {
    let drawn = BodyObstacle::near_layers(body, layers);
    let mut found = certificate(&drawn, layers);
    if found.body_triangle_pairs > 0 {
        let yielded = YieldedBody::ample(&drawn, layers.len());
        found.count_narrow(&SoftBody::new(drawn, layers.len(), yielded.as_ref()).drawn);
    }
    found
}

/// [`certified_around`] near a `body` that is prepared; its yield is as it was noted.
fn certificate(body: &BodyObstacle<'_>, layers: &[Layer<'_>]) -> Certificate {
    let mut found = counted(body, layers);
    found.count_narrow(body);
    found
}

/// [`certificate`] without what depends on where the body yields; `body` may know some of what is to be counted.
pub(super) fn counted(body: &impl ReportBody, layers: &[Layer<'_>]) -> Certificate {
    let garments: Vec<ReportGarment<'_>> = layers
        .iter()
        .map(|layer| ReportGarment { positions: layer.positions, faces: &layer.garment.faces })
        .collect();
    let topologies: Vec<&LayerTopology> = layers.iter().map(|layer| &layer.garment.layer).collect();
    let selection = Selection {
        layers: &all_layers(layers.len()),
        order: LayerOrder::ClosestPoint(&topologies),
        triangles: true,
        body_itself: false,
    };
    let strains = layers.iter().map(|layer| layer.garment.strain_energy(layer.positions));
    Certificate::new(&Report::count(body, &garments, &selection), strains)
}

impl ReportBody for BodyObstacle<'_> {
    fn tree(&self) -> &TriangleTree<'_> {
        &self.tree
    }

    fn distance(&self, p: [f64; 3]) -> Option<(f64, [f64; 3])> {
        self.look(p)?.plane.map(|plane| (plane.distance, plane.normal))
    }

    fn is_pinched(&self, face: u32) -> bool {
        self.is_pinched(face)
    }

    fn is_pinched_at(&self, triangle: &Triangle) -> bool {
        self.is_pinch_at(triangle)
    }
}

/// The certificate of garments that went from `layers`, near which the body is `drawn`, to `positions`.
pub(super) fn certified(
    drawn: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    positions: &[Vec<[f64; 3]>],
) -> Certificate {
    let now = at(layers, positions);
    match is_near(layers, positions) {
        true => certificate(drawn, &now),
        false => certified_around(drawn.surface, &now),
    }
}

/// Whether nothing moved so far from `layers` that it could meet more of the body than what is near those.
pub(super) fn is_near(layers: &[Layer<'_>], positions: &[Vec<[f64; 3]>]) -> bool {
    let is_near = |(p, q): (&[f64; 3], &[f64; 3])| vec3::norm(vec3::sub(*q, *p)) <= NEAR_MARGIN;
    layers.iter().zip(positions).all(|(layer, moved)| layer.positions.iter().zip(moved).all(is_near))
}
