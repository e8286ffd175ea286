//! Wrong input gets one clear message and exit code 1, and leaves no run folder behind.

use crate::common::assert_fails;
use assert_cmd::Command;
use std::path::Path;
use tempfile::TempDir;

const SMALL: &str = "seed = 1\n[data]\nbody = \"BODY\"\n[[data.garments]]\nSOURCE\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 2\n";

struct Case {
    folder: TempDir,
}

impl Case {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }
    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }
    fn write(&self, name: &str, text: &str) {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    fn config(&self, body: &str, source: &str) {
        self.write("config.toml", &SMALL.replace("BODY", body).replace("SOURCE", source));
    }
    /// Runs the trainer, which must fail with code 1 and a message that holds every one of `words`.
    fn must_fail(&self, extra: &[&str], words: &[&str]) {
        let run = self.path("run");
        let output = Command::cargo_bin("clothcombo-train")
            .unwrap()
            .env("NO_COLOR", "1")
            .args(["--config", &self.path("config.toml"), "--run-dir", &run])
            .args(extra)
            .output()
            .unwrap();
        assert_fails(&output, 1, words);
        assert!(!Path::new(&run).exists(), "a run folder was left behind");
    }
}

const GENERATED: &str = "generate = { count = 1, vertices = 200, categories = [\"top\"] }";

#[test]
fn unknown_config_key() {
    let case = Case::new();
    case.config("mannequin", &format!("{GENERATED}\ncolour = 3"));
    case.must_fail(&[], &["colour", "folder", "generate", "config.toml"]);
}

#[test]
fn unknown_override() {
    let case = Case::new();
    case.config("mannequin", GENERATED);
    case.must_fail(&["--set", "losses.strian.weight=1"], &["strian", "strain"]);
}

#[test]
fn missing_config() {
    Case::new().must_fail(&[], &["config.toml", "--config"]);
}

#[test]
fn missing_body() {
    let case = Case::new();
    case.config(&case.path("nobody.npz"), GENERATED);
    case.must_fail(&[], &["nobody.npz"]);
}

#[test]
fn missing_garment_folder() {
    let case = Case::new();
    case.config("mannequin", &format!("folder = \"{}\"", case.path("nowhere")));
    case.must_fail(&[], &["nowhere"]);
}

#[test]
fn empty_garment_folder() {
    let case = Case::new();
    std::fs::create_dir(case.folder.path().join("empty")).unwrap();
    case.config("mannequin", &format!("folder = \"{}\"", case.path("empty")));
    case.must_fail(&[], &["empty", "no garments", "OBJ"]);
}

#[test]
fn obj_with_a_number_that_is_not_finite() {
    let case = Case::new();
    case.write("garments/bad.obj", "v 0 0 0\nv 1 0 0\nv 0 NaN 0\nf 1 2 3\n");
    case.config("mannequin", &format!("folder = \"{}\"", case.path("garments")));
    case.must_fail(&[], &["bad.obj", "3"]);
}

#[test]
fn obj_with_an_index_out_of_range() {
    let case = Case::new();
    case.write("garments/bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n");
    case.config("mannequin", &format!("folder = \"{}\"", case.path("garments")));
    case.must_fail(&[], &["bad.obj", "7"]);
}

#[test]
fn body_that_is_no_npz() {
    let case = Case::new();
    case.write("body.npz", "this is not a zip archive");
    case.config(&case.path("body.npz"), GENERATED);
    case.must_fail(&[], &["body.npz"]);
}

#[test]
fn resuming_nothing() {
    let case = Case::new();
    case.config("mannequin", GENERATED);
    case.must_fail(&["--resume"], &["no run to resume"]);
}

#[test]
fn wrong_usage_exits_with_two() {
    let output =
        Command::cargo_bin("clothcombo-train").unwrap().args(["--confg", "x.toml"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn an_output_that_cannot_be_written_is_no_panic() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_clothcombo"));
    let output = command.args(["config", "schema"]).stdout(full).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.lines().count() == 1 && message.contains("No space left"), "{message}");
}

/// `clothcombo config check … | head -0`: whoever reads is gone before anything is printed.
#[cfg(unix)]
#[test]
fn a_closed_pipe_is_no_panic() {
    use std::os::unix::process::ExitStatusExt;
    use std::process::Stdio;
    let case = Case::new();
    case.write("tiny.toml", crate::common::TINY);
    let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_clothcombo"))
        .args(["config", "check", &case.path("tiny.toml")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(program.stdout.take());
    let output = program.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!message.contains("panicked"), "{message}");
    // Nothing else ended it before it wrote.
    assert_eq!(output.status.signal(), Some(libc::SIGPIPE), "{message}");
}
