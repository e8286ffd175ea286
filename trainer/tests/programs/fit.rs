//! `clothcombo fit`: a generated skirt, written as a PLY soup in centimetres with z up, comes back as a clean OBJ.

use assert_cmd::Command;
use predicates::prelude::*;
use std::fs;
use std::path::Path;

fn clothcombo() -> Command {
    Command::cargo_bin("clothcombo").unwrap()
}

/// Vertices and faces of an OBJ of triangles.
fn read_obj(path: &Path) -> (Vec<[f64; 3]>, Vec<[usize; 3]>) {
    let text = fs::read_to_string(path).unwrap();
    let words = |key: &'static str| {
        text.lines()
            .filter_map(move |l| l.strip_prefix(key))
            .map(|l| l.split_whitespace().collect::<Vec<_>>())
    };
    let vertices = words("v ").map(|w| std::array::from_fn(|a| w[a].parse().unwrap())).collect();
    let faces = words("f ").map(|w| std::array::from_fn(|a| w[a].parse::<usize>().unwrap() - 1)).collect();
    (vertices, faces)
}

/// Every triangle with vertices of its own, in centimetres, z up.
fn soup(vertices: &[[f64; 3]], faces: &[[usize; 3]]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * faces.len(),
        faces.len()
    );
    for [x, y, z] in faces.iter().flatten().map(|v| vertices[*v]) {
        text += &format!("{} {} {}\n", 100.0 * x, -100.0 * z, 100.0 * y);
    }
    (0..faces.len()).for_each(|f| text += &format!("3 {} {} {}\n", 3 * f, 3 * f + 1, 3 * f + 2));
    text
}

#[test]
fn a_soup_in_centimetres_with_z_up_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let garments = folder.path().join("garments");
    clothcombo()
        .args(["generate", "--count", "1", "--vertices", "300", "--categories", "skirt", "-o"])
        .arg(&garments)
        .assert()
        .success();
    let (vertices, faces) = read_obj(&garments.join("skirt_000000.obj"));
    let file = folder.path().join("skirt.ply");
    fs::write(&file, soup(&vertices, &faces)).unwrap();
    let out = folder.path().join("fitted.obj");
    let text = clothcombo().arg("fit").arg(&file).arg("-o").arg(&out).assert().success();
    text.stdout(predicate::str::contains("unit cm").and(predicate::str::contains("up axis z")).and(
        predicate::str::contains(format!("welded duplicate vertices: {}", 3 * faces.len() - vertices.len())),
    ));
    let (fitted, fitted_faces) = read_obj(&out);
    assert_eq!((fitted.len(), fitted_faces.len()), (vertices.len(), faces.len()));
    for p in &fitted {
        let nearest = vertices
            .iter()
            .map(|q| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>().sqrt())
            .fold(f64::MAX, f64::min);
        assert!(nearest < 1e-4, "{nearest}");
    }

    let json = clothcombo().arg("fit").arg(&file).args(["--json", "--unit", "cm"]).output().unwrap();
    let json: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((json["placement"]["up"].as_str(), json["category"].as_str()), (Some("z"), Some("skirt")));
    assert_eq!(json["repairs"][0]["kind"], "welded_vertices");
}

#[test]
fn refusals_name_file_and_reason_and_usage_errors_exit_2() {
    let folder = tempfile::tempdir().unwrap();
    let cube = folder.path().join("cube.obj");
    let mut text = String::new();
    for corner in 0..8 {
        text += &format!("v {} {} {}\n", corner & 1, corner >> 1 & 1, corner >> 2);
    }
    text += "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    fs::write(&cube, text).unwrap();
    let out = folder.path().join("out.obj");
    let failed = clothcombo().arg("fit").arg(&cube).arg("-o").arg(&out).assert().code(1);
    failed.stderr(predicate::str::contains("cube.obj").and(predicate::str::contains("triangles")));
    assert!(!out.exists());
    clothcombo()
        .args(["fit", "x.obj", "--unit", "furlong"])
        .assert()
        .code(2)
        .stderr(predicate::str::contains("inch"));
    clothcombo().args(["fit", "none.obj"]).assert().code(1).stderr(predicate::str::contains("none.obj"));
}

#[cfg(unix)]
#[test]
fn files_of_any_name_are_reported() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let mut generate = clothcombo();
    generate.args(["generate", "--count", "1", "--vertices", "300", "-o"]).arg(&made).assert().success();
    let garment = folder.path().join(std::ffi::OsStr::from_bytes(b"dress-\xff.obj"));
    fs::copy(made.join("dress_000000.obj"), &garment).unwrap();
    let output = folder.path().join(std::ffi::OsStr::from_bytes(b"fitted-\xff.obj"));
    let run = clothcombo().args(["fit", "--json"]).arg(&garment).arg("-o").arg(&output).output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let report: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert!(report["garment"].as_str().unwrap().ends_with("dress-\u{fffd}.obj"), "{report}");
    assert!(report["output"].as_str().unwrap().ends_with("fitted-\u{fffd}.obj") && output.is_file());
}
