//! Does a garment already lie on a body, in metres and T-pose, so that nothing has to be found out?

use super::cloth::Cloth;
use super::placement::{Placement, Unit, UpAxis};
use super::search::Search;
use super::settings::{FitSettings, MIN_TRIANGLES};
use crate::asset::Body;
use crate::mesh::outward_area;
use clothcombo_physics::{Surface, Topology, TriMesh};

/// A file is taken as it stands unless another place is better by this log-posterior.
const MARGIN: f64 = 8.0;

/// Tells which meshes lie on a body as they stand.
pub struct PlacementCheck<'a> {
    body: &'a Body,
    search: Search<'a>,
}

impl<'a> PlacementCheck<'a> {
    /// Prepares the zero body.
    pub fn new(body: &'a Body) -> Self {
        Self { body, search: Search::new(body) }
    }

    /// Whether `mesh`, taken as it stands (metres, y up, pelvis at the origin, arms level), is worn on the zero body and fits nowhere
    /// clearly better, by the same judgement by which [`fit`](super::fit) takes a placement; and every piece of it has its faces
    /// outwards.
    pub fn is_on_body(&self, mesh: &TriMesh) -> bool {
        let topology = Topology::new(mesh);
        let cloth = Cloth::new(mesh.positions(), mesh.faces(), &topology);
        mesh.face_count() >= MIN_TRIANGLES
            && self.search.believed_as_given(&cloth).is_ok()
            && self.fits_best_as_given(&cloth, mesh.extent())
            && faces_outwards(mesh, self.body)
    }

    fn fits_best_as_given(&self, cloth: &Cloth, extent: f64) -> bool {
        let settings = FitSettings {
            unit: Some(Unit::M),
            up: Some(UpAxis::Y),
            arms_lowered: Some(false),
            ..FitSettings::default()
        };
        let given = self.search.judged_as_given(&self.search.judge(cloth, &settings), Placement::AS_GIVEN);
        let best = self.search.candidates(cloth, extent, &settings).first().map_or(f64::MIN, |c| c.score);
        best <= given.score + MARGIN
    }
}

/// [`PlacementCheck::is_on_body`] for one mesh.
pub fn is_on_body(mesh: &TriMesh, body: &Body) -> bool {
    PlacementCheck::new(body).is_on_body(mesh)
}

/// Whether the area of every piece faces away from the body more than towards it.
fn faces_outwards(mesh: &TriMesh, body: &Body) -> bool {
    let surface = Surface::from_mesh(&body.zero_body());
    let outward = outward_area(mesh.positions(), mesh.faces(), &Topology::new(mesh), &surface);
    outward.into_iter().all(|area| area >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Category;
    use crate::generate::garment::generated;
    use crate::generate::mannequin;

    #[test]
    fn only_the_garment_as_it_was_made_lies_on_the_body() {
        let body = mannequin();
        for category in [Category::TShirt, Category::Skirt, Category::Trousers] {
            let rest = generated(&body, category, 4, 300).rest;
            assert!(is_on_body(&rest, &body), "{category}");
            let changed = |change: fn([f64; 3]) -> [f64; 3]| {
                rest.with_positions(rest.positions().iter().map(|p| change(*p)).collect()).unwrap()
            };
            assert!(!is_on_body(&changed(|p| p.map(|x| 100.0 * x)), &body), "{category} in centimetres");
            assert!(!is_on_body(&changed(|[x, y, z]| [x, -z, y]), &body), "{category} with z up");
            assert!(!is_on_body(&changed(|[x, y, z]| [x + 0.6, y, z]), &body), "{category} beside the body");
            assert!(!is_on_body(&rest.turned(), &body), "{category} inside out");
        }
    }
}
