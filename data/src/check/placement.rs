//! Whether a garment lies where garments lie on the body; training on one that does not teaches nothing.

use crate::asset::Body;
use crate::fit::{PlacementCheck, is_double};
use clothcombo_physics::TriMesh;

/// A garment farther from the body than this is not on it (m).
const OFF_BODY: f64 = 0.1;

/// The largest extent of a garment, in heights of the body: arms and legs of a jumpsuit spread, with room for a train.
const LARGEST_EXTENT: f64 = 1.6;

/// The least: a wristband is smaller, but nothing that is draped over a body.
const SMALLEST_EXTENT: f64 = 0.05;

/// Why `mesh` does not lie on the zero body of `body` as a garment does, in words; `None` if it does. `gaps` are the signed
/// distances of its vertices to the body (m), in ascending order.
pub(super) fn misplacement(
    mesh: &TriMesh,
    body: &Body,
    check: &PlacementCheck,
    gaps: &[f64],
) -> Option<String> {
    if check.is_on_body(mesh, body) {
        return None;
    }
    if is_double(mesh.positions(), mesh.faces()) {
        return Some("cloth of two sheets, with thickness or a lining, where a garment is one".into());
    }
    let (least, name) = (gaps.first().copied()?, &body.name);
    let (low, high) = body.zero_body().bounds();
    let (extent, height) = (mesh.extent(), high[1] - low[1]);
    let inside = gaps.iter().filter(|gap| **gap < 0.0).count();
    let percent = 100.0 * inside as f64 / gaps.len() as f64;
    Some(if extent > LARGEST_EXTENT * height || extent < SMALLEST_EXTENT * height {
        format!("{extent:.3} m large on a body of {height:.2} m: not in metres?")
    } else if least > OFF_BODY {
        format!("{least:.2} m away from body '{name}': another origin or unit?")
    } else if let Some(piece) = check.stray_piece(mesh, body) {
        format!("{piece}: export one file per garment")
    } else if check.is_on_body(&mesh.turned(), body) {
        "inside out: its faces look at the body".into()
    } else if inside > 0 {
        format!(
            "not where it is worn on body '{name}': {percent:.0} % of its vertices lie inside, up to {:.0} mm deep",
            -1e3 * least
        )
    } else {
        format!("not where it is worn on body '{name}': another place, axis or body?")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::Category;
    use crate::generate::garment::generated;
    use crate::generate::mannequin;
    use clothcombo_physics::query::{Distance, Surface};

    #[test]
    fn every_kind_of_misplacement_has_its_reason() {
        let body = mannequin();
        let (surface, check) = (Surface::from_mesh(&body.zero_body()), PlacementCheck::new(&body).unwrap());
        let tee = generated(&body, Category::TShirt, 4, 300).rest;
        let reason = |mesh: &TriMesh| {
            let gap = |p: &[f64; 3]| surface.gap(*p, Distance::ClosestPoint).gap;
            let mut gaps: Vec<f64> = mesh.positions().iter().map(gap).collect();
            gaps.sort_by(f64::total_cmp);
            misplacement(mesh, &body, &check, &gaps)
        };
        let moved = |change: fn([f64; 3]) -> [f64; 3]| {
            tee.with_positions(tee.positions().iter().map(|p| change(*p)).collect()).unwrap()
        };
        let beside = |mesh: &TriMesh| {
            let moved = |[x, y, z]: &[f64; 3]| [x + 1.6, *y, *z];
            let positions = mesh.positions().iter().copied().chain(mesh.positions().iter().map(moved));
            let shift = mesh.vertex_count() as u32;
            let copy = mesh.faces().iter().map(|f| f.map(|v| v + shift));
            TriMesh::new(positions.collect(), mesh.faces().iter().copied().chain(copy).collect()).unwrap()
        };
        assert_eq!(reason(&tee), None);
        for (mesh, word) in [
            (moved(|p| p.map(|x| 100.0 * x)), "not in metres"),
            (moved(|p| p.map(|x| 0.001 * x)), "not in metres"),
            (moved(|[x, y, z]| [x, y, z + 2.0]), "away from body"),
            (moved(|[x, y, z]| [x, y - 0.235, z]), "% of its vertices lie inside"),
            (beside(&tee), "one of its 2 pieces"),
            (tee.turned(), "inside out"),
        ] {
            let reason = reason(&mesh).unwrap_or_default();
            assert!(reason.contains(word), "{word}: {reason:?}");
        }
    }
}
