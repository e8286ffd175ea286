//! `clothcombo import` from the command line: what it prints, what it returns, what it leaves behind.

use crate::common::assert_fails;
use assert_cmd::Command;
use clothcombo_data::asset::Motion;
use clothcombo_data::format::NpzWriter;
use predicates::str::contains;
use std::fs;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/tests/fixtures/import").join(name)
}

fn import(verb: &str) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.args(["import", verb]);
    command
}

#[test]
fn every_importer_has_help_with_an_example() {
    for verb in ["bvh", "amc", "asf", "smplx", "smpl", "smplh", "amass", "cloth3d", "deepmimic"] {
        import(verb).arg("--help").assert().success().stdout(contains("\n  clothcombo import "));
    }
}

#[test]
fn a_frame_rate_that_is_none_is_refused() {
    for rate in ["nan", "inf", "0", "-30"] {
        let rate = format!("--frame-rate={rate}");
        import("bvh").args(["walk.bvh", "-o", "motions", &rate]).assert().code(2).stderr(contains("above 0"));
    }
}

#[test]
fn a_model_its_motions_and_its_garments_come_in() {
    let folder = tempfile::tempdir().unwrap();
    let body = folder.path().join("body.npz");
    import("smpl")
        .arg(fixture("cloth3d_bodies/body_neutral.npz"))
        .arg("-o")
        .arg(&body)
        .assert()
        .success()
        .stdout(contains("24 joints, 10 shape components, with pose correctives"))
        .stdout(contains("1 taken"));
    import("amass")
        .arg(fixture("amass"))
        .args(["--fps", "60", "--static-threshold", "0", "-o"])
        .arg(folder.path().join("motions"))
        .assert()
        .success()
        .stdout(contains("taken    ACCAD_s1_walk: SMPL-H"))
        .stdout(contains("shape.npz: not a motion"))
        .stdout(contains("3 taken, 9 skipped"));
    import("cloth3d")
        .arg(fixture("cloth3d"))
        .arg("--body")
        .arg(&body)
        .arg("--female")
        .arg(fixture("cloth3d_bodies/body_female.npz"))
        .arg("-o")
        .arg(folder.path().join("cloth3d"))
        .assert()
        .success()
        .stdout(contains("taken    00001_Top: "))
        .stdout(contains("note     female samples were unposed with body 'body_female'"));
    assert!(folder.path().join("cloth3d/garments/garments.toml").exists());
    assert!(folder.path().join("cloth3d/motions/00001.npz").exists());
    import("deepmimic")
        .arg(fixture("deepmimic/humanoid3d_random.txt"))
        .args(["--licence", "Zlib", "-o"])
        .arg(folder.path().join("motions"))
        .assert()
        .success();
    import("amc")
        .arg(fixture("acclaim"))
        .args(["--fps", "60", "-o"])
        .arg(folder.path().join("motions"))
        .assert()
        .success()
        .stdout(contains(
            "taken    07_01: 22 of 22 body joints in a rig of 27, 3 of 5 frames at 120 frames/s",
        ));
    for clip in ["ACCAD_s1_walk", "07_01"] {
        assert!(folder.path().join(format!("motions/{clip}.npz")).exists(), "{clip}");
    }
    let motion = Motion::load(&folder.path().join("motions/humanoid3d_random.npz")).unwrap();
    assert_eq!(motion.source.licence, "Zlib");
}

#[test]
fn mistakes_are_one_sentence_and_an_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (verb, input, part) in [
        ("smplx", "wrong/without_weights.npz", "key 'weights' is missing"),
        ("amass", "mat", "no AMASS motions (.npz) found"),
        ("deepmimic", "deepmimic/dog.txt", "frame 0 has 8 numbers"),
        ("amc", "amass/CMU/LICENSE.txt", "no skeleton (.asf) beside it"),
        ("bvh", "acclaim/07/07_01.amc", "`clothcombo import amc` reads it"),
        ("bvh", "acclaim", "a folder; name the files in it"),
    ] {
        let mut command = import(verb);
        let output = command.env("NO_COLOR", "1").arg(fixture(input)).arg("-o").arg(&out).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{message}");
        // The report wraps long lines.
        let flat: String = message.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        assert!(flat.contains(part), "{message}");
    }
    for wrong in [["--frame-rate", "0"], ["--frame-rate", "inf"], ["--static-threshold", "-1"], ["--up", "x"]]
    {
        import("amass").arg(fixture("amass")).args(wrong).arg("-o").arg(&out).assert().code(2);
    }
    assert!(!out.exists());
}

/// A motion file with poses and, if any, a rate.
fn write_poses(path: &Path, shape: &[usize], rate: Option<(&str, f64)>) {
    let joints: usize = shape[1..].iter().product::<usize>() / 3;
    let mut poses = vec![0.0; shape[0] * 3 * joints];
    for (frame, row) in poses.chunks_exact_mut(3 * joints).enumerate() {
        row[0] = std::f64::consts::FRAC_PI_2;
        row[3 * 16 + 2] = -0.02 * frame as f64;
    }
    let mut npz = NpzWriter::new();
    npz.f64("poses", shape, &poses);
    if let Some((key, rate)) = rate {
        npz.f64(key, &[], &[rate]);
    }
    npz.save(path).unwrap();
}

#[test]
fn motions_of_other_tools_come_in_with_their_rate_or_one_that_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    write_poses(&file("n_j_3.npz"), &[40, 22, 3], Some(("mocap_framerate", 30.0)));
    write_poses(&file("n_24_3.npz"), &[40, 24, 3], Some(("fps", 30.0)));
    write_poses(&file("no_rate.npz"), &[40, 66], None);
    let out = file("out");
    for name in ["n_j_3.npz", "n_24_3.npz"] {
        let taken = import("amass").arg(file(name)).arg("-o").arg(&out).assert().success();
        taken.stdout(contains("40 frames at 30 frames/s")).stdout(contains("z is up, as the bodies stand"));
    }
    let refused =
        import("amass").env("NO_COLOR", "1").arg(file("no_rate.npz")).arg("-o").arg(&out).output().unwrap();
    assert_fails(&refused, 1, &["no_rate.npz: no frame rate", "import amass FILE --rate HZ"]);
    let given = |name: &str| {
        let mut command = import("amass");
        command.env("NO_COLOR", "1").arg(file(name)).args(["--rate", "60", "-o"]).arg(&out);
        command.output().unwrap()
    };
    let taken = given("no_rate.npz");
    assert!(String::from_utf8_lossy(&taken.stdout).contains("20 of 40 frames at 60 frames/s"), "{taken:?}");
    assert_fails(
        &given("n_24_3.npz"),
        1,
        &["key 'fps' says 30 frames per second, --rate 60", "leave it out"],
    );
}

/// A frame of a standing rig with the joints of Mixamo, as `rename` calls them.
fn mixamo(rename: impl Fn(&str) -> String) -> String {
    let mut paths: Vec<(String, [f64; 3])> = Vec::new();
    let mut chain = |names: &[&str], offsets: &[[f64; 3]]| {
        for (n, offset) in (1..=names.len()).zip(offsets) {
            paths.push((names[..n].join("/"), *offset));
        }
    };
    let trunk = ["Hips", "Spine", "Spine1", "Neck", "Head"];
    chain(
        &trunk,
        &[[0.0, 90.0, 0.0], [0.0, 10.0, 0.0], [0.0, 20.0, 0.0], [0.0, 15.0, 0.0], [0.0, 10.0, 0.0]],
    );
    for (side, x) in [("Left", 1.0), ("Right", -1.0)] {
        let leg = ["UpLeg", "Leg", "Foot"].map(|n| format!("{side}{n}"));
        let names: Vec<&str> = ["Hips"].into_iter().chain(leg.iter().map(String::as_str)).collect();
        chain(&names, &[[0.0, 90.0, 0.0], [9.0 * x, -5.0, 0.0], [0.0, -40.0, 0.0], [0.0, -40.0, 0.0]]);
        let arm = ["Shoulder", "Arm", "ForeArm", "Hand"].map(|n| format!("{side}{n}"));
        let names: Vec<&str> = trunk[..3].iter().copied().chain(arm.iter().map(String::as_str)).collect();
        let own = [[5.0 * x, 10.0, 0.0], [12.0 * x, 0.0, 0.0], [26.0 * x, 0.0, 0.0], [24.0 * x, 0.0, 0.0]];
        chain(&names, &[[[0.0; 3]; 3].as_slice(), &own].concat());
    }
    let (mut text, mut count) = (String::from("HIERARCHY\n"), 0);
    fn write(
        text: &mut String,
        count: &mut usize,
        at: &str,
        paths: &[(String, [f64; 3])],
        rename: &dyn Fn(&str) -> String,
    ) {
        let (_, [x, y, z]) = paths.iter().find(|(path, _)| path == at).unwrap();
        let kind = if at == "Hips" { "ROOT" } else { "JOINT" };
        let name = rename(at.rsplit('/').next().unwrap());
        text.push_str(&format!(
            "{kind} {name}\n{{\nOFFSET {x} {y} {z}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        ));
        *count += 1;
        let mut children: Vec<&str> = Vec::new();
        for (path, _) in paths {
            let is_child = path.rsplit_once('/').is_some_and(|(parent, _)| parent == at);
            if is_child && !children.contains(&path.as_str()) {
                children.push(path);
            }
        }
        children.into_iter().for_each(|child| write(text, count, child, paths, rename));
        text.push_str("}\n");
    }
    write(&mut text, &mut count, "Hips", &paths, &rename);
    text + "MOTION\nFrames: 1\nFrame Time: 0.03\n" + &"0 ".repeat(3 * count)
}

#[test]
fn rigs_come_in_by_their_names_or_by_a_file_that_the_refusal_prints() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let out = file("out");
    let bvh = |name: &str| {
        let mut command = import("bvh");
        command.env("NO_COLOR", "1").arg(file(name)).arg("-o").arg(&out);
        command
    };
    fs::write(file("mixamo.bvh"), mixamo(|name| format!("mixamorig:{name}"))).unwrap();
    fs::write(file("plain.bvh"), mixamo(str::to_owned)).unwrap();
    for name in ["mixamo.bvh", "plain.bvh"] {
        bvh(name).assert().success().stdout(contains("19 of 22 body joints in a rig of 19"));
    }
    fs::write(file("odd.bvh"), mixamo(|name| name.replace("LeftLeg", "Zig").replace("RightHand", "Zag")))
        .unwrap();
    let refused = bvh("odd.bvh").output().unwrap();
    assert_fails(
        &refused,
        1,
        &[
            "is known as left_knee, right_wrist",
            "--joints FILE",
            "left_hip = \"LeftUpLeg\"",
            "left_knee = \"\"",
        ],
    );
    // What is printed, filled in, is what is taken.
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    let lines =
        message.lines().map(|line| line.trim_start_matches([' ', '│'])).filter(|line| line.contains(" = \""));
    let map: String = lines.map(|line| format!("{line}\n")).collect();
    let map = map
        .replace("left_knee = \"\"", "left_knee = \"Zig\"")
        .replace("right_wrist = \"\"", "right_wrist = \"Zag\"");
    fs::write(file("map.toml"), &map).unwrap();
    bvh("odd.bvh").arg("--joints").arg(file("map.toml")).assert().success().stdout(contains("19 of 22"));
    fs::write(file("map.toml"), map.replace("Zig", "Zigg")).unwrap();
    let wrong = bvh("odd.bvh").arg("--joints").arg(file("map.toml")).output().unwrap();
    assert_fails(&wrong, 1, &["map.toml:5: the rig has no joint 'Zigg' (for left_knee); nearest are Zig"]);
    fs::write(file("a.fbx"), "Kaydara FBX Binary").unwrap();
    assert_fails(&bvh("a.fbx").output().unwrap(), 1, &["a.fbx: an FBX scene", "BVH (Blender"]);
}
