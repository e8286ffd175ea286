//! `clothcombo import` from the command line: what it prints, what it returns, what it leaves behind.

use assert_cmd::Command;
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
    for verb in ["bvh", "smplx", "smpl", "smplh", "amass", "cloth3d", "deepmimic"] {
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
    assert!(folder.path().join("cloth3d/cloth3d.toml").exists());
    import("deepmimic")
        .arg(fixture("deepmimic/humanoid3d_random.txt"))
        .args(["--licence", "Zlib", "-o"])
        .arg(folder.path().join("motions"))
        .assert()
        .success();
    // Both importers' clips stand in one manifest.
    let manifest = fs::read_to_string(folder.path().join("motions/motions.toml")).unwrap();
    assert!(manifest.contains("ACCAD_s1_walk.npz") && manifest.contains("licence = \"Zlib\""), "{manifest}");
}

#[test]
fn mistakes_are_one_sentence_and_an_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for (verb, input, part) in [
        ("smplx", "wrong/without_weights.npz", "key 'weights' is missing"),
        ("amass", "mat", "no AMASS motions (.npz) found"),
        ("deepmimic", "deepmimic/dog.txt", "frame 0 has 8 numbers"),
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
