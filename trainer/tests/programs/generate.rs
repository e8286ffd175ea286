//! `clothcombo generate`: goes on where it was stopped, and makes the same garments for any number of threads.

use assert_cmd::Command;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn generate(folder: &Path, more: &[&str]) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.args(["generate", "--vertices", "300", "-o"]).arg(folder).args(more);
    command
}

fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap()))
        .collect()
}

#[test]
fn a_stopped_run_goes_on_and_gives_what_one_run_would_have() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
    generate(&whole, &["--count", "7"]).env("RAYON_NUM_THREADS", "1").assert().success();

    generate(&parts, &["--count", "3"]).env("RAYON_NUM_THREADS", "3").assert().success();
    // As if it had been stopped before the manifest was written.
    fs::remove_file(parts.join("garments.toml")).unwrap();
    let kept = parts.join("top_000001.obj");
    let before = fs::metadata(&kept).unwrap().modified().unwrap();
    generate(&parts, &["--count", "5"]).assert().success().stderr(contains("2 garments made, 3 kept"));
    assert_eq!(fs::metadata(&kept).unwrap().modified().unwrap(), before);
    generate(&parts, &["--start", "5", "--count", "2"])
        .assert()
        .success()
        .stderr(contains("2 garments made"));
    assert_eq!(contents(&whole), contents(&parts));
}

#[test]
fn a_folder_of_other_garments_is_refused_and_a_picture_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("sheet.png");
    let out = folder.path().join("garments");
    generate(&out, &["--count", "2", "--picture"]).arg(&picture).assert().success();
    assert!(image::open(&picture).unwrap().width() > 200);
    Command::cargo_bin("clothcombo")
        .unwrap()
        .args(["generate", "--vertices", "400", "--count", "2", "-o"])
        .arg(&out)
        .assert()
        .code(1)
        .stderr(contains("dress_000000.obj").and(contains("another garment")).and(contains("--vertices")));
}

#[test]
fn what_cannot_be_made_or_written_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("garments");
    let thesis = folder.path().join("thesis.tex");
    fs::write(&thesis, "mine").unwrap();
    for count in ["0", "1000001", "18446744073709551615"] {
        generate(&out, &["--count", count]).assert().code(2).stderr(contains("--count"));
    }
    for picture in [thesis.clone(), thesis.join("sheet.png")] {
        generate(&out, &["--count", "1", "--picture"])
            .arg(&picture)
            .assert()
            .code(2)
            .stderr(contains("thesis"));
    }
    generate(&out, &["--start", &u64::MAX.to_string(), "--count", "1"])
        .assert()
        .code(2)
        .stderr(contains("--start"));
    // No folder can be made there, whoever asks.
    for refused in [["-o", "/proc/clothcombo"], ["--picture", "/proc/clothcombo/sheet.png"]] {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.args(["generate", "--count", "1"]).args(refused);
        if refused[0] != "-o" {
            command.arg("-o").arg(&out);
        }
        command.assert().code(2).stderr(contains(refused[0]).and(contains("/proc/clothcombo")));
    }
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.args(["bench", "step", "--seconds", "0"]).assert().code(2).stderr(contains("--seconds"));
    assert!(!out.exists());
    assert_eq!(fs::read_to_string(&thesis).unwrap(), "mine");
}

#[test]
fn garments_that_are_not_listed_are_not_hidden_by_a_list() {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("own.obj");
    fs::write(&own, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    generate(folder.path(), &["--count", "1"])
        .assert()
        .code(1)
        .stderr(contains("own.obj").and(contains("no longer be found")));
    assert_eq!(contents(folder.path()).len(), 1);
}
