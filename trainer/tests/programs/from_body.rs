//! Garments that were made on a body with its origin elsewhere, through `clothcombo fit` and `clothcombo drape` with
//! `--from-body`.

use crate::common::holds;
use crate::drape::{at, drape, failure, report};
use assert_cmd::Command;
use clothcombo_data::asset::Body;
use clothcombo_data::format::{NpzWriter, load_tri_mesh, obj};
use clothcombo_data::generate::mannequin;
use clothcombo_physics::TriMesh;
use clothcombo_physics::vec3::{add, norm, sub};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Where the pelvis of the published body is (m).
const PELVIS: [f64; 3] = [0.0, -0.22, 0.03];

fn clothcombo(verb: &str) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.env("NO_COLOR", "1").arg(verb);
    command
}

fn moved(positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| add(*p, PELVIS)).collect()
}

/// A body model as its publisher writes it, in coordinates of its own.
fn publish(body: &Body, path: &str) {
    let (v, j, k) = (body.vertex_count(), body.joint_count(), body.shape_count);
    let parents = body.parents.iter().map(|p| p.map_or(-1, |p| p as i64)).chain(0..j as i64);
    let mut npz = NpzWriter::new();
    npz.f64("v_template", &[v, 3], moved(&body.template).as_flattened())
        .u32("f", &[body.faces.len(), 3], body.faces.as_flattened())
        .f32("shapedirs", &[v, 3, k], &body.shape_directions)
        .f32("weights", &[v, j], &body.skin_weights.to_dense(j))
        .i64("kintree_table", &[2, j], &parents.collect::<Vec<_>>())
        .f64("J_template", &[j, 3], moved(&body.joint_template).as_flattened())
        .f64("J_shapedirs", &[j, 3, k], &body.joint_shape_directions);
    npz.save(Path::new(path)).unwrap();
}

/// The published body, and a garment on it: as made, and as it lies on the mannequin.
fn made(folder: &TempDir) -> (String, String, TriMesh) {
    let (npz, file) = (at(folder, "published.npz"), at(folder, "tee.obj"));
    publish(&mannequin(), &npz);
    let garments = at(folder, "garments");
    clothcombo("generate")
        .args([
            "--count",
            "1",
            "--seed",
            "9",
            "--vertices",
            "500",
            "--categories",
            "t_shirt",
            "-o",
            &garments,
        ])
        .assert()
        .success();
    let tee = load_tri_mesh(&Path::new(&garments).join("t_shirt_000009.obj")).unwrap();
    obj::save(Path::new(&file), &moved(tee.positions()), tee.faces(), &[]).unwrap();
    (npz, file, tee)
}

#[test]
fn a_garment_in_the_coordinates_of_a_published_body_is_fitted_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let (npz, file, tee) = made(&folder);
    let (imported, out) = (at(&folder, "imported.npz"), at(&folder, "out.obj"));
    clothcombo("import").args(["smplx", &npz, "-o", &imported]).assert().success();
    for source in [&npz, &imported] {
        clothcombo("fit").args([&file, "--from-body", source, "-o", &out]).assert().success();
        let fitted = load_tri_mesh(Path::new(&out)).unwrap();
        let errors = fitted.positions().iter().zip(tee.positions()).map(|(a, b)| norm(sub(*a, *b)));
        assert!(fitted.faces() == tee.faces() && errors.fold(0.0, f64::max) < 1e-5);
        let text = fs::read_to_string(&out).unwrap();
        assert!(
            text.contains("placed through body") && text.contains("its pelvis at 0, -220, 30 mm"),
            "{text}"
        );
        fs::remove_file(&out).unwrap();
    }
    let other = format!("{npz}:1,2,x");
    for (source, more, word) in [
        (other.as_str(), &[][..], "'x', which is no number"),
        (&file, &[], "no standing person"),
        (&npz, &["--arms", "a"], "leave --arms out"),
    ] {
        let message =
            failure(clothcombo("fit").args([&file, "--from-body", source, "-o", &out]).args(more), 1);
        assert!(holds(&message, word), "{message}");
        assert!(!Path::new(&out).exists());
    }
    let body = at(&folder, "body.obj");
    obj::save(Path::new(&body), &moved(&mannequin().template), &mannequin().faces, &[]).unwrap();
    let message = failure(clothcombo("fit").args([&file, "--from-body", &body, "-o", &body]), 1);
    assert!(holds(&message, "the body of --from-body itself"), "{message}");
}

#[test]
fn a_garment_made_on_another_body_is_draped_by_flag_and_by_outfits_file() {
    let folder = tempfile::tempdir().unwrap();
    let (npz, file, _) = made(&folder);
    let out = at(&folder, "out");
    drape(&["--garments", &file, "--from-body", &npz, "-o", &out]).assert().success();
    let placed = report(Path::new(&out))["garments"][0]["fit"]["from_body"].clone();
    assert_eq!(placed["carried"], "shape");
    assert!(placed["moved_mm"].as_f64().unwrap() < 1e-3);

    let outfits = at(&folder, "outfits.toml");
    let text = "[[outfit]]\ngarments = [{ file = \"tee.obj\", from_body = \"published.npz:0.5\" }]\n";
    fs::write(&outfits, text).unwrap();
    let several = at(&folder, "several");
    drape(&["--outfits", &outfits, "-o", &several]).assert().success();
    let placed = report(Path::new(&several))["garments"][0]["fit"]["from_body"].clone();
    assert_eq!(placed["shape"][0], 0.5);

    fs::write(&outfits, text.replace("published", "missing")).unwrap();
    let message = failure(&mut drape(&["--outfits", &outfits, "-o", &at(&folder, "none")]), 1);
    assert!(holds(&message, "from_body") && holds(&message, "missing.npz"), "{message}");
}
