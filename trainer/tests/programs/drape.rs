//! `clothcombo drape` as a user runs it: a model of a few steps on the mannequin, garments from files and by name, every output
//! read back.

use crate::common::with_small_networks;
use assert_cmd::Command;
use clothcombo_data::asset::{Motion, Pose, Provenance};
use clothcombo_data::format::{load_mesh, load_tri_mesh, obj};
use clothcombo_data::generate::mannequin;
use clothcombo_physics::contact::triangle_pairs;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

const CONFIG: &str = r#"
seed = 1
[data]
[[data.garments]]
generate = { count = 3, seed = 5, vertices = 250, categories = ["t_shirt", "skirt", "top"] }
[[stages]]
name = "all"
trains = "all"
steps = 3
layers = [2, 3]
learning_rate = 1e-4
[validation]
single_scenes = 1
layered_scenes = 1
layers = [2, 2]
[output]
sample_scenes = 1
"#;

/// Names of the garments the model was trained on.
pub const TEE: &str = "t_shirt_000005";
pub const SKIRT: &str = "skirt_000006";

/// A run of a few steps, made once for all tests.
pub fn run_folder() -> &'static Path {
    static RUN: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, run) = RUN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("config.toml");
        fs::write(&config, with_small_networks(CONFIG)).unwrap();
        let run = folder.path().join("run");
        let train = Command::cargo_bin("clothcombo-train")
            .unwrap()
            .args(["--quiet", "--config"])
            .arg(&config)
            .arg("--run-dir")
            .arg(&run)
            .output()
            .unwrap();
        assert!(train.status.success(), "{}", String::from_utf8_lossy(&train.stderr));
        (folder, run)
    });
    run
}

/// `clothcombo drape` with the model; a cache only where a test names one.
pub fn drape(arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.env("NO_COLOR", "1").args(["drape", "--checkpoint"]).arg(run_folder()).args(arguments);
    if !arguments.contains(&"--cache") {
        command.arg("--no-cache");
    }
    command
}

/// What a failing command said, on one line.
pub fn failure(command: &mut Command, code: i32) -> String {
    let output = command.output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", "");
    assert_eq!(output.status.code(), Some(code), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    message.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ")
}

pub fn report(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap()
}

pub fn at(folder: &TempDir, name: &str) -> String {
    folder.path().join(name).display().to_string()
}

/// A motion of the arms coming down while the body turns.
pub fn save_motion(path: &Path, frames: usize) {
    let poses = (0..frames).map(|f| {
        let share = f as f64 / (frames - 1) as f64;
        let mut pose = Pose::t_pose(22);
        pose.rotations[0] = [0.0, 0.8 * share, 0.0];
        pose.rotations[16] = [0.0, 0.0, -0.4 * share];
        pose.rotations[17] = [0.0, 0.0, 0.4 * share];
        pose
    });
    let motion = Motion {
        name: "arms".into(),
        frame_rate: 10.0,
        poses: poses.collect(),
        source: Provenance::default(),
    };
    motion.save(path).unwrap();
}

/// An open tube of quads with texture coordinates and normals around the mannequin's waist.
fn quad_band(path: &Path) {
    let (around, rows) = (40u32, 9u32);
    let mut positions = Vec::new();
    for row in 0..rows {
        for k in 0..around {
            let angle = f64::from(k) / f64::from(around) * std::f64::consts::TAU;
            positions.push([0.22 * angle.sin(), 0.02 + 0.03 * f64::from(row), 0.19 * angle.cos()]);
        }
    }
    let mut quads = Vec::new();
    for row in 0..rows - 1 {
        for k in 0..around {
            let index = |r: u32, k: u32| r * around + k % around;
            quads.push([index(row, k), index(row, k + 1), index(row + 1, k + 1), index(row + 1, k)]);
        }
    }
    obj::save_polygons(path, &positions, quads.iter().map(|q| q.as_slice()), &[]).unwrap();
    let text = fs::read_to_string(path).unwrap();
    let mut full = String::from("vt 0.5 0.25\nvn 0 0 1\n");
    for line in text.lines() {
        match line.strip_prefix("f ") {
            Some(corners) => {
                let corners: Vec<String> = corners.split(' ').map(|c| format!("{c}/1/1")).collect();
                full += &format!("f {}\n", corners.join(" "));
            }
            None => full += &format!("{line}\n"),
        }
    }
    fs::write(path, full).unwrap();
}

#[test]
fn a_posed_outfit_leaves_every_output_and_each_reads_back() {
    let folder = tempfile::tempdir().unwrap();
    let (band, motion, out) = (at(&folder, "band.obj"), at(&folder, "arms.npz"), at(&folder, "out"));
    quad_band(Path::new(&band));
    save_motion(Path::new(&motion), 5);
    let pose = format!("{motion}:4");
    let arguments = ["--garments", SKIRT, TEE, &band, "--pose", &pose, "--shape", "1.0,-0.5", "-o", &out];
    let output = drape(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(table.contains("certificate:") && table.contains(TEE) && table.contains("networks"), "{table}");

    let out = Path::new(&out);
    let given = load_mesh(Path::new(&band)).unwrap();
    let draped = load_mesh(&out.join("band.obj")).unwrap();
    assert_eq!(draped.positions.len(), given.positions.len());
    assert!(draped.polygons().eq(given.polygons()), "quads stay quads, in their order");
    assert!(draped.polygons().all(|p| p.len() == 4));
    let text = fs::read_to_string(out.join("band.obj")).unwrap();
    assert!(
        text.contains("\nvt 0.5 0.25\n") && text.contains("\nf 1/1 2/1 42/1 41/1\n"),
        "texture coordinates stay"
    );
    assert!(!text.contains("\nvn "), "normals of another shape do not");

    // The scene holds body and garments at the places of the OBJ files.
    let body = load_tri_mesh(&out.join("body.obj")).unwrap();
    let garments: Vec<_> =
        [SKIRT, TEE, "band"].iter().map(|n| load_tri_mesh(&out.join(format!("{n}.obj"))).unwrap()).collect();
    let scene = load_mesh(&out.join("scene.glb")).unwrap();
    let written = body.positions().iter().chain(garments.iter().flat_map(|g| g.positions()));
    assert_eq!(scene.positions.len(), written.clone().count());
    for (a, b) in scene.positions.iter().flatten().zip(written.flatten()) {
        assert_eq!(*a, f64::from(*b as f32));
    }

    let report = report(out);
    let names: Vec<_> =
        report["garments"].as_array().unwrap().iter().map(|g| g["name"].as_str().unwrap()).collect();
    assert_eq!(names, [SKIRT, TEE, "band"]);
    for phase in ["embedding", "networks", "resolve"] {
        let all = report["milliseconds"][phase].as_f64().unwrap();
        let parts = report["garments"].as_array().unwrap().iter();
        let sum: f64 = parts.map(|g| g["milliseconds"][phase].as_f64().unwrap()).sum();
        assert!(
            all > 0.0 && (all - sum).abs() < 1e-9 * all,
            "{phase}: {all} ms of all, {sum} ms of the garments"
        );
    }
    for score in ["before", "after"] {
        assert!(report[score]["garments"][1]["raw"]["strain"].as_f64().is_some_and(f64::is_finite));
    }
    // The certificate says of the files what another count says of them.
    let count = |key: &str| report["certificate"][key].as_u64().unwrap() as usize;
    let with_body: usize = garments
        .iter()
        .map(|g| triangle_pairs(g.positions(), g.faces(), body.positions(), body.faces()).len())
        .sum();
    let mut between = 0;
    for (i, inner) in garments.iter().enumerate() {
        for outer in &garments[i + 1..] {
            between +=
                triangle_pairs(inner.positions(), inner.faces(), outer.positions(), outer.faces()).len();
        }
    }
    let pinched = |key: &str| report["certificate"]["pinched"][key].as_u64().unwrap() as usize;
    assert_eq!(count("body_triangle_pairs") + pinched("body_triangle_pairs"), with_body);
    assert_eq!(count("layer_triangle_pairs") + pinched("layer_triangle_pairs"), between);
    for certificate in ["certificate", "certificate_before"] {
        let pairs = report[certificate]["layers"].as_array().unwrap().iter();
        let sum: u64 = pairs.map(|pair| pair["triangle_pairs"].as_u64().unwrap()).sum();
        assert_eq!(Some(sum), report[certificate]["layer_triangle_pairs"].as_u64(), "{certificate}");
    }
    assert_eq!(
        count("body_triangle_pairs") + count("layer_triangle_pairs"),
        0,
        "a mild pose comes out clear"
    );

    let picture = image::open(out.join("picture.png")).unwrap().to_rgb8();
    let ground = *picture.get_pixel(1, 1);
    assert!(picture.pixels().filter(|p| **p != ground).count() > 20_000);
    let layers = image::open(out.join("layers.png")).unwrap();
    assert!(layers.height() > picture.height() + 1000, "each of the three garments has a row");
    let page = fs::read_to_string(out.join("viewer.html")).unwrap();
    assert!(!page.contains("http:") && !page.contains("https:"), "the page loads nothing");
    assert!(page.contains(TEE) && page.len() > 200_000);
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|n| !n.to_string_lossy().ends_with(".tmp")), "{left:?}");
}

#[test]
fn the_order_decides_who_wears_what_and_an_embedding_is_made_once() {
    let folder = tempfile::tempdir().unwrap();
    let cache = at(&folder, "cache");
    let run = |order: &str, out: &str| {
        let out = at(&folder, out);
        let arguments = ["--garments", TEE, SKIRT, "--order", order, "--cache", &cache, "-o", &out];
        drape(&arguments).assert().success();
        report(Path::new(&out))
    };
    let (first, second) = (run("1,0", "a"), run("0,1", "b"));
    let names = |r: &Value| [0, 1].map(|i| r["garments"][i]["name"].as_str().unwrap().to_owned());
    assert_eq!(names(&first), [SKIRT, TEE]);
    assert_eq!(names(&second), [TEE, SKIRT]);
    let known = |r: &Value| [0, 1].map(|i| r["garments"][i]["embedding_known"].as_bool().unwrap());
    assert_eq!((known(&first), known(&second)), ([false; 2], [true; 2]));
    // What the cache gives back is what was computed: the same order gives the same bytes.
    run("1,0", "c");
    for file in [format!("{TEE}.obj"), format!("{SKIRT}.obj"), "scene.glb".into()] {
        let [a, c] = ["a", "c"].map(|f| fs::read(folder.path().join(f).join(&file)).unwrap());
        assert!(a == c, "{file}");
    }
}

#[test]
fn a_motion_is_one_animated_scene() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, out) = (at(&folder, "arms.npz"), at(&folder, "out"));
    save_motion(Path::new(&motion), 8);
    let range = ["--frames", "1..8", "--every", "2", "--smooth", "1", "--all-frames"];
    let arguments = ["--garments", TEE, "--motion", &motion, "-o", &out];
    drape(&[&arguments[..], &range[..]].concat()).assert().success();
    let out = Path::new(&out);
    let report = report(out);
    let frames: Vec<_> =
        report["frames"].as_array().unwrap().iter().map(|f| f["frame"].as_u64().unwrap()).collect();
    assert_eq!(frames, [1, 3, 5, 7]);
    assert_eq!(report["scored_frame"], 1, "scores are of one frame, and say so");
    let smoothing = &report["smoothing"];
    let sum: u64 = ["whole", "partly", "left"].iter().map(|k| smoothing[k].as_u64().unwrap()).sum();
    assert_eq!(sum, 4);
    assert!(report["acceleration"]["ratio"].as_f64().is_some_and(|ratio| ratio > 0.0 && ratio.is_finite()));

    let glb = fs::read(out.join("scene.glb")).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let document: Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    for mesh in document["meshes"].as_array().unwrap() {
        assert_eq!(mesh["primitives"][0]["targets"].as_array().unwrap().len(), 3);
    }
    let input = document["animations"][0]["samplers"][0]["input"].as_u64().unwrap() as usize;
    assert_eq!(document["accessors"][input]["count"], 4);
    assert!((document["accessors"][input]["max"][0].as_f64().unwrap() - 0.6).abs() < 1e-6, "0.2 s a frame");

    // Point caches have the vertices of the OBJ files, frame by frame.
    let mdd = fs::read(out.join(format!("{TEE}.mdd"))).unwrap();
    let words: Vec<[u8; 4]> = mdd.as_chunks::<4>().0.to_vec();
    let [frames, points] = [0, 1].map(|i| i32::from_be_bytes(words[i]) as usize);
    let numbers: Vec<f32> = words[2..].iter().map(|word| f32::from_be_bytes(*word)).collect();
    assert_eq!((frames, numbers.len()), (4, 4 + 12 * points));
    assert_eq!(fs::metadata(out.join(format!("{TEE}.pc2"))).unwrap().len() as usize, 32 + 48 * points);

    for (number, frame) in [1, 3, 5, 7].into_iter().enumerate() {
        let mesh = load_tri_mesh(&out.join(format!("frames/{frame:05}/{TEE}.obj"))).unwrap();
        let cached = &numbers[4 + 3 * points * number..][..3 * points];
        let written = mesh.positions().as_flattened();
        assert!(cached.iter().zip(written).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-6));
        let body = load_tri_mesh(&out.join(format!("frames/{frame:05}/body.obj"))).unwrap();
        assert!(triangle_pairs(mesh.positions(), mesh.faces(), body.positions(), body.faces()).is_empty());
    }
}

#[test]
fn a_batch_of_outfits_embeds_each_garment_once() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (at(&folder, "outfits.toml"), at(&folder, "out"));
    let text = format!(
        "[[outfit]]\nname = \"one\"\ngarments = [\"{TEE}\"]\n\
         [[outfit]]\nname = \"two\"\ngarments = [\"{SKIRT}\", \"{TEE}\"]\nshape = [1.5]\n"
    );
    fs::write(&file, text).unwrap();
    drape(&["--outfits", &file, "-o", &out]).assert().success();
    let (one, two) = (report(&Path::new(&out).join("one")), report(&Path::new(&out).join("two")));
    assert_eq!(one["garments"][0]["embedding_known"], false);
    assert_eq!(two["garments"][0]["embedding_known"], false);
    assert_eq!(two["garments"][1]["embedding_known"], true);
    assert_eq!(two["body"]["shape"], serde_json::json!([1.5]));
    assert_eq!(report(Path::new(&out))["outfits"].as_array().unwrap().len(), 2);
}

#[test]
fn a_posed_mesh_of_the_body_is_dressed_where_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    let body = mannequin();
    let mut pose = Pose::t_pose(22);
    pose.rotations[0] = [0.0, 2.0, 0.0];
    pose.rotations[16] = [0.0, 0.0, -0.8];
    let moved = |p: &[f64; 3]| [p[0] + 4.0, p[1] + 0.9, p[2] - 1.0];
    let posed: Vec<[f64; 3]> = body.posed(&[0.5], &pose).unwrap().positions.iter().map(moved).collect();
    let rest = body.shaped(&[0.5]).unwrap().positions;
    let (posed_file, rest_file, out) = (at(&folder, "posed.obj"), at(&folder, "t.obj"), at(&folder, "out"));
    obj::save(Path::new(&posed_file), &posed, &body.faces, &[]).unwrap();
    obj::save(Path::new(&rest_file), &rest, &body.faces, &[]).unwrap();
    drape(&["--garments", TEE, "--posed", &posed_file, "--t-pose", &rest_file, "-o", &out])
        .assert()
        .success();
    let out = Path::new(&out);
    let written = load_tri_mesh(&out.join("body.obj")).unwrap();
    for (a, b) in written.positions().iter().flatten().zip(posed.iter().flatten()) {
        assert!((a - b).abs() < 1e-6);
    }
    let tee = load_tri_mesh(&out.join(format!("{TEE}.obj"))).unwrap();
    assert!(tee.positions().iter().all(|p| (p[0] - 4.0).abs() < 1.0 && (p[2] + 1.0).abs() < 1.0));
    assert!(triangle_pairs(tee.positions(), tee.faces(), written.positions(), written.faces()).is_empty());
    assert!(report(out)["body"]["recovered_within_mm"].as_f64().unwrap() < 3.0);
}
