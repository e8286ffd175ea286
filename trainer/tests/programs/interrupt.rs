//! SIGTERM, SIGHUP and SIGUSR1 save a checkpoint and exit 0; `--resume` continues from it.

use crate::common::with_small_networks;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::time::{Duration, Instant};

const LONG: &str = r#"
seed = 1
[data]
[[data.garments]]
generate = { count = 2, vertices = 200, categories = ["top", "skirt"] }
[[stages]]
name = "single"
trains = "single"
steps = 1000000
[validation]
single_scenes = 1
layered_scenes = 0
"#;

fn start(config: &Path, run: &Path, resume: bool) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
    command.args(arguments(config, run));
    if resume {
        command.arg("--resume");
    }
    command.spawn().unwrap()
}

fn arguments(config: &Path, run: &Path) -> Vec<String> {
    let [config, run] = [config, run].map(|path| path.display().to_string());
    vec!["--config".into(), config, "--run-dir".into(), run, "--quiet".into()]
}

/// Waits until the run has taken its initial validation and some steps.
fn wait_until_running(child: &mut Child, run: &Path) {
    let deadline = Instant::now() + Duration::from_secs(60);
    while !run.join("validation.jsonl").exists()
        || std::fs::metadata(run.join("validation.jsonl")).unwrap().len() == 0
    {
        assert!(Instant::now() < deadline, "the run did not begin");
        assert!(child.try_wait().unwrap().is_none(), "the run ended by itself");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(300));
}

fn send(child: &Child, signal: &str) {
    let sent = Command::new("kill").arg(format!("-{signal}")).arg(child.id().to_string()).status().unwrap();
    assert!(sent.success());
}

/// Asks a run to stop once it runs; returns its exit code.
fn stop_when_running(mut child: Child, run: &Path) -> Option<i32> {
    wait_until_running(&mut child, run);
    send(&child, "TERM");
    child.wait().unwrap().code()
}

fn config(folder: &Path) -> PathBuf {
    let config = folder.join("long.toml");
    std::fs::write(&config, with_small_networks(LONG)).unwrap();
    config
}

#[test]
fn a_closed_terminal_and_a_cluster_that_takes_the_machine_away_save_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    // A cluster warns, and terminates soon after: that is no second Ctrl-C.
    for signals in [&["HUP"][..], &["USR1"], &["USR1", "HUP", "TERM"]] {
        let run = folder.path().join(signals.concat());
        let mut child = start(&config, &run, false);
        wait_until_running(&mut child, &run);
        signals.iter().for_each(|signal| send(&child, signal));
        assert_eq!(child.wait().unwrap().code(), Some(0), "{signals:?}");
        assert!(newest_step(&run) > 0);
    }
}

#[test]
fn a_run_under_nohup_survives_its_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let run = folder.path().join("run");
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_clothcombo-train")]);
    let mut child = shell.args(arguments(&config, &run)).spawn().unwrap();
    wait_until_running(&mut child, &run);
    send(&child, "HUP");
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "it goes on");
    assert_eq!(stop_when_running(child, &run), Some(0));
}

fn newest_step(run: &Path) -> u64 {
    let name = std::fs::read_to_string(run.join("checkpoints/latest")).unwrap();
    name.trim_start_matches("step-").parse().unwrap()
}

#[test]
fn terminate_saves_and_resume_continues() {
    let folder = tempfile::tempdir().unwrap();
    let config = config(folder.path());
    let run = folder.path().join("run");

    assert_eq!(stop_when_running(start(&config, &run, false), &run), Some(0));
    let first = newest_step(&run);
    assert!(first > 0 && run.join("curves.png").exists());

    assert_eq!(stop_when_running(start(&config, &run, true), &run), Some(0));
    assert!(newest_step(&run) > first);

    let metrics = std::fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let steps: Vec<u64> = metrics
        .lines()
        .map(|l| serde_json::from_str::<serde_json::Value>(l).unwrap()["step"].as_u64().unwrap())
        .collect();
    assert!(steps.windows(2).all(|w| w[1] == w[0] + 1), "the log has gaps or repeats");
}
