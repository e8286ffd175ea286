//! `clothcombo check`: a generated folder passes, a broken file makes it exit 1 and is named.

use assert_cmd::Command;
use predicates::prelude::*;
use std::fs;

fn clothcombo() -> Command {
    Command::cargo_bin("clothcombo").unwrap()
}

#[test]
fn a_generated_folder_passes_until_a_broken_file_joins_it() {
    let folder = tempfile::tempdir().unwrap();
    let garments = folder.path().join("garments");
    clothcombo()
        .args(["generate", "--count", "2", "--vertices", "300", "--categories", "top,skirt", "-o"])
        .arg(&garments)
        .assert()
        .success();
    let table = clothcombo().arg("check").arg(folder.path()).assert().success();
    table.stdout(
        predicate::str::contains("top_000000.obj")
            .and(predicate::str::contains("skirt_000001.obj"))
            .and(predicate::str::contains("2 usable, 0 of them with warnings, 0 unusable")),
    );

    fs::write(folder.path().join("cut.ply"), "ply\nformat ascii 1.0\nelement vertex 9\n").unwrap();
    let broken = clothcombo().arg("check").arg(folder.path()).arg("--json").output().unwrap();
    assert_eq!(broken.status.code(), Some(1));
    let message = String::from_utf8_lossy(&broken.stderr).into_owned();
    assert!(message.contains("1 of 3 files are unusable") && message.contains("cut.ply"), "{message}");
    let json: serde_json::Value = serde_json::from_slice(&broken.stdout).unwrap();
    assert_eq!(json["unusable"], 1);
    let files = json["files"].as_array().unwrap();
    let skirt = files.iter().find(|f| f["path"].as_str().unwrap().ends_with("skirt_000001.obj")).unwrap();
    assert_eq!(skirt["garment"]["category"], "skirt");
    assert_eq!(skirt["garment"]["mesh"]["components"], 1);
    assert!(skirt["garment"]["distance_min_mm"].as_f64().unwrap() > 0.0);

    clothcombo().args(["check"]).assert().code(2);
}
