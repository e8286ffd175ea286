//! Does a garment already lie on a body, in metres and T-pose, so that nothing has to be found out?

use super::settings::MIN_TRIANGLES;
use crate::asset::Body;
use crate::mesh::outward_area;
use clothcombo_physics::{Surface, Topology, TriMesh};

/// Whether `mesh`, taken as it stands (metres, y up, pelvis at the origin, arms level), sits on the zero body of `body` as a
/// garment does: most of it close to the surface or all around it, little of it inside, by the same judgement by which
/// [`fit`](super::fit) takes a placement; and every piece of it with its faces outwards.
pub fn is_on_body(mesh: &TriMesh, body: &Body) -> bool {
    if mesh.face_count() < MIN_TRIANGLES {
        return false;
    }
    faces_outwards(mesh, body)
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
