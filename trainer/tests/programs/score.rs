//! `clothcombo score`: the shape of its answer, and what it says to meshes that cannot be scored.

use crate::common::{assert_fails, said};
use assert_cmd::Command;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// A folder with a body and two open boxes of quads around it, as other programs would write them.
struct Case {
    folder: TempDir,
}

/// A box without lid and floor, `half` wide to each side, with texture coordinates.
fn quad_box(half: f64, y: [f64; 2]) -> String {
    let mut text = String::from("# quads\no box\nvt 0 0\n");
    for y in y {
        for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            text += &format!("v {} {y} {}\n", half * x, half * z);
        }
    }
    for k in 0..4 {
        let next = (k + 1) % 4;
        text += &format!("f {}/1 {}/1 {}/1 {}/1\n", k + 5, next + 5, next + 1, k + 1);
    }
    text
}

impl Case {
    fn new() -> Self {
        let case = Self { folder: tempfile::tempdir().unwrap() };
        case.write("body.obj", &(quad_box(0.1, [-0.4, 0.4]) + "f 8 7 6 5\nf 1 2 3 4\n"));
        for kind in ["rest", "draped"] {
            case.write(&format!("{kind}/tee.obj"), &quad_box(0.12, [-0.2, 0.2]));
            case.write(&format!("{kind}/coat.obj"), &quad_box(0.15, [-0.2, 0.3]));
        }
        case
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    fn command(&self, rest: &[&str], draped: &[&str], extra: &[&str]) -> Command {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.env("NO_COLOR", "1").current_dir(self.folder.path());
        command.args(["score", "--body", "body.obj", "--rest"]).args(rest);
        command.arg("--draped").args(draped).args(extra);
        command
    }

    /// The answer for the outfit as it is.
    fn score(&self, extra: &[&str]) -> Value {
        let files = |kind: &str| ["tee", "coat"].map(|name| format!("{kind}/{name}.obj"));
        let (rest, draped) = (files("rest"), files("draped"));
        let mut command =
            self.command(&rest.each_ref().map(|f| &**f), &draped.each_ref().map(|f| &**f), &["--json"]);
        let output = command.args(extra).assert().success().get_output().clone();
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// Scores the tee; must exit with 1, print nothing on stdout and one message that holds every one of `words`.
    fn must_fail(&self, rest: &[&str], draped: &[&str], words: &[&str]) {
        let output = self.command(rest, draped, &[]).output().unwrap();
        assert_fails(&output, 1, words);
        assert!(output.stdout.is_empty());
        assert_eq!(said(&output).matches('×').count(), 1, "{}", said(&output));
    }
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn json_has_the_documented_shape_and_quads_are_scored() {
    let case = Case::new();
    let score = case.score(&[]);
    assert_eq!(keys(&score), BTreeSet::from(["settings", "body", "garments", "layers"]));
    assert_eq!(score["settings"], serde_json::json!({ "epsilon_mm": 2.0, "distance": "nearest_vertex" }));
    assert_eq!(score["body"], serde_json::json!({ "self_triangle_pairs": 0 }));
    let terms = BTreeSet::from(["strain", "bending", "gravity", "body_collision", "repulsion"]);
    let garments = score["garments"].as_array().unwrap();
    assert_eq!(garments.len(), 2);
    for (garment, name) in garments.iter().zip(["tee", "coat"]) {
        let expected = BTreeSet::from(["name", "vertices", "triangles", "raw", "weighted", "penetration"]);
        assert_eq!(keys(garment), expected);
        assert_eq!(garment["name"], name);
        assert_eq!((garment["vertices"].as_u64(), garment["triangles"].as_u64()), (Some(8), Some(8)));
        assert_eq!((keys(&garment["raw"]), keys(&garment["weighted"])), (terms.clone(), terms.clone()));
        assert_eq!(
            keys(&garment["penetration"]),
            BTreeSet::from(["vertices_inside", "max_depth_mm", "body_triangle_pairs", "self_triangle_pairs"])
        );
        for term in &terms {
            assert!(garment["raw"][term].is_f64() && garment["weighted"][term].is_f64(), "{term}");
        }
    }
    assert!(garments[0]["raw"]["strain"].as_f64().unwrap() < 1e-20);
    let layers = score["layers"].as_array().unwrap();
    assert_eq!(layers.len(), 1);
    assert_eq!(
        keys(&layers[0]),
        BTreeSet::from([
            "inner",
            "outer",
            "layer_collision",
            "layer_distance",
            "triangle_pairs",
            "order_violations_nearest_vertex"
        ])
    );
    assert_eq!((layers[0]["inner"].as_u64(), layers[0]["outer"].as_u64()), (Some(0), Some(1)));
}

#[test]
fn a_garment_pushed_into_the_body_is_seen_in_every_number() {
    let case = Case::new();
    // One corner 20 mm inside, the opposite one far out: coordinates in a box of half width 120 mm.
    case.write(
        "draped/tee.obj",
        &quad_box(0.12, [-0.2, 0.2]).replacen("v -0.12 -0.2 -0.12", "v -0.08 -0.2 -0.08", 1),
    );
    let score = case.score(&["--surface"]);
    assert_eq!(score["settings"]["distance"], "surface");
    let tee = &score["garments"][0];
    assert_eq!(tee["penetration"]["vertices_inside"], 1.0 / 8.0);
    assert!((tee["penetration"]["max_depth_mm"].as_f64().unwrap() - 20.0).abs() < 1e-9);
    assert!(tee["penetration"]["body_triangle_pairs"].as_u64().unwrap() > 0);
    assert!((tee["raw"]["body_collision"].as_f64().unwrap() - 0.022f64.powi(3)).abs() < 1e-15);
    let weighted = tee["weighted"]["body_collision"].as_f64().unwrap();
    assert!((weighted - 250.0 * 0.022f64.powi(3)).abs() < 1e-12);
    assert!(tee["raw"]["strain"].as_f64().unwrap() > 0.0);
    assert_eq!(score["garments"][1]["penetration"]["vertices_inside"], 0.0);
}

#[test]
fn without_json_there_are_tables_with_units() {
    let case = Case::new();
    let output = case
        .command(&["rest/tee.obj", "rest/coat.obj"], &["draped/tee.obj", "draped/coat.obj"], &[])
        .assert()
        .success()
        .get_output()
        .clone();
    let text = String::from_utf8(output.stdout).unwrap();
    for word in ["strain [J]", "collision [m³]", "depth [mm]", "inside [%]", "tee under coat", "all"] {
        assert!(text.contains(word), "{word} is missing in:\n{text}");
    }
}

#[test]
fn meshes_that_do_not_fit_together_are_both_named_with_their_counts() {
    let case = Case::new();
    let more = quad_box(0.12, [-0.2, 0.2]) + "v 0 0 0\nf 1 2 9\n";
    case.write("draped/more.obj", &more);
    case.must_fail(
        &["rest/tee.obj"],
        &["draped/more.obj"],
        &["rest/tee.obj has 8", "draped/more.obj has 9 vertices and 9 triangles"],
    );
    let turned = quad_box(0.12, [-0.2, 0.2]).replacen("f 5/1 6/1 2/1 1/1", "f 6/1 2/1 1/1 5/1", 1);
    case.write("draped/turned.obj", &turned);
    case.must_fail(
        &["rest/tee.obj"],
        &["draped/turned.obj"],
        &["face 0", "rest/tee.obj", "draped/turned.obj (8 vertices, 8 triangles)"],
    );
}

#[test]
fn a_rest_mesh_without_its_draped_one() {
    let case = Case::new();
    case.must_fail(
        &["rest/tee.obj", "rest/coat.obj"],
        &["draped/tee.obj"],
        &["2 rest meshes", "1 draped", "--draped"],
    );
}

#[test]
fn files_that_cannot_be_read_are_named_with_the_line() {
    let case = Case::new();
    case.must_fail(&["rest/tee.obj"], &["draped/nowhere.obj"], &["draped/nowhere.obj"]);
    let tee = quad_box(0.12, [-0.2, 0.2]);
    for (name, broken, words) in [
        ("nan", tee.replacen("v 0.12", "v NaN", 1), ["draped/nan.obj:5", "finite"]),
        ("index", tee.replacen("f 5/1", "f 99/1", 1), ["draped/index.obj:12", "vertex 99"]),
        ("text", tee.replacen("f 5/1", "f five", 1), ["draped/text.obj:12", "five"]),
        ("points", tee.replace("f ", "# "), ["draped/points.obj", "no faces"]),
    ] {
        case.write(&format!("draped/{name}.obj"), &broken);
        case.must_fail(&["rest/tee.obj"], &[&format!("draped/{name}.obj")], &words);
    }
    let flat = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n";
    case.write("rest/flat.obj", flat);
    case.write("draped/flat.obj", flat);
    case.must_fail(&["rest/flat.obj"], &["draped/flat.obj"], &["flat", "no area"]);
    for kind in ["rest", "draped"] {
        case.write(&format!("{kind}/doubled.obj"), &(quad_box(0.12, [-0.2, 0.2]) + "f 2 1 5\n"));
    }
    case.must_fail(
        &["rest/doubled.obj"],
        &["draped/doubled.obj"],
        &["'doubled'", "has the vertices of face", "clothcombo fit"],
    );
}

#[test]
fn meshes_in_another_unit_or_place_are_refused() {
    let case = Case::new();
    case.write("rest/large.obj", &quad_box(120.0, [-200.0, 200.0]));
    case.write("draped/large.obj", &quad_box(120.0, [-200.0, 200.0]));
    case.must_fail(&["rest/large.obj"], &["draped/large.obj"], &["draped/large.obj", "one unit"]);
    case.must_fail(
        &["rest/large.obj"],
        &["draped/tee.obj"],
        &["rest/large.obj", "draped/tee.obj", "one unit"],
    );
    case.write("draped/above.obj", &quad_box(0.12, [9.8, 10.2]));
    case.must_fail(
        &["rest/tee.obj"],
        &["draped/above.obj"],
        &["draped/above.obj", "beside the body: y from 9.8"],
    );
}

#[test]
fn usage_errors_exit_with_two() {
    Command::cargo_bin("clothcombo").unwrap().args(["score", "--body", "b.obj"]).assert().code(2);
}
