//! Garment files as other programs write them, through `clothcombo fit` and `clothcombo drape`: thick cloth, unsewn panels, quads
//! with texture coordinates, materials.

use crate::drape::{SKIRT, at, drape, failure};
use assert_cmd::Command;
use clothcombo_data::format::{load_mesh, load_tri_mesh, obj};
use clothcombo_physics::mesh::vertex_normals;
use clothcombo_physics::vec3::{add_scaled, norm, sub};
use clothcombo_physics::{Topology, TriMesh};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn clothcombo(verb: &str) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.env("NO_COLOR", "1").arg(verb);
    command
}

fn generated(folder: &TempDir, category: &str) -> TriMesh {
    let made = at(folder, &format!("made-{category}"));
    clothcombo("generate")
        .args(["--count", "1", "--seed", "9", "--vertices", "500", "--categories", category, "-o", &made])
        .assert()
        .success();
    load_tri_mesh(&Path::new(&made).join(format!("{category}_000009.obj"))).unwrap()
}

/// Both sheets of cloth 3 mm thick, with rims of quads between them.
fn thick(outer: &TriMesh) -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
    let normals = vertex_normals(outer.positions(), outer.faces());
    let inner = outer.positions().iter().zip(&normals).map(|(p, n)| add_scaled(*p, -0.003, *n));
    let positions: Vec<[f64; 3]> = outer.positions().iter().copied().chain(inner).collect();
    let count = outer.vertex_count() as u32;
    let mut polygons: Vec<Vec<u32>> = outer.faces().iter().map(|f| f.to_vec()).collect();
    polygons.extend(outer.faces().iter().map(|[a, b, c]| vec![a + count, c + count, b + count]));
    for rim in Topology::new(outer).boundary_loops {
        for (k, a) in rim.iter().enumerate() {
            let b = rim[(k + 1) % rim.len()];
            polygons.push(vec![b, *a, a + count, b + count]);
        }
    }
    (positions, polygons)
}

fn save(path: &str, (positions, polygons): &(Vec<[f64; 3]>, Vec<Vec<u32>>)) {
    obj::save_polygons(Path::new(path), positions, polygons.iter().map(Vec::as_slice), &[]).unwrap();
}

/// Median and largest distance (m).
fn distances(a: &[[f64; 3]], b: &[[f64; 3]]) -> (f64, f64) {
    let mut distances: Vec<f64> = a.iter().zip(b).map(|(p, q)| norm(sub(*p, *q))).collect();
    distances.sort_by(f64::total_cmp);
    (distances[distances.len() / 2], distances[distances.len() - 1])
}

#[test]
fn the_outer_sheet_of_a_thick_tee_is_fitted_and_written_with_or_without_thickness() {
    let folder = tempfile::tempdir().unwrap();
    let tee = generated(&folder, "t_shirt");
    let (file, thin, whole) = (at(&folder, "thick.obj"), at(&folder, "thin.obj"), at(&folder, "whole.obj"));
    let given = thick(&tee);
    save(&file, &given);

    let message = failure(clothcombo("fit").args([&file, "-o", &thin]), 1);
    assert!(message.contains("thick.obj") && message.contains("--keep outer"), "{message}");
    assert!(!Path::new(&thin).exists());

    clothcombo("fit").args([&file, "--keep", "outer", "-o", &thin]).assert().success();
    let fitted = load_tri_mesh(Path::new(&thin)).unwrap();
    assert_eq!(fitted.faces(), tee.faces());
    assert!(distances(fitted.positions(), tee.positions()).0 < 1e-4);
    clothcombo("check").arg(&thin).assert().success();

    clothcombo("fit").args([&file, "--keep", "outer", "--with-thickness", "-o", &whole]).assert().success();
    let written = load_mesh(Path::new(&whole)).unwrap();
    assert!(written.polygons().eq(given.1.iter().map(Vec::as_slice)));
    let (median, largest) = distances(&written.positions, &given.0);
    assert!(median < 1e-4 && largest < 1e-2, "{median} {largest}");
}

#[test]
fn the_inner_sheet_of_a_draped_skirt_follows_the_outer_one() {
    let folder = tempfile::tempdir().unwrap();
    let skirt = generated(&folder, "skirt");
    let file = at(&folder, "thick.obj");
    let given = thick(&skirt);
    save(&file, &given);
    let out = at(&folder, "out");
    let message = failure(&mut drape(&["--garments", &file, "-o", &out]), 1);
    assert!(message.contains("thick.obj") && message.contains("--keep outer"), "{message}");
    assert!(!Path::new(&out).exists());
    let message =
        failure(&mut drape(&["--garments", &file, "--keep", "outer", "--fit", "never", "-o", &out]), 1);
    assert!(message.contains("--fit never"), "{message}");

    // By a flag, and in a file of outfits beside a garment that has no thickness.
    drape(&["--garments", &file, "--keep", "outer", "-o", &out]).assert().success();
    let outfits = at(&folder, "outfits.toml");
    let text = format!(
        "[[outfit]]\nname = \"a\"\ngarments = [{{ file = \"thick.obj\", keep = \"outer\", unit = \"m\" }}, \"{SKIRT}\"]\n\
         [[outfit]]\nname = \"b\"\ngarments = [\"{SKIRT}\"]\n"
    );
    fs::write(&outfits, text).unwrap();
    let several = at(&folder, "several");
    drape(&["--outfits", &outfits, "-o", &several]).assert().success();
    for path in [Path::new(&out).join("thick.obj"), Path::new(&several).join("a/thick.obj")] {
        let draped = load_mesh(&path).unwrap();
        assert!(draped.polygons().eq(given.1.iter().map(Vec::as_slice)));
        let (outer, inner) = draped.positions.split_at(skirt.vertex_count());
        let mut apart: Vec<f64> = outer.iter().zip(inner).map(|(p, q)| norm(sub(*p, *q))).collect();
        apart.sort_by(f64::total_cmp);
        let (least, most) = (apart[apart.len() / 20], apart[apart.len() - 1]);
        assert!(least > 0.002 && most < 0.006, "{least} {most}");
    }
}

#[test]
fn quads_texture_groups_and_materials_come_back_and_train_as_the_triangles_do() {
    let folder = tempfile::tempdir().unwrap();
    // A waistband of quads, in centimetres with z up.
    let (around, rows) = (48, 8);
    let mut text = String::from("mtllib wool.mtl\no band\n");
    for row in 0..rows {
        for k in 0..around {
            let angle = f64::from(k) / f64::from(around) * std::f64::consts::TAU;
            let [x, y, z] = [24.0 * angle.sin(), 5.0 + 3.0 * f64::from(row), 20.0 * angle.cos()];
            text += &format!(
                "v {x:.4} {:.4} {y:.4}\nvt {:.3} {:.3}\n",
                -z,
                f64::from(k) / 48.0,
                f64::from(row) / 8.0
            );
        }
    }
    text += "vn 0 0 1\ng lower\nusemtl wool\n";
    for row in 0..rows - 1 {
        if row == 4 {
            text += "g upper\nusemtl linen\n";
        }
        for k in 0..around {
            let index = |r: i32, k: i32| r * around + k % around + 1;
            let corners = [index(row, k), index(row, k + 1), index(row + 1, k + 1), index(row + 1, k)];
            text += &format!("f {}\n", corners.map(|c| format!("{c}/{c}/1")).join(" "));
        }
    }
    let file = at(&folder, "band.obj");
    fs::write(&file, &text).unwrap();
    fs::write(at(&folder, "wool.mtl"), "newmtl wool\nKd 1 0 0\nnewmtl linen\nKd 0 1 0\n").unwrap();
    let (out, triangles) = (at(&folder, "out/fitted.obj"), at(&folder, "out/triangles.obj"));
    let hints = ["--category", "skirt", "--unit", "cm", "--up", "z"];
    clothcombo("fit").arg(&file).args(hints).args(["-o", &out]).assert().success();
    clothcombo("fit").arg(&file).args(hints).args(["--triangles", "-o", &triangles]).assert().success();
    let written = fs::read_to_string(&out).unwrap();
    let lines = |text: &str| -> Vec<String> {
        let kept = |line: &&str| ["f ", "vt", "g ", "us", "o "].iter().any(|key| line.starts_with(key));
        text.lines().filter(kept).map(|line| line.replace("/1 ", " ")).collect()
    };
    let expected = text.lines().map(|line| match line.strip_prefix("f ") {
        Some(corners) => {
            let corners = corners.split(' ').map(|corner| corner.strip_suffix("/1").unwrap());
            format!("f {}\n", corners.collect::<Vec<_>>().join(" "))
        }
        None => format!("{line}\n"),
    });
    assert_eq!(lines(&written), lines(&expected.collect::<String>()));
    assert!(written.contains("mtllib fitted.mtl") && fs::metadata(at(&folder, "out/fitted.mtl")).is_ok());
    let [one, other] = [&out, &triangles].map(|path| load_tri_mesh(Path::new(path)).unwrap());
    assert_eq!((one.positions(), one.faces()), (other.positions(), other.faces()));
    // What is fitted needs no fitting.
    clothcombo("check").arg(&out).assert().success();
    let again = clothcombo("fit").args([&out, "--json"]).output().unwrap();
    let again: Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!(
        (again["placement"]["unit"].as_str(), again["seams"].as_array().map(Vec::len)),
        (Some("m"), Some(0))
    );
    // The same again, and never over the garment's own materials.
    clothcombo("fit").arg(&file).args(hints).args(["-o", &out]).assert().success();
    let message = failure(clothcombo("fit").arg(&file).args(hints).args(["-o", &at(&folder, "wool.obj")]), 1);
    assert!(message.contains("wool.mtl") && !Path::new(&at(&folder, "wool.obj")).exists(), "{message}");
}

#[test]
fn unsewn_panels_are_named_and_joined_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let skirt = generated(&folder, "skirt");
    let (mut positions, mut polygons) = (Vec::new(), Vec::new());
    for side in [-1.0, 1.0] {
        let mut number = vec![None; skirt.vertex_count()];
        for face in skirt.faces() {
            let x: f64 = face.iter().map(|v| skirt.positions()[*v as usize][0]).sum();
            if (x >= 0.0) == (side > 0.0) {
                let corner = |v: u32| {
                    *number[v as usize].get_or_insert_with(|| {
                        let [x, y, z] = skirt.positions()[v as usize];
                        positions.push([x + 0.002 * side, y, z]);
                        positions.len() as u32 - 1
                    })
                };
                polygons.push(face.map(corner).to_vec());
            }
        }
    }
    let file = at(&folder, "panels.obj");
    save(&file, &(positions, polygons));
    let text = clothcombo("fit").arg(&file).output().unwrap().stdout;
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains("open      2 seams") && text.contains("--join-seams"), "{text}");
    let out = at(&folder, "joined.obj");
    clothcombo("fit").args([&file, "--join-seams", "5mm", "-o", &out]).assert().success();
    let joined = Topology::new(&load_tri_mesh(Path::new(&out)).unwrap());
    assert_eq!((joined.component_count, joined.boundary_loops.len()), (1, 2));
    let message = failure(clothcombo("fit").args([&file, "--join-seams", "5 feet"]), 2);
    assert!(message.contains("--join-seams") && message.contains("5mm"), "{message}");
}
