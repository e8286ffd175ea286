//! What can go wrong around a run folder: one clear message, exit 1, and what was there stays whole.

use crate::common::{assert_fails, clothcombo, resume, said, start, tiny, trainer};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

/// Names and contents of the checkpoints of a run.
fn checkpoints(run: &Path) -> Vec<(String, Vec<u8>)> {
    let folders = std::fs::read_dir(run.join("checkpoints")).unwrap().flatten().filter(|e| e.path().is_dir());
    let mut all: Vec<_> = folders
        .map(|e| {
            (e.file_name().to_string_lossy().into_owned(), std::fs::read(e.path().join("model.bpk")).unwrap())
        })
        .collect();
    all.sort();
    all
}

#[test]
fn a_second_run_in_the_same_folder() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    let long = ["--set", "stages.0.steps=1000000"];
    let mut first = start(&config, &run, 1).args(long).spawn().unwrap();
    let deadline = Instant::now() + Duration::from_secs(60);
    while !run.join("checkpoints/latest").exists() {
        assert!(Instant::now() < deadline && first.try_wait().unwrap().is_none());
        std::thread::sleep(Duration::from_millis(20));
    }
    let owner = format!("process {}", first.id());
    assert_fails(&resume(&run, 1).output().unwrap(), 1, &["is in use", &owner, "--run-dir"]);
    assert_fails(&start(&config, &run, 1).args(long).output().unwrap(), 1, &["already holds a run"]);
    let listed = clothcombo(&["runs", &run.display().to_string()]);
    assert!(String::from_utf8_lossy(&listed.stdout).contains("running"));
    first.kill().unwrap();
    first.wait().unwrap();
    let listed = clothcombo(&["runs", &run.display().to_string()]);
    assert!(String::from_utf8_lossy(&listed.stdout).contains("stopped"));
}

#[test]
fn a_folder_without_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().display().to_string();
    let asked = trainer(1, &["--resume", "--run-dir", &run]).output().unwrap();
    assert_fails(&asked, 1, &["is not the folder of a run", "--config"]);
}

#[test]
fn a_full_disk_during_a_save() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    assert!(start(&config, &run, 1).status().unwrap().success());
    let before = checkpoints(&run);
    // The shell's limit on the size of a file stands in for a disk without space: 128 KiB hold logs, pages and parameters,
    // not Adam's moments.
    let program = env!("CARGO_BIN_EXE_clothcombo-train");
    let limited = "ulimit -f 128; exec \"$@\"";
    let output = Command::new("bash")
        .args(["-c", limited, "bash", program, "--quiet", "--resume"])
        .arg(&run)
        .args(["--set", "stages.2.steps=25", "--allow-config-change", "stages[2].steps"])
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    assert_fails(
        &output,
        1,
        &["cannot write the checkpoint", "step-00000065", "File too large", "untouched"],
    );
    assert_eq!(
        checkpoints(&run),
        before,
        "the checkpoints before are intact, and there is no part of another"
    );
    let again = resume(&run, 1).output().unwrap();
    assert!(again.status.success(), "{}", said(&again));
}

/// Every file of a folder with its contents, but for the lock, which says who was there last.
fn contents(folder: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            match path.is_dir() {
                true => folders.push(path),
                false if path.ends_with("lock") => {}
                false => all.push((path.clone(), std::fs::read(path).unwrap())),
            }
        }
    }
    all.sort();
    all
}

#[test]
fn a_run_with_more_steps_than_it_is_asked_for_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "keep_checkpoints = 20\n");
    let run = folder.path().join("run");
    assert!(start(&config, &run, 1).status().unwrap().success());
    let before = contents(&run);
    let fewer = ["--set", "stages.2.steps=5", "--allow-config-change", "stages"];
    let output = resume(&run, 1).args(fewer).output().unwrap();
    assert_fails(
        &output,
        1,
        &["has 60 steps, more than the 45 of the configuration", "an earlier checkpoint"],
    );
    let changed = contents(&run).into_iter().filter(|file| !before.contains(file)).map(|(path, _)| path);
    assert_eq!(changed.collect::<Vec<_>>(), Vec::<std::path::PathBuf>::new());
    // From an earlier checkpoint it is another run, as before.
    let earlier = run.join("checkpoints/step-00000040").display().to_string();
    let output = trainer(1, &["--resume", &earlier]).args(fewer).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
}

#[test]
fn a_folder_that_cannot_be_written() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    // Nobody, not even root, makes folders in /proc.
    let output = start(&config, Path::new("/proc/run"), 1).output().unwrap();
    assert_fails(&output, 1, &["cannot write /proc/run", "writable"]);
}

#[test]
fn a_changed_configuration_and_an_older_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "keep_checkpoints = 20\n");
    let run = folder.path().join("run");
    assert!(start(&config, &run, 1).status().unwrap().success());
    let model = std::fs::read(run.join("checkpoints/step-00000060/model.bpk")).unwrap();

    let changed = ["--set", "losses.strain.weight=3.0", "--set", "stages.2.steps=21"];
    assert_fails(
        &resume(&run, 1).args(changed).output().unwrap(),
        1,
        &["losses.strain.weight", "stages[2].steps", "--allow-config-change"],
    );
    let path = run.join("checkpoints/step-00000050").display().to_string();
    let elsewhere = folder.path().join("elsewhere").display().to_string();
    assert_fails(
        &trainer(1, &["--resume", &path, "--run-dir", &elsewhere]).output().unwrap(),
        1,
        &["belongs to"],
    );
    assert_fails(
        &trainer(1, &["--resume", &elsewhere]).output().unwrap(),
        1,
        &["neither a run nor a checkpoint"],
    );

    // From the older checkpoint the same steps lead to the same networks; the newer ones were set aside.
    assert!(trainer(1, &["--resume", &path]).status().unwrap().success());
    assert!(std::fs::read(run.join("checkpoints/step-00000060/model.bpk")).unwrap() == model);
    assert!(run.join("checkpoints/abandoned-step-00000060").exists());

    // An allowed change takes effect and is written down.
    let mut allowed = resume(&run, 1);
    allowed.args(changed).args(["--allow-config-change", "losses,stages"]);
    assert!(allowed.status().unwrap().success());
    assert!(run.join("checkpoints/step-00000061").exists() && run.join("config.before-1.toml").exists());
    assert!(resume(&run, 1).status().unwrap().success(), "its own configuration is the new one");
}

#[test]
fn a_garment_over_the_vertex_limit() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    let output = start(&config, &run, 1).args(["--set", "data.max_vertices=100"]).output().unwrap();
    assert_fails(&output, 1, &["vertices", "data.max_vertices = 100"]);
    assert!(!run.exists());
}
