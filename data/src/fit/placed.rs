//! Does a garment already lie on a body, in metres and T-pose, so that nothing has to be found out?

use super::category::contradiction;
use super::cloth::Cloth;
use super::error::FitError;
use super::judge::Judge;
use super::pieces::{StrayPiece, stray_pieces};
use super::placement::{Placement, Unit, UpAxis};
use super::search::{Search, SearchBody};
use super::settings::{FitSettings, MIN_TRIANGLES};
use crate::asset::{Body, Category};
use crate::mesh::outward_area;
use clothcombo_physics::{Topology, TriMesh};
use std::fmt;

/// A file is taken as it stands unless another place is better by this log-posterior.
const BETTER_ELSEWHERE: f64 = 8.0;

/// Tells which meshes lie on a body as they stand. The body is measured once, in a tenth of a second.
pub struct PlacementCheck(SearchBody);

impl PlacementCheck {
    /// Measures the zero body of `body`.
    ///
    /// # Errors
    /// [`FitError::ImplausibleBody`] if it is no standing person.
    pub fn new(body: &Body) -> Result<Self, FitError> {
        SearchBody::new(body).map(Self)
    }

    /// What `look` sees in a mesh as it stands.
    fn look<T>(&self, mesh: &TriMesh, body: &Body, look: impl FnOnce(&Search, &Cloth, &Judge) -> T) -> T {
        let topology = Topology::new(mesh);
        let cloth = Cloth::new(mesh.positions(), mesh.faces(), &topology);
        let (search, settings) = (Search { body, measured: &self.0 }, FitSettings::default());
        look(&search, &cloth, &search.judge(&cloth, &settings))
    }

    /// How many connected pieces of `mesh` would be worn without the others: more than one are an outfit.
    pub fn worn_pieces(&self, mesh: &TriMesh, body: &Body) -> usize {
        self.look(mesh, body, |_, _, judge| judge.worn_pieces(&Placement::AS_GIVEN).len())
    }

    /// Which connected piece of a mesh, as it stands, lies beside the body, in words.
    pub fn stray_piece(&self, mesh: &TriMesh, body: &Body) -> Option<String> {
        self.look(mesh, body, |search, cloth, judge| {
            stray(search, cloth, judge).map(|piece| piece.to_string())
        })
    }

    /// What speaks against the category of a mesh that lies where it is worn.
    pub fn contradiction(&self, mesh: &TriMesh, body: &Body, category: Category) -> Option<String> {
        self.look(mesh, body, |_, _, judge| contradiction(category, judge.limbs(&Placement::AS_GIVEN)))
    }

    /// Whether `mesh`, taken as it stands (metres, y up, pelvis at the origin, arms level), is worn on the zero body
    /// and fits nowhere clearly better, by the same judgement by which [`fit`](super::fit) takes a placement; and every
    /// piece of it has its faces outwards. `body` is the one that was measured.
    pub fn is_on_body(&self, mesh: &TriMesh, body: &Body) -> bool {
        let settings = FitSettings {
            unit: Some(Unit::M),
            up: Some(UpAxis::Y),
            arms_lowered: Some(false),
            ..FitSettings::default()
        };
        let is_worn = |search: &Search, cloth: &Cloth, judge: &Judge| {
            let outward = outward_area(cloth.positions, cloth.faces, cloth.topology, search.surface());
            if outward.into_iter().any(|area| area < 0.0) || stray(search, cloth, judge).is_some() {
                return false;
            }
            let Ok(given) = search.believed_as_given(cloth, &settings) else { return false };
            let best = search.candidates(cloth, &settings).first().map_or(f64::MIN, |c| c.score);
            best <= given.score + BETTER_ELSEWHERE
        };
        mesh.face_count() >= MIN_TRIANGLES && self.look(mesh, body, is_worn)
    }
}

/// A connected piece of cloth, as it stands, that lies beside the body.
fn stray(search: &Search, cloth: &Cloth, judge: &Judge) -> Option<StrayPiece> {
    let worn = judge.worn_pieces(&Placement::AS_GIVEN);
    stray_pieces(cloth.positions, cloth.topology, search.surface(), &worn).into_iter().next()
}

impl fmt::Debug for PlacementCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("PlacementCheck")
    }
}

/// [`PlacementCheck::is_on_body`] for one mesh.
pub fn is_on_body(mesh: &TriMesh, body: &Body) -> bool {
    PlacementCheck::new(body).is_ok_and(|check| check.is_on_body(mesh, body))
}

#[cfg(test)]
mod tests {
    use super::*;
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
