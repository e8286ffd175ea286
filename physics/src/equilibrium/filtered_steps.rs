//! Steps that make no intersection: what the step filter of the contact leaves of them.

use super::Problem;
use crate::contact::step_filter::{ContactMesh, FacePairs, StepFilter};
use crate::energy::SceneEnergy;

/// The garments of a scene and the body under them, and which of their triangles intersect.
pub(super) struct FilteredSteps<'a> {
    filter: StepFilter<'a>,
    body: &'a [[f64; 3]],
    /// What elements stay apart (m).
    margin: f64,
}

/// The faces of the garments of `energy`, then those of its body.
pub(super) fn contact_mesh(energy: &SceneEnergy<f64>) -> ContactMesh {
    let mut cloth: Vec<[u32; 3]> = Vec::new();
    for (garment, range) in energy.garments.iter().zip(energy.ranges()) {
        let faces = garment.energies.contact_points().faces();
        cloth.extend(faces.iter().map(|face| face.map(|v| v + range.start as u32)));
    }
    let (start, body) = (energy.vertex_count(), &energy.body);
    let faces = body.faces.iter().map(|face| face.map(|v| v + start as u32));
    ContactMesh::new(start + body.positions.len(), &cloth, faces)
}

impl<'a> FilteredSteps<'a> {
    pub fn new(mesh: &'a ContactMesh, problem: &Problem<'a>, start: &[[f64; 3]], margin: f64) -> Self {
        let body = &problem.energy().body.positions;
        Self { filter: StepFilter::new(mesh, &[start, body].concat()), body, margin }
    }

    /// Shortens the step from `from` to `to` where it makes an intersection, and takes it. Returns what intersected at `from`.
    pub fn take(&mut self, from: &[[f64; 3]], to: &mut Vec<[f64; 3]>) -> FacePairs {
        let before = self.filter.intersections.clone();
        let from = [from, self.body].concat();
        let count = to.len();
        to.extend_from_slice(self.body);
        self.filter.step(&from, to, self.margin);
        to.truncate(count);
        before
    }

    /// Takes a step back: `before` is what intersects again.
    pub fn take_back(&mut self, before: FacePairs) {
        self.filter.intersections = before;
    }
}
