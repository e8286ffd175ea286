//! What is refused, and why.

use super::*;
use clothcombo_physics::mesh::shapes::{icosphere, tube};

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
fn loose_triangles_are_refused_at_once() {
    let shirt = garment(&mannequin(), Category::TShirt, 8).rest;
    let corner =
        |(n, v): (usize, &u32)| add(shirt.positions()[*v as usize], [1e-3 * (n % 7) as f64, 0.0, 0.0]);
    let positions: Vec<[f64; 3]> = shirt.faces().iter().flatten().enumerate().map(corner).collect();
    let faces: Vec<[u32; 3]> =
        (0..shirt.face_count() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let file = polygons(positions, faces.iter().map(<[u32; 3]>::as_slice));
    let error = fit(&file, &mannequin(), &FitSettings::default()).unwrap_err();
    assert!(matches!(error, FitError::Scattered { .. }), "{error}");
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
