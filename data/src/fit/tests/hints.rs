//! What hints say is taken; what a file does not tell is found out, or told.

use super::*;
use crate::asset::BodyFileSettings;
use crate::asset::rotation::matrix_from_axis_angle;
use crate::fit::limb_pose::tests::posed;
use clothcombo_physics::mesh::vertex_normals as normals_of;
use std::path::Path;

fn shipped_body() -> Body {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default/body.npz");
    Body::load(&file, &BodyFileSettings::default()).unwrap()
}

/// A top, or a dress, 8 mm off the skin, with sleeves 3 cm over the hands, made for arms that are held `back` (degrees).
fn long_sleeved_on(body: &Body, is_dress: bool, back: f64) -> PolygonMesh {
    let (skin, wrist) = (&body.template, body.joint_place("left_wrist").unwrap()[0]);
    let neck = body.joint_place("neck").unwrap()[1];
    let is_covered = |v: &u32| {
        let [x, y, z] = skin[*v as usize];
        let top = if z > 0.0 && x.abs() < 0.09 { neck - 0.06 } else { neck };
        x.abs() < wrist + 0.03 && (-0.05..top).contains(&y)
    };
    let faces: Vec<[u32; 3]> = body.faces.iter().filter(|f| f.iter().all(is_covered)).copied().collect();
    let normals = normals_of(skin, &body.faces);
    let shoulder = body.joint_place("left_shoulder").unwrap();
    let moved = |(p, n): (&[f64; 3], &[f64; 3])| {
        let p = add(*p, scale(*n, 0.008));
        let (side, reach) = (p[0].signum(), p[0].abs() - shoulder[0] + 0.02);
        let angle = side * back.to_radians() * (reach / 0.06).clamp(0.0, 1.0);
        let pivot = [side * (shoulder[0] - 0.02), shoulder[1], shoulder[2]];
        add(pivot, rotation::apply(&matrix_from_axis_angle([0.0, angle, 0.0]), sub(p, pivot)))
    };
    let mut positions: Vec<[f64; 3]> = skin.iter().zip(&normals).map(moved).collect();
    let mut all = faces.clone();
    if is_dress {
        let mesh = TriMesh::new(skin.clone(), faces).unwrap();
        let lowest = |border: &Vec<u32>| {
            border.iter().map(|v| skin[*v as usize][1]).sum::<f64>() / border.len() as f64
        };
        let borders = Topology::new(&mesh).boundary_loops;
        let mut ring = borders.into_iter().min_by(|a, b| lowest(a).total_cmp(&lowest(b))).unwrap();
        for row in 1..12 {
            let first = positions.len() as u32;
            for v in &ring {
                let [x, _, z] = positions[*v as usize];
                positions.push([1.02 * x, -0.05 - 0.04 * f64::from(row), 1.02 * z]);
            }
            let below = |k: usize| first + (k % ring.len()) as u32;
            for k in 0..ring.len() {
                let [a, b, c, d] = [ring[k], ring[(k + 1) % ring.len()], below(k), below(k + 1)];
                all.extend([[b, a, c], [b, c, d]]);
            }
            ring = (0..ring.len()).map(below).collect();
        }
    }
    polygons(positions, all.iter().map(<[u32; 3]>::as_slice))
}

#[test]
fn sleeves_over_the_hands_and_for_other_arms_are_no_contradiction_and_hints_are_taken() {
    let body = shipped_body();
    for (is_dress, back) in [(false, 0.0), (false, 8.0), (true, 8.0)] {
        let file = long_sleeved_on(&body, is_dress, back);
        let fitted = fit(&file, &body, &FitSettings::default()).unwrap();
        assert_eq!(fitted.report.placement, Placement::AS_GIVEN, "{:?}", fitted.report.doubts);
        let is_told = fitted.report.doubts.iter().any(|doubt| doubt.contains("arms of the body pass"));
        assert_eq!(is_told, back != 0.0, "{:?}", fitted.report.doubts);
    }
    let file = long_sleeved_on(&body, false, 8.0);
    // Back to front, and a hand's breadth too low: nobody wears it so, but the hints say it.
    let settings = FitSettings {
        unit: Some(Unit::M),
        up: Some(UpAxis::Y),
        turn_degrees: Some(180.0),
        arms_lowered: Some(false),
        category: Some(Category::Top),
        offset: Some([0.0, -0.1, 0.0]),
        ..FitSettings::default()
    };
    let report = fit(&file, &body, &settings).unwrap().report;
    assert_eq!((report.placement.turn_degrees, report.placement.translation), (180.0, [0.0, -0.1, 0.0]));
    assert!(
        report.doubts.iter().any(|doubt| doubt.contains("hints are taken all the same")),
        "{:?}",
        report.doubts
    );
}

#[test]
fn legs_apart_are_found_or_taken_as_they_are_said_to_be() {
    let body = shipped_body();
    let trousers = generated(&body, Category::Trousers, 7001, 900);
    let elsewhere = [0.0, -0.235, -0.02];
    for (degrees, legs_degrees, origin, limit) in
        [(5.0, None, [0.0; 3], 0.004), (8.0, Some(8.0), [0.0; 3], 1e-3), (10.0, None, elsewhere, 0.01)]
    {
        let mut positions = posed(&trousers, &body, [0.0, degrees]);
        positions.iter_mut().for_each(|p| *p = add(*p, origin));
        let file = polygons(positions.clone(), trousers.rest.faces().iter().map(<[u32; 3]>::as_slice));
        assert!(!is_on_body(&trousers.rest.with_positions(positions).unwrap(), &body), "{degrees}");
        let fitted = fit(&file, &body, &FitSettings { legs_degrees, ..FitSettings::default() }).unwrap();
        let found = fitted.report.placement.leg_angle_degrees;
        let (median, far) = recovery(&fitted.garment, &trousers);
        assert!(
            (found - degrees).abs() < 1.0 && median < limit && far == 0.0,
            "{degrees}: {found} {median} {far}"
        );
        assert!(fitted.report.to_string().contains("each leg is turned outwards by"));
    }
}

#[test]
fn arms_say_nothing_about_trousers() {
    let body = shipped_body();
    let trousers = generated(&body, Category::Trousers, 7001, 500).rest;
    let file = polygons(trousers.positions().to_vec(), trousers.faces().iter().map(<[u32; 3]>::as_slice));
    let settings = FitSettings { arms_lowered: Some(true), ..FitSettings::default() };
    let report = fit(&file, &body, &settings).unwrap().report;
    assert_eq!((report.placement, &report.doubts[..]), (Placement::AS_GIVEN, &[][..]));
}

#[test]
fn what_is_upside_down_is_told_with_the_flag() {
    let body = shipped_body();
    let trousers = generated(&body, Category::Trousers, 14, 1500).rest;
    let upside: Vec<[f64; 3]> = trousers.positions().iter().map(|[x, y, z]| [-x, -y, *z]).collect();
    let file = polygons(upside, trousers.faces().iter().map(<[u32; 3]>::as_slice));
    let error =
        fit(&file, &body, &FitSettings::default()).map(|fitted| fitted.report.to_string()).unwrap_err();
    assert_eq!(error, FitError::UpsideDown { up: UpAxis::MinusY }, "{error}");
    let said = FitSettings { up: Some(UpAxis::MinusY), ..FitSettings::default() };
    assert_eq!(fit(&file, &body, &said).unwrap().report.category, Category::Trousers);
}

#[test]
fn wide_trousers_are_of_another_size_whatever_else_they_may_be() {
    let body = shipped_body();
    let trousers = generated(&body, Category::Trousers, 7001, 500).rest;
    let positions = trousers.positions().iter().map(|p| scale(*p, 1.5)).collect();
    let file = polygons(positions, trousers.faces().iter().map(<[u32; 3]>::as_slice));
    let report = fit(&file, &body, &FitSettings::default()).unwrap().report;
    assert!(report.doubts.iter().any(|doubt| doubt.contains("scaled by about 0.")), "{:?}", report.doubts);
    let pairs = report.contact.body_triangle_pairs;
    let is_told =
        report.warnings().iter().any(|w| w.contains(&format!("{pairs} intersecting triangle pairs")));
    assert_eq!(is_told, pairs > 0, "{:?}", report.warnings());
}

#[test]
fn a_garment_of_another_size_is_refused_with_the_factor_that_fits() {
    let body = shipped_body();
    let tee = generated(&body, Category::TShirt, 9, 700).rest;
    for (factor, unit) in [(0.3, None), (0.4335, None), (2.8, Some(Unit::M))] {
        let positions = tee.positions().iter().map(|p| scale(*p, factor)).collect();
        let file = polygons(positions, tee.faces().iter().map(<[u32; 3]>::as_slice));
        let settings = FitSettings { unit, ..FitSettings::default() };
        let error = fit(&file, &body, &settings).map(|fitted| fitted.report.to_string()).unwrap_err();
        let FitError::Size { size } = error else { panic!("{factor}: {error}") };
        assert!((size.factor * factor - 1.0).abs() < 0.15, "{factor}: {size}");
    }
}

#[test]
fn half_a_garment_is_called_half_a_garment() {
    let body = mannequin();
    let tee = generated(&body, Category::TShirt, 4, 500).rest;
    let positions = tee.positions().iter().map(|[x, y, z]| [x.max(0.0), *y, *z]).collect();
    let is_left = |f: &&[u32; 3]| f.iter().any(|v| tee.positions()[*v as usize][0] > 0.0);
    let file = polygons(positions, tee.faces().iter().filter(is_left).map(<[u32; 3]>::as_slice));
    let error = fit(&file, &body, &FitSettings::default()).unwrap_err().to_string();
    assert!(error.contains("half a garment: all of it lies on one side of x = 0"), "{error}");
}

#[test]
fn every_piece_is_on_the_body_or_named() {
    let body = mannequin();
    let tee = generated(&body, Category::TShirt, 4, 400).rest;
    let beside = |x: f64| {
        let moved = tee.positions().iter().map(|p| add(*p, [x, 0.0, 0.0])).collect();
        together(&tee, &tee.with_positions(moved).unwrap())
    };
    // An open shirt hangs from its arms.
    let open = generated(&body, Category::OpenShirt, 4, 400).rest;
    let moved = open.positions().iter().map(|p| add(*p, [1.5, 0.0, 0.0])).collect();
    let shirts = together(&open, &open.with_positions(moved).unwrap());
    let error = fit(&shirts, &body, &FitSettings::default()).unwrap_err();
    assert!(matches!(error, FitError::StrayPiece { .. }), "{error}");
    let file = beside(1.6);
    let settings = FitSettings { unit: Some(Unit::M), offset: Some([0.0; 3]), ..FitSettings::default() };
    for settings in [&FitSettings::default(), &settings] {
        let error = fit(&file, &body, settings).unwrap_err();
        assert!(matches!(error, FitError::StrayPiece { .. }), "{error}");
        let error = error.to_string();
        assert!(error.contains("one of its 2 pieces") && error.contains("--keep largest"), "{error}");
    }
    assert!(fit(&file, &body, &FitSettings { keep: Keep::Largest, ..FitSettings::default() }).is_ok());
    // Around a hand it touches the body, but is not worn.
    assert!(fit(&beside(0.75), &body, &FitSettings::default()).is_err());
}
