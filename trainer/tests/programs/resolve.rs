//! `clothcombo resolve`: what it writes, and what it says to files it cannot use.

use crate::common::{assert_fails, said};
use assert_cmd::Command;
use clothcombo_data::format::{ObjMesh, load_tri_mesh};
use clothcombo_physics::contact::TriangleTree;
use clothcombo_physics::mesh::shapes;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// A ball, and two quad tubes around it: the inner one cuts the ball, the outer one lies inside the inner one.
struct Case {
    folder: TempDir,
}

impl Case {
    fn new() -> Self {
        let case = Self { folder: tempfile::tempdir().unwrap() };
        let ball = shapes::icosphere(0.15, 3);
        let mut text = String::new();
        ball.positions().iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
        ball.faces().iter().for_each(|f| writeln!(text, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1).unwrap());
        case.write("body.obj", &text);
        case.write("tee.obj", &quad_tube(0.149, 40, 12));
        case.write("coat.obj", &quad_tube(0.1485, 36, 10));
        case.write("tube.mtl", "newmtl wool\nKd 1 0 0\n");
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

    fn command(&self, garments: &[&str], extra: &[&str]) -> Command {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.env("NO_COLOR", "1").current_dir(self.folder.path());
        command.args(["resolve", "--body", "body.obj", "--garments"]).args(garments).args(extra);
        command
    }

    /// Must exit with 1, write nothing and print one message that holds every one of `words`.
    fn must_fail(&self, garments: &[&str], extra: &[&str], words: &[&str]) {
        let output = self.command(garments, extra).output().unwrap();
        assert_fails(&output, 1, words);
        assert!(output.stdout.is_empty() && !self.path("resolved").exists());
        assert_eq!(said(&output).matches('×').count(), 1, "{}", said(&output));
    }
}

/// An open tube of quads with a texture coordinate and groups, as other programs write them.
fn quad_tube(radius: f64, around: usize, along: usize) -> String {
    let mut text = String::from("# quads\no tube\nmtllib tube.mtl\nvt 0.5 0.5\n");
    for ring in 0..=along {
        for step in 0..around {
            let angle = std::f64::consts::TAU * step as f64 / around as f64;
            let y = 0.2 * ring as f64 / along as f64 - 0.1;
            writeln!(text, "v {} {y} {} 1 0 0", radius * angle.sin(), radius * angle.cos()).unwrap();
        }
    }
    for ring in 0..along {
        writeln!(text, "g ring_{ring}").unwrap();
        for step in 0..around {
            let at = |ring: usize, step: usize| ring * around + step % around + 1;
            let corners = [at(ring, step), at(ring, step + 1), at(ring + 1, step + 1), at(ring + 1, step)];
            writeln!(text, "f {0}/1 {1}/1 {2}/1 {3}/1", corners[0], corners[1], corners[2], corners[3])
                .unwrap();
        }
    }
    text
}

#[test]
fn what_is_written_is_clear_and_has_the_topology_it_came_with() {
    let case = Case::new();
    let output = case.command(&["tee.obj", "coat.obj"], &["-o", "out", "--json"]).assert().success();
    let report: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let written: Value = serde_json::from_slice(&fs::read(case.path("out/report.json")).unwrap()).unwrap();
    assert_eq!(report, written);

    for key in [
        "body_triangle_pairs",
        "layer_triangle_pairs",
        "self_triangle_pairs",
        "contour_length_mm",
        "max_depth_mm",
    ] {
        assert_eq!(report["certificate"][key].as_f64(), Some(0.0), "{key}");
    }
    assert!(report["certificate_before"]["body_triangle_pairs"].as_u64().unwrap() > 0);
    assert!(report["certificate_before"]["order_violations"].as_f64().unwrap() > 0.9);
    assert!(report["before"]["garments"][0]["penetration"]["body_triangle_pairs"].as_u64().unwrap() > 0);
    assert_eq!(report["after"]["garments"][0]["penetration"]["body_triangle_pairs"].as_u64(), Some(0));
    assert_eq!(report["after"]["layers"][0]["triangle_pairs"].as_u64(), Some(0));

    // The files themselves, counted again.
    let load = |name: &str| load_tri_mesh(&case.path(name)).unwrap();
    let meshes = [load("body.obj"), load("out/tee.obj"), load("out/coat.obj")];
    let trees: Vec<_> = meshes.iter().map(|m| TriangleTree::new(m.positions(), m.faces())).collect();
    for (i, a) in trees.iter().enumerate() {
        assert!(trees[i + 1..].iter().all(|b| a.pairs_with(b).is_empty()));
    }
    for name in ["tee.obj", "coat.obj"] {
        let parse = |path: PathBuf| {
            let text = fs::read_to_string(&path).unwrap();
            let others: Vec<String> =
                text.lines().filter(|l| !l.starts_with("v ")).map(str::to_owned).collect();
            (ObjMesh::parse(&text, &path).unwrap(), others)
        };
        let (before, others_before) = parse(case.path(name));
        let (after, others_after) = parse(case.path("out").join(name));
        let name = name.trim_end_matches(".obj");
        let material_file = format!("{name}.mtl");
        assert!(others_before.iter().map(|l| l.replace("tube.mtl", &material_file)).eq(others_after));
        let mtl = fs::read_to_string(case.path("out").join(material_file)).unwrap();
        assert!(mtl.starts_with("newmtl wool\nKd 1 0 0\n"), "{mtl}");
        assert_eq!(before.polygons, after.polygons);
        assert_eq!(before.positions.len(), after.positions.len());
        assert_ne!(before.positions, after.positions);
    }
    // Before and after, three views each.
    let picture = image::open(case.path("out/picture.png")).unwrap();
    assert!(picture.width() > 900 && picture.height() > 1000, "{} x {}", picture.width(), picture.height());
    let layers = image::open(case.path("out/layers.png")).unwrap();
    assert_eq!((layers.width(), layers.height()), (picture.width(), picture.height()), "two garments");
    // The bottom and top rims lie off the ball, within reach of nothing: a second run changes nothing at all.
    case.command(&["out/tee.obj", "out/coat.obj"], &["-o", "again"]).assert().success();
    for name in ["tee.obj", "coat.obj"] {
        assert_eq!(load(&format!("out/{name}")).positions(), load(&format!("again/{name}")).positions());
    }
}

#[test]
fn without_time_what_is_there_is_returned_and_listed() {
    let case = Case::new();
    let output =
        case.command(&["tee.obj", "coat.obj"], &["--time-limit", "1e-9", "--json"]).assert().success();
    let report: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    let pairs = |of: &str| report[of]["body_triangle_pairs"].as_u64().unwrap();
    assert!(pairs("certificate") > 0 && pairs("certificate") <= pairs("certificate_before"), "{report}");
    assert!(case.path("resolved/coat.obj").exists());
    for wrong in ["0", "-1", "nan", "1e300", "soon"] {
        let flag = format!("--time-limit={wrong}");
        let output = case.command(&["tee.obj"], &[&flag]).output().unwrap();
        assert!(output.status.code() == Some(2), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("--time-limit"), "{output:?}");
    }
}

#[test]
fn pairs_that_are_left_come_with_a_hint() {
    let case = Case::new();
    // A sheet through the middle of the ball, which has no side to go to.
    let mut sheet = String::new();
    for i in 0..441 {
        writeln!(sheet, "v {} 0.001 {}", 0.03 * f64::from(i / 21 - 10), 0.03 * f64::from(i % 21 - 10))
            .unwrap();
    }
    for i in (0..420).filter(|i| i % 21 < 20) {
        writeln!(sheet, "f {} {} {} {}", i + 1, i + 2, i + 23, i + 22).unwrap();
    }
    case.write("sheet.obj", &sheet);
    let printed = |garment: &str, extra: &[&str]| {
        let output = case.command(&[garment], extra).assert().success();
        String::from_utf8_lossy(&output.get_output().stdout).into_owned()
    };
    let text = printed("sheet.obj", &["-o", "left"]);
    assert!(
        text.contains(" pairs left, listed in report.json; hint: another order of the garments"),
        "{text}"
    );
    let text = printed("sheet.obj", &["-o", "stopped", "--time-limit", "1e-9"]);
    assert!(
        text.contains("stopped after its budget") && text.contains("hint: a longer --time-limit"),
        "{text}"
    );
    assert!(!printed("tee.obj", &["-o", "clear"]).contains("hint"));
}

#[test]
fn strain_is_measured_against_the_rest_meshes() {
    let case = Case::new();
    case.write("rest/tee.obj", &quad_tube(0.14, 40, 12));
    let output = case.command(&["tee.obj"], &["--rest", "rest/tee.obj", "--json"]).assert().success();
    let report: Value = serde_json::from_slice(&output.get_output().stdout).unwrap();
    assert!(report["certificate"]["strain_added"].as_f64().is_some(), "{report}");
    assert!(case.path("resolved/tee.obj").exists());
}

#[test]
fn files_that_cannot_be_used_are_named() {
    let case = Case::new();
    case.must_fail(&["none.obj"], &[], &["none.obj"]);
    case.write("short.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    case.must_fail(&["tee.obj", "short.obj"], &[], &["short.obj:4", "vertex 9"]);
    case.must_fail(&["tee.obj", "coat.obj"], &["--rest", "tee.obj"], &["1 rest meshes", "2 garments"]);
    case.must_fail(&["tee.obj"], &["--rest", "coat.obj"], &["tee.obj", "coat.obj", "vertices"]);
    let output = case.command(&["tee.obj"], &["--gap", "51"]).output().unwrap();
    assert!(output.status.code() == Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("at most 50 mm"), "{output:?}");
    let output = case.command(&["tee.obj"], &["--gap", "-1"]).output().unwrap();
    assert!(output.status.code() == Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("greater than 0"), "{output:?}");
    let doubled = quad_tube(0.149, 40, 12);
    let face = doubled.lines().find(|line| line.starts_with("f ")).unwrap();
    // The same quad from another corner, and the other way round.
    let mut corners: Vec<&str> = face.split(' ').skip(1).collect();
    for reverse in [false, true] {
        corners.rotate_left(1);
        if reverse {
            corners.reverse();
        }
        case.write("doubled.obj", &format!("{doubled}f {}\n", corners.join(" ")));
        case.must_fail(&["tee.obj", "doubled.obj"], &[], &["doubled.obj", "of face", "clothcombo fit"]);
    }
    case.write("beside.obj", &with_vertices(&quad_tube(0.149, 40, 12), |[x, y, z]| [x + 2.0, y, z]));
    case.must_fail(&["beside.obj"], &[], &["beside.obj", "beside the body", "x from"]);
    case.write("large.obj", &with_vertices(&quad_tube(0.149, 40, 12), |p| p.map(|x| 1e3 * x)));
    case.must_fail(&["tee.obj", "large.obj"], &[], &["large.obj", "one unit"]);
    case.write("rest.obj", &with_vertices(&quad_tube(0.149, 40, 12), |p| p.map(|x| 1e3 * x)));
    case.write("tight.obj", &quad_tube(0.149, 40, 12));
    case.must_fail(&["tight.obj"], &["--rest", "rest.obj"], &["rest.obj", "tight.obj", "one unit"]);
    let body = fs::read_to_string(case.path("body.obj")).unwrap();
    case.write("body.obj", &with_vertices(&body, |p| p.map(|x| 1e3 * x)));
    case.must_fail(&["tee.obj"], &[], &["body.obj", "metres"]);
}

#[test]
fn a_body_that_is_inside_out_is_turned_and_names_are_told_apart() {
    let case = Case::new();
    case.command(&["tee.obj"], &["-o", "right"]).assert().success();
    let body = fs::read_to_string(case.path("body.obj")).unwrap();
    let turned: Vec<String> = body
        .lines()
        .map(|line| match line.split(' ').collect::<Vec<_>>()[..] {
            ["f", a, b, c] => format!("f {a} {c} {b}"),
            _ => line.to_owned(),
        })
        .collect();
    case.write("body.obj", &turned.join("\n"));
    let said = case.command(&["tee.obj"], &["-o", "turned"]).assert().success();
    assert!(String::from_utf8_lossy(&said.get_output().stderr).contains("inside out"));
    let read = |name: &str| fs::read(case.path(name)).unwrap();
    assert!(read("right/tee.obj") == read("turned/tee.obj"));

    // The third one must not become the file of the first.
    case.write("a/tee.obj", &quad_tube(0.16, 40, 12));
    case.write("tee-2.obj", &quad_tube(0.17, 36, 12));
    case.command(&["tee.obj", "tee-2.obj", "a/tee.obj"], &["-o", "three"]).assert().success();
    let mut files: Vec<_> = fs::read_dir(case.path("three"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    let meshes = ["tee-2.mtl", "tee-2.obj", "tee-3.obj", "tee.mtl", "tee.obj"];
    assert_eq!(
        files,
        [[".clothcombo-files", "layers.png", "picture.png", "report.json"].as_slice(), &meshes].concat()
    );
}

#[test]
fn nothing_is_written_over() {
    let case = Case::new();
    let before = fs::read(case.path("tee.obj")).unwrap();
    case.must_fail(&["tee.obj"], &["-o", "."], &["names no new folder"]);
    case.must_fail(&["tee.obj"], &["-o", "../elsewhere/..", "--replace"], &["names no new folder"]);
    case.command(&["tee.obj"], &["-o", "out"]).assert().success();
    case.must_fail(&["coat.obj"], &["-o", "out"], &["out is there", "--replace"]);
    case.must_fail(&["out/tee.obj"], &["-o", "out", "--replace"], &["out/tee.obj in it is read"]);
    case.command(&["coat.obj"], &["-o", "out", "--replace"]).assert().success();
    assert!(!case.path("out/tee.obj").exists() && case.path("out/coat.obj").exists());
    assert!(fs::read(case.path("tee.obj")).unwrap() == before);
}

/// An OBJ text with other vertex positions.
fn with_vertices(text: &str, change: impl Fn([f64; 3]) -> [f64; 3]) -> String {
    let line = |line: &str| match line.strip_prefix("v ") {
        Some(numbers) => {
            let numbers: Vec<f64> = numbers.split(' ').map(|x| x.parse().unwrap()).collect();
            let [x, y, z] = change([numbers[0], numbers[1], numbers[2]]);
            format!("v {x} {y} {z}\n")
        }
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}
