//! Data that cannot be trained on ends the start with one table, before anything is made.

use crate::common::{assert_fails, clothcombo, said, with_small_networks};
use clothcombo_data::asset::{Motion, Pose, Provenance};
use clothcombo_data::format::{load_tri_mesh, obj};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const CONFIG: &str = "seed = 1\n[data]\ncache = { folder = \"CACHE\" }\n[[data.garments]]\nfolder = \"GARMENTS\"\n\
    [data.poses]\nmotions = \"MOTIONS\"\nvalidation_clips = [\"second\"]\nmax_self_intersection = 10.0\n[[stages]]\n\
    name = \"single\"\ntrains = \"single\"\nsteps = 1\n[validation]\nsingle_scenes = 1\nlayered_scenes = 0\n\
    [output]\nsample_scenes = 0\n";

/// Two garments and two clips, and a configuration that names them.
fn dataset(folder: &Path) -> PathBuf {
    let garments = folder.join("garments");
    let made = clothcombo(&[
        "generate",
        "--count",
        "2",
        "--seed",
        "7",
        "--vertices",
        "250",
        "--categories",
        "t_shirt,skirt",
        "-o",
        &garments.display().to_string(),
    ]);
    assert!(made.status.success(), "{}", said(&made));
    for (name, seconds) in [("first", 20), ("second", 4)] {
        motion(folder, name, 10 * seconds);
    }
    let mut text = with_small_networks(CONFIG);
    for (key, name) in [("GARMENTS", "garments"), ("MOTIONS", "motions"), ("CACHE", "cache")] {
        text = text.replace(key, &folder.join(name).display().to_string());
    }
    let config = folder.join("config.toml");
    std::fs::write(&config, text).unwrap();
    config
}

fn motion(folder: &Path, name: &str, frames: usize) {
    let motion = Motion {
        name: String::new(),
        frame_rate: 10.0,
        poses: vec![Pose::t_pose(22); frames],
        source: Provenance::default(),
    };
    motion.save(&folder.join("motions").join(name).with_extension("npz")).unwrap();
}

/// Writes garment `from` of `folder` again as `to`, changed, and lists it.
fn changed(folder: &Path, from: &str, to: &str, change: impl Fn([f64; 3]) -> [f64; 3], turned: bool) {
    let garments = folder.join("garments");
    let mesh = load_tri_mesh(&garments.join(from)).unwrap();
    let mesh = if turned { mesh.turned() } else { mesh };
    let positions: Vec<_> = mesh.positions().iter().map(|p| change(*p)).collect();
    obj::save(&garments.join(to), &positions, mesh.faces(), &[]).unwrap();
    let manifest = garments.join("garments.toml");
    let text = std::fs::read_to_string(&manifest).unwrap();
    std::fs::write(manifest, format!("{text}\n[[garment]]\nfile = {to:?}\n")).unwrap();
}

#[test]
fn files_lie_beside_the_configuration_or_are_named_with_their_key() {
    let folder = tempfile::tempdir().unwrap();
    let config = dataset(folder.path());
    let place = folder.path().display().to_string();
    let text = std::fs::read_to_string(&config).unwrap().replace(&format!("{place}/garments"), "garments");
    std::fs::write(&config, text.replace(&format!("{place}/motions"), "motions")).unwrap();
    let elsewhere = tempfile::tempdir().unwrap();
    let train = |run: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
        let command =
            command.arg("--config").arg(&config).args(["--run-dir", run, "--quiet"]).env("NO_COLOR", "1");
        command.current_dir(elsewhere.path()).output().unwrap()
    };
    let output = train("run");
    assert!(output.status.success(), "{}", said(&output));
    // The run goes on from anywhere.
    let mut resume = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
    let run = elsewhere.path().join("run");
    let output = resume.arg("--resume").arg(&run).arg("--quiet").current_dir("/").output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    std::fs::rename(folder.path().join("motions"), folder.path().join("moved")).unwrap();
    let place = elsewhere.path().canonicalize().unwrap().display().to_string();
    assert_fails(
        &train("other"),
        1,
        &["data.poses.motions = \"motions\"", "beside the configuration", &place],
    );
    let check = clothcombo(&["config", "check", &config.display().to_string()]);
    assert_fails(&check, 1, &["data.poses.motions = \"motions\"", "beside the configuration"]);
}

fn train(config: &Path, run: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
    command.arg("--config").arg(config).arg("--run-dir").arg(run).env("NO_COLOR", "1").output().unwrap()
}

#[test]
fn all_that_is_wrong_stands_in_one_table_and_nothing_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let config = dataset(folder.path());
    let tee = "t_shirt_000007.obj";
    changed(folder.path(), tee, "centimetres.obj", |p| p.map(|x| 100.0 * x), false);
    changed(folder.path(), tee, "low.obj", |[x, y, z]| [x, y - 0.235, z], false);
    changed(folder.path(), tee, "beside.obj", |[x, y, z]| [x, y, z + 3.0], false);
    changed(folder.path(), tee, "inside_out.obj", |p| p, true);
    changed(folder.path(), tee, "doubled.obj", |p| p, false);
    let doubled = folder.path().join("garments/doubled.obj");
    let text = std::fs::read_to_string(&doubled).unwrap();
    let face = text.lines().find(|line| line.starts_with("f ")).unwrap();
    std::fs::write(&doubled, format!("{text}{face}\n")).unwrap();
    changed(folder.path(), tee, "broken.obj", |p| p, false);
    std::fs::write(folder.path().join("garments/broken.obj"), "v 0 0 0\nv 1 0 nan\n").unwrap();
    motion(folder.path(), "still", 1);
    std::fs::write(folder.path().join("motions/cut.npz"), "PK").unwrap();
    let run = folder.path().join("deep/runs/run");
    let output = train(&config, &run);
    assert_fails(&output, 1, &["8 of 12 files of the data cannot be trained on"]);
    let message = said(&output);
    for (name, word) in [
        ("centimetres ", "not in metres"),
        ("low ", "% of its vertices lie inside"),
        ("beside ", "away from body 'mannequin'"),
        ("inside_out ", "inside out"),
        ("doubled ", "has the vertices of an earlier one"),
        ("broken ", "line 2: vertex coordinate"),
        ("still ", "single frame"),
        ("cut ", "cut.npz"),
    ] {
        let line = message.lines().find(|line| line.starts_with(name));
        assert!(line.is_some_and(|line| line.contains(word)), "{name}{word} is missing in\n{message}");
    }
    assert!(message.contains("clothcombo fit") && message.contains("--body mannequin"), "{message}");
    assert!(!message.contains("t_shirt_000007 "), "{message}");
    assert!(!folder.path().join("deep").exists() && !folder.path().join("cache").exists());
    // Other verbs refuse it in the same words.
    for verb in [&["prepare", "--config"][..], &["config", "check"]] {
        let refused = clothcombo(&[verb, &[&config.display().to_string()]].concat());
        assert_fails(&refused, 1, &["8 of 12 files"]);
    }
    let check = clothcombo(&["check", &folder.path().display().to_string()]);
    assert_fails(&check, 1, &["8 of 12 files are unusable"]);
    assert!(!folder.path().join("cache").exists());
}

#[test]
fn warnings_are_counted_and_training_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let config = dataset(folder.path());
    // A little of the tee is under the skin: worth a look, no obstacle.
    changed(folder.path(), "t_shirt_000007.obj", "tight.obj", |[x, y, z]| [x, y, 0.85 * z], false);
    let run = folder.path().join("run");
    let output = train(&config, &run);
    let message = said(&output);
    assert!(output.status.success(), "{message}");
    assert!(message.contains("warnings about 1 of 5 files, the first tight.obj"), "{message}");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    assert!(page.contains("warnings about 1 files"));
    let check = std::fs::read_to_string(run.join("check.json")).unwrap();
    assert!(check.contains("tight.obj") && check.contains("vertices inside the body"), "{check}");
}

#[test]
fn changed_data_is_checked_again_and_told_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let config = dataset(folder.path());
    let run = folder.path().join("run");
    let started = train(&config, &run);
    assert!(started.status.success(), "{}", said(&started));
    let resume = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
        command.arg("--resume").arg(&run).args(more).env("NO_COLOR", "1").output().unwrap()
    };
    let skirt = folder.path().join("garments/skirt_000008.obj");
    let mesh = load_tri_mesh(&skirt).unwrap();
    let save = |scale: f64| {
        let positions: Vec<_> = mesh.positions().iter().map(|p| p.map(|x| scale * x)).collect();
        obj::save(&skirt, &positions, mesh.faces(), &[]).unwrap();
    };
    save(100.0);
    assert_fails(&resume(&["--allow-config-change", "data"]), 1, &["1 of 4 files"]);
    save(1.001);
    let refused = resume(&[]);
    let words =
        ["garment skirt_000008: skirt", "now", "in the checkpoint", "--allow-config-change data.garments"];
    assert_fails(&refused, 1, &words);
    let allowed = resume(&["--allow-config-change", "data.garments"]);
    assert!(allowed.status.success(), "{}", said(&allowed));
    assert!(said(&allowed).contains("goes on with other data"), "{}", said(&allowed));
    motion(folder.path(), "third", 50);
    assert_fails(&resume(&["--allow-config-change", "data.garments"]), 1, &["clip third"]);
}
