//! Limits that a shell sets on files and memory (`ulimit`): an error, and nothing left behind.

use crate::common::{assert_fails, said};
use crate::drape::{TEE, at, run_folder};
use std::fs;
use std::process::{Command, Output};

/// `clothcombo drape` of the tee into `out`, in a shell with `limit`.
fn limited(limit: &str, out: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_clothcombo");
    let mut command = Command::new("bash");
    command.args([
        "-c",
        &format!("{limit}; exec \"$@\""),
        "bash",
        program,
        "drape",
        "--quiet",
        "--no-cache",
        "--checkpoint",
    ]);
    command
        .arg(run_folder())
        .args(["--garments", TEE, "-o", out])
        .env("NO_COLOR", "1")
        .env("RAYON_NUM_THREADS", "2");
    command.output().unwrap()
}

#[test]
fn a_file_that_may_not_grow_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let output = limited("ulimit -f 4", &at(&folder, "deep/out"));
    assert_fails(&output, 1, &["File too large", "out"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "something is left");
}

/// More and more memory, until it is enough: before that it ends with one message.
#[test]
fn memory_that_is_used_up_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut refusals = 0;
    for mebibytes in [150, 200, 250, 300, 350, 400, 500, 600, 800, 1200, 2400] {
        let output = limited(&format!("ulimit -v {}", 1024 * mebibytes), &at(&folder, "deep/out"));
        if output.status.success() {
            break;
        }
        assert_fails(&output, 1, &["out of memory", "ulimit -v"]);
        assert_eq!(said(&output).matches('×').count(), 1, "{}", said(&output));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "something is left");
        refusals += 1;
    }
    assert!(refusals > 0 && folder.path().join("deep/out/scene.glb").is_file(), "{refusals}");
}
