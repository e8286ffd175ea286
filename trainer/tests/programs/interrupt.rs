//! SIGTERM saves a checkpoint and exits 0; `--resume` continues from it.

use crate::common::with_small_networks;
use std::path::Path;
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
    command.arg("--config").arg(config).arg("--run-dir").arg(run).arg("--quiet");
    if resume {
        command.arg("--resume");
    }
    command.spawn().unwrap()
}

/// Waits until the run has taken its initial validation, then asks it to stop; returns its exit code.
fn stop_when_running(mut child: Child, run: &Path) -> Option<i32> {
    let deadline = Instant::now() + Duration::from_secs(60);
    while !run.join("validation.jsonl").exists()
        || std::fs::metadata(run.join("validation.jsonl")).unwrap().len() == 0
    {
        assert!(Instant::now() < deadline, "the run did not begin");
        assert!(child.try_wait().unwrap().is_none(), "the run ended by itself");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(300));
    let killed = Command::new("kill").arg("-TERM").arg(child.id().to_string()).status().unwrap();
    assert!(killed.success());
    child.wait().unwrap().code()
}

fn newest_step(run: &Path) -> u64 {
    let name = std::fs::read_to_string(run.join("checkpoints/latest")).unwrap();
    name.trim_start_matches("step-").parse().unwrap()
}

#[test]
fn terminate_saves_and_resume_continues() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("long.toml");
    std::fs::write(&config, with_small_networks(LONG)).unwrap();
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
