mod hints;
mod refusals;

use super::limb_pose::tests::posed;
use super::*;
use crate::asset::Category;
use crate::asset::rotation;
use crate::generate::garment::generated;
use crate::generate::mannequin;
use clothcombo_physics::query::VertexIndex;
use clothcombo_physics::vec3::{add, cross, dot, scale};

fn garment(body: &Body, category: Category, seed: u64) -> Garment {
    generated(body, category, seed, 500)
}

/// The longest-sleeved of a few shirts: cap sleeves lie on the shoulder at any angle and would fit around the hips as well.
fn long_sleeved(body: &Body) -> Garment {
    let reach = |g: &Garment| g.rest.bounds().1[0];
    let shirts = (1..=5).map(|seed| garment(body, Category::TShirt, seed));
    shirts.max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap()
}

/// The file that `placement` would bring back to these positions.
fn unplaced(positions: &[[f64; 3]], placement: &Placement) -> Vec<[f64; 3]> {
    let back = rotation::transpose(&placement.turn());
    positions
        .iter()
        .map(|p| rotation::apply(&back, scale(sub(*p, placement.translation), 1.0 / placement.unit.metres())))
        .collect()
}

fn polygons<'a>(positions: Vec<[f64; 3]>, faces: impl IntoIterator<Item = &'a [u32]>) -> PolygonMesh {
    let mut mesh = PolygonMesh::with_positions(positions);
    faces.into_iter().for_each(|f| mesh.push(f));
    mesh
}

/// Median distance from each fitted vertex to the nearest original one, and the share farther than 2 cm.
fn recovery(fitted: &Garment, original: &Garment) -> (f64, f64) {
    let points = original.rest.positions();
    let index = VertexIndex::new(points);
    let mut distances: Vec<f64> = (fitted.rest.positions().iter())
        .map(|p| norm(sub(*p, points[index.nearest(*p).0 as usize])))
        .collect();
    distances.sort_by(f64::total_cmp);
    let far = distances.iter().filter(|d| **d > 0.02).count();
    (distances[distances.len() / 2], far as f64 / distances.len() as f64)
}

#[test]
fn every_unit_up_axis_and_facing_is_found_and_the_garment_recovered() {
    let body = mannequin();
    let garments = [
        garment(&body, Category::TShirt, 1),
        garment(&body, Category::Trousers, 2),
        garment(&body, Category::Dress, 3),
        garment(&body, Category::Skirt, 4),
        garment(&body, Category::Top, 5),
    ];
    let floor = body.zero_body().bounds().0[1];
    let mut number = 0;
    for up in UpAxis::USUAL {
        for unit in Unit::ALL {
            let original = &garments[(number + number / 5) % garments.len()];
            let on_floor = number % 2 == 1;
            let placement = Placement {
                unit,
                up,
                turn_degrees: [0.0, 90.0, 180.0, 270.0][number % 4],
                origin: if on_floor { FileOrigin::Floor } else { FileOrigin::Pelvis },
                translation: [0.0, if on_floor { floor } else { 0.0 }, 0.0],
                ..Placement::AS_GIVEN
            };
            let file = polygons(
                unplaced(original.rest.positions(), &placement),
                original.rest.faces().iter().map(<[u32; 3]>::as_slice),
            );
            let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
            number += 1;
            let found = fitted.report.placement;
            // Some skirts fit the mannequin as well back to front; that is told, and nothing else may differ.
            if found.turn_degrees != placement.turn_degrees {
                assert_eq!((found.turn_degrees - placement.turn_degrees).abs(), 180.0, "{}", original.name);
                assert_eq!(Placement { turn_degrees: placement.turn_degrees, ..found }, placement);
                assert!(
                    fitted.report.doubts.iter().any(|doubt| doubt.contains("--turn")),
                    "{}",
                    original.name
                );
                assert_eq!(original.category, Category::Skirt);
                continue;
            }
            assert_eq!(found, placement, "{}", original.name);
            let (median, far) = recovery(&fitted.garment, original);
            assert!(median < 0.002 && far == 0.0, "{}: {median} {far}", original.name);
            assert_eq!(fitted.garment.category, original.category, "{}", original.name);
            assert_eq!(fitted.garment.holding, original.holding);
            assert!(fitted.report.repairs.is_empty(), "{:?}", fitted.report.repairs);
        }
    }
}

#[test]
fn a_garment_with_its_origin_elsewhere_is_moved_onto_the_body() {
    let body = mannequin();
    let original = long_sleeved(&body);
    let (low, high) = original.rest.bounds();
    let centre = scale(add(low, high), 0.5);
    let centred: Vec<[f64; 3]> =
        original.rest.positions().iter().map(|p| scale(sub(*p, centre), 100.0)).collect();
    let file = polygons(centred, original.rest.faces().iter().map(<[u32; 3]>::as_slice));
    let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
    let placement = fitted.report.placement;
    assert_eq!((placement.unit, placement.up, placement.turn_degrees), (Unit::Cm, UpAxis::Y, 0.0));
    assert_eq!(placement.origin, FileOrigin::Elsewhere);
    // Where exactly a loose shirt sits is a matter of a centimetre or two.
    let error = norm(sub(placement.translation, centre));
    assert!(error < 0.03, "{error}");
}

/// A soup with every defect that fitting repairs, in centimetres, z up, arms 40° down.
struct Messy {
    file: PolygonMesh,
    flap_edge: [[f64; 3]; 2],
    flipped: Vec<u32>,
}

fn messy(original: &Garment, body: &Body, degrees: f64) -> Messy {
    let posed = if degrees == 0.0 {
        original.rest.positions().to_vec()
    } else {
        posed(original, body, [degrees, 0.0])
    };
    let placement = Placement {
        unit: Unit::Cm,
        up: UpAxis::Z,
        turn_degrees: 180.0,
        origin: FileOrigin::Floor,
        translation: [0.0, body.zero_body().bounds().0[1], 0.0],
        arm_angle_degrees: degrees,
        leg_angle_degrees: 0.0,
    };
    let flat = unplaced(&posed, &placement);
    let hinges = Topology::new(&original.rest).hinges;
    let mut merged = vec![false; original.rest.face_count()];
    let mut mesh = PolygonMesh::default();
    // Unused vertices first.
    mesh.positions.extend([[1e4, 0.0, 0.0], [0.0, -1e4, 0.0]]);
    let soup = |mesh: &mut PolygonMesh, corners: &[u32]| {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(corners.iter().map(|v| flat[*v as usize]));
        mesh.push(&(0..corners.len() as u32).map(|i| base + i).collect::<Vec<_>>());
    };
    // Every fifth hinge becomes a quad.
    for hinge in hinges.iter().step_by(5) {
        let [f, g] = hinge.faces.map(|f| f as usize);
        if !merged[f] && !merged[g] {
            (merged[f], merged[g]) = (true, true);
            let ([a, b], [c, d]) = (hinge.edge, hinge.opposite);
            soup(&mut mesh, &[a, d, b, c]);
        }
    }
    let mut flipped = Vec::new();
    for (f, face) in original.rest.faces().iter().enumerate().filter(|(f, _)| !merged[*f]) {
        let [a, b, c] = *face;
        if f % 7 == 0 {
            flipped.push(mesh.polygon_count() as u32);
            soup(&mut mesh, &[a, c, b]);
        } else {
            soup(&mut mesh, &[a, b, c]);
        }
    }
    // A face again, a face without area, and a flap on an inner edge.
    let [a, b, c] = original.rest.faces()[0];
    soup(&mut mesh, &[b, c, a]);
    soup(&mut mesh, &[a, b, a]);
    // Where the flap stands up most from the cloth: lying flat, it would be as good a neighbour as the cloth itself.
    let tip = |p: [f64; 3]| [p[0] * 1.2, p[1] * 1.2, p[2]];
    let standing = |edge: [u32; 2], face: u32| {
        let [a, b, c] = original.rest.faces()[face as usize].map(|v| flat[v as usize]);
        let (normal, flap) =
            (cross(sub(b, a), sub(c, a)), sub(tip(flat[edge[0] as usize]), flat[edge[0] as usize]));
        dot(normal, flap).abs() / (norm(normal) * norm(flap))
    };
    let hinge = hinges
        .iter()
        .max_by(|g, h| standing(g.edge, g.faces[0]).total_cmp(&standing(h.edge, h.faces[0])))
        .unwrap();
    let edge = hinge.edge.map(|v| flat[v as usize]);
    let away = tip(edge[0]);
    let base = mesh.positions.len() as u32;
    mesh.positions.extend([edge[0], edge[1], away]);
    mesh.push(&[base, base + 1, base + 2]);
    Messy { file: mesh, flap_edge: edge, flipped }
}

#[test]
fn every_repair_is_made_and_reported() {
    let body = mannequin();
    let original = garment(&body, Category::TShirt, 12);
    let Messy { file, flap_edge, flipped } = messy(&original, &body, 0.0);
    let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
    let report = &fitted.report;
    let found = |kind: RepairKind| report.repairs.iter().find(|r| r.kind == kind);
    let isolated = found(RepairKind::DroppedIsolatedVertices).unwrap();
    assert_eq!(isolated.elements, Elements::Vertices(vec![0, 1]));
    // All corners but one per vertex of the garment and the tip of the flap.
    let kept = original.rest.vertex_count() + 1;
    assert_eq!(found(RepairKind::WeldedVertices).unwrap().count, file.positions.len() - 2 - kept);
    let quads = file.polygons().filter(|p| p.len() == 4).count();
    assert!(quads > 20);
    assert_eq!(found(RepairKind::TriangulatedFaces).unwrap().count, quads);
    let last = file.polygon_count() as u32 - 1;
    let faces = |kind| match &found(kind).unwrap().elements {
        Elements::Faces(list) => list.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(faces(RepairKind::DroppedRepeatedFaces), [last - 2]);
    assert_eq!(faces(RepairKind::DroppedDegenerateFaces), [last - 1]);
    match &found(RepairKind::CutNonManifoldEdges).unwrap().elements {
        Elements::Edges(list) => {
            let [edge] = &list[..] else { panic!("{list:?}") };
            let ends = edge.map(|v| file.positions[v as usize]);
            assert!(ends == flap_edge || [ends[1], ends[0]] == flap_edge);
        }
        other => panic!("{other:?}"),
    }
    // The flap is a piece of its own and may have been turned as well.
    let turned: Vec<u32> = faces(RepairKind::TurnedFaces).into_iter().filter(|f| *f != last).collect();
    assert_eq!(turned, flipped);
    assert_eq!(report.pieces.len(), 2);
    assert_eq!((report.pieces[1].triangles, report.pieces[1].vertices), (1, 3));
    assert!(report.unrepaired_edges.is_empty());
    assert!(
        report.mesh.defects.non_manifold_edges.is_empty() && report.mesh.defects.flipped_edges.is_empty()
    );
    let (median, _) = recovery(&fitted.garment, &original);
    assert!(median < 0.002, "{median}");
    // Text and JSON name each of them.
    let (text, json) = (report.to_string(), serde_json::to_string(report).unwrap());
    for (words, key) in
        [("welded", "welded_vertices"), ("unit cm", "\"unit\":\"cm\""), ("up axis z", "\"up\":\"z\"")]
    {
        assert!(text.contains(words) && json.contains(key), "{text}\n{json}");
    }
}

#[test]
fn lowered_arms_are_found_and_raised() {
    let body = mannequin();
    let original = long_sleeved(&body);
    for degrees in [25.0, 50.0] {
        let file = messy(&original, &body, degrees).file;
        let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
        let placement = fitted.report.placement;
        assert_eq!((placement.unit, placement.up, placement.turn_degrees), (Unit::Cm, UpAxis::Z, 180.0));
        assert!(
            (placement.arm_angle_degrees - degrees).abs() < 8.0,
            "{degrees}: {}",
            placement.arm_angle_degrees
        );
        let (median, _) = recovery(&fitted.garment, &original);
        assert!(median < 0.003, "{degrees}: {median}");
    }
}

#[test]
fn what_was_inside_the_body_is_pushed_out_and_listed() {
    let body = mannequin();
    let original = garment(&body, Category::Top, 6);
    let centre = [
        0.0,
        0.0,
        original.rest.positions().iter().map(|p| p[2]).sum::<f64>() / original.rest.vertex_count() as f64,
    ];
    let tight: Vec<[f64; 3]> = (original.rest.positions().iter())
        .map(|p| [0.8 * p[0], p[1], centre[2] + 0.8 * (p[2] - centre[2])])
        .collect();
    let file = polygons(tight, original.rest.faces().iter().map(<[u32; 3]>::as_slice));
    let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
    let contact = fitted.report.contact;
    assert!(contact.inside_before > 0 && contact.depth_before_mm > 0.0, "{contact:?}");
    assert_eq!(contact.inside_after, 0);
    assert!(contact.least_distance_mm > 1.5 && contact.largest_move_mm > 1.0, "{contact:?}");
    assert!(fitted.report.repairs.iter().any(|r| r.kind == RepairKind::PushedOut && r.count > 0));
    assert_eq!(fitted.report.misfit(), None, "{contact:?}");
}

/// Two meshes in one file.
fn together(a: &TriMesh, b: &TriMesh) -> PolygonMesh {
    let positions = a.positions().iter().chain(b.positions()).copied().collect();
    let shift = a.vertex_count() as u32;
    let faces: Vec<[u32; 3]> =
        a.faces().iter().copied().chain(b.faces().iter().map(|f| f.map(|v| v + shift))).collect();
    polygons(positions, faces.iter().map(<[u32; 3]>::as_slice))
}
