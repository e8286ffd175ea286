mod hints;

use super::limb_pose::tests::posed;
use super::*;
use crate::asset::Category;
use crate::asset::rotation;
use crate::generate::garment::generated;
use crate::generate::mannequin;
use clothcombo_physics::mesh::shapes::{icosphere, tube};
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
    for up in UpAxis::ALL {
        for unit in Unit::ALL {
            let original = &garments[(number + number / 5) % garments.len()];
            let on_floor = number % 2 == 1;
            let placement = Placement {
                unit,
                up,
                turn_degrees: [0.0, 90.0, 180.0, 270.0][number % 4],
                origin: if on_floor { Origin::Floor } else { Origin::Pelvis },
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
    assert_eq!(placement.origin, Origin::Elsewhere);
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
        origin: Origin::Floor,
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

#[test]
fn a_garment_that_fits_nowhere_is_refused_with_two_readings_and_the_flags() {
    let body = mannequin();
    let shirt = long_sleeved(&body);
    let faces = || shirt.rest.faces().iter().map(<[u32; 3]>::as_slice);
    let fit_of = |change: fn([f64; 3]) -> [f64; 3]| {
        let positions = shirt.rest.positions().iter().map(|p| change(*p)).collect();
        fit(&polygons(positions, faces()), &body, &FitSettings::default())
    };
    assert_eq!(fit_of(|p| p).unwrap().report.misfit(), None);
    let message = fit_of(|[x, y, z]| [0.7 * (x + z), y, 0.7 * (z - x)]).unwrap_err().to_string();
    for words in ["the best: unit", "the second: unit", "--turn", "--offset"] {
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn what_is_no_garment_is_refused_with_the_reason() {
    let body = mannequin();
    let mesh = |m: &TriMesh| polygons(m.positions().to_vec(), m.faces().iter().map(<[u32; 3]>::as_slice));
    let refused = |file: &PolygonMesh, settings: &FitSettings| fit(file, &body, settings).unwrap_err();
    let auto = FitSettings::default();

    assert_eq!(refused(&mesh(&body.zero_body()), &auto), FitError::Closed);
    assert_eq!(refused(&mesh(&icosphere(0.3, 2)), &auto), FitError::Closed);
    let patch = tube(0.2, 0.3, 3, 2);
    assert!(
        matches!(refused(&mesh(&patch), &auto), FitError::TooFewTriangles { triangles } if triangles < 20)
    );
    // The body with a hole is still a body.
    let zero = body.zero_body();
    let holed = polygons(zero.positions().to_vec(), zero.faces()[2..].iter().map(<[u32; 3]>::as_slice));
    assert_eq!(refused(&holed, &auto), FitError::Body);

    let shirt = garment(&body, Category::TShirt, 1).rest;
    let metres = FitSettings { unit: Some(Unit::M), ..FitSettings::default() };
    let large = shirt.with_positions(shirt.positions().iter().map(|p| scale(*p, 100.0)).collect()).unwrap();
    let error = refused(&mesh(&large), &metres);
    assert!(matches!(error, FitError::Extent { unit: Some(Unit::M), .. }), "{error}");
    assert!(error.to_string().contains("the body is"), "{error}");

    // A ring around the head.
    let head = body.joint_template[15];
    let ring = tube(0.11, 0.05, 24, 3);
    let hat: Vec<[f64; 3]> =
        ring.positions().iter().map(|p| [p[0], p[1] + head[1] + 0.1, p[2] + head[2]]).collect();
    let error = refused(&mesh(&ring.with_positions(hat).unwrap()), &metres);
    assert_eq!(error, FitError::OffTrunk { place: "it covers the head only" });
}

/// Two meshes in one file.
fn together(a: &TriMesh, b: &TriMesh) -> PolygonMesh {
    let positions = a.positions().iter().chain(b.positions()).copied().collect();
    let shift = a.vertex_count() as u32;
    let faces: Vec<[u32; 3]> =
        a.faces().iter().copied().chain(b.faces().iter().map(|f| f.map(|v| v + shift))).collect();
    polygons(positions, faces.iter().map(<[u32; 3]>::as_slice))
}

#[test]
fn an_outfit_in_one_file_is_doubted() {
    let body = mannequin();
    let (top, skirt) = (garment(&body, Category::Top, 3).rest, garment(&body, Category::Skirt, 4).rest);
    let fitted = fit(&together(&top, &skirt), &body, &FitSettings::default()).unwrap();
    assert!(
        fitted.report.doubts.iter().any(|d| d.contains("one file per garment")),
        "{:?}",
        fitted.report.doubts
    );
    let check = PlacementCheck::new(&body).unwrap();
    assert_eq!(check.worn_pieces(&fitted.garment.rest, &body), 2);
    assert_eq!(check.worn_pieces(&top, &body), 1);
}

#[test]
fn a_vertex_far_from_all_others_is_named_and_set_aside() {
    let body = mannequin();
    let shirt = garment(&body, Category::TShirt, 8).rest;
    let mut positions = shirt.positions().to_vec();
    positions.push([0.0, 50.0, 0.0]);
    let far = shirt.vertex_count() as u32;
    let [a, b, _] = shirt.faces()[0];
    let faces: Vec<[u32; 3]> = shirt.faces().iter().copied().chain([[b, a, far]]).collect();
    let file = polygons(positions, faces.iter().map(<[u32; 3]>::as_slice));
    let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
    assert_eq!(fitted.garment.rest.face_count(), shirt.face_count());
    let dropped = fitted.report.repairs.iter().find(|r| r.kind == RepairKind::DroppedFarVertices).unwrap();
    assert_eq!(dropped.elements, Elements::Vertices(vec![far]));
}

#[test]
fn a_garment_upside_down_is_refused_or_doubted() {
    let body = mannequin();
    let shirt = garment(&body, Category::TShirt, 8).rest;
    let upside: Vec<[f64; 3]> = shirt.positions().iter().map(|[x, y, z]| [-x, -y, *z]).collect();
    let file = polygons(upside, shirt.faces().iter().map(<[u32; 3]>::as_slice));
    for turn_degrees in [None, Some(0.0)] {
        let fitted = fit(&file, &body, &FitSettings { turn_degrees, ..FitSettings::default() });
        let is_told = |fitted: &Fitted| !fitted.report.doubts.is_empty() || fitted.report.misfit().is_some();
        assert!(fitted.as_ref().map_or(true, is_told), "{}", fitted.unwrap().report);
    }
}

#[test]
fn a_body_that_stands_otherwise_is_refused() {
    let body = mannequin();
    let shirt = garment(&body, Category::TShirt, 8).rest;
    let file = polygons(shirt.positions().to_vec(), shirt.faces().iter().map(<[u32; 3]>::as_slice));
    let changes: [(fn([f64; 3]) -> [f64; 3], &str); 4] = [
        (|p| p.map(|x| 100.0 * x), "m high: are the units metres"),
        (|[x, y, z]| [x, -z, y], "m high: are the units metres and y up"),
        (|[x, y, z]| [-x, y, -z], "turned or mirrored"),
        (|[x, y, z]| [-x, y, z], "turned or mirrored"),
    ];
    for (change, part) in changes {
        let mut other = body.clone();
        other.template.iter_mut().for_each(|p| *p = change(*p));
        other.joint_template.iter_mut().for_each(|p| *p = change(*p));
        // Through a file, as a user's body comes.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("body.npz");
        other.save(&path, &crate::asset::Provenance::default()).unwrap();
        let other = Body::load(&path, &crate::asset::BodyFileSettings::default()).unwrap();
        let error = fit(&file, &other, &FitSettings::default()).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}
