//! A step that is not finite is skipped, written down, and replays; too many end the run.

use crate::common::{clothcombo, holds, resume, said, start, tiny};
use std::path::Path;

const TWO: &str = "[guard]\ninject = { every = 25, what = \"WHAT\" }\n";

fn replay(file: &Path, more: &[&str]) -> (Option<i32>, String, String) {
    let file = file.display().to_string();
    let output = clothcombo(&[&["replay", &file], more].concat());
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned(), said(&output))
}

#[test]
fn injected_incidents_are_captured_and_replay_to_the_bit() {
    for (what, stages) in [("position", ["untangling", "all"]), ("gradient", ["untangling", "all"])] {
        let folder = tempfile::tempdir().unwrap();
        let config = tiny(folder.path(), &TWO.replace("WHAT", what));
        let run = folder.path().join("run");
        let output = start(&config, &run, 2).output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
        for (step, stage) in [25, 50].into_iter().zip(stages) {
            let file = run.join(format!("incidents/step-{step}.json"));
            let incident: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
            assert_eq!((incident["step"].as_u64(), incident["stage"].as_str()), (Some(step), Some(stage)));
            let body = &incident["scenes"][0]["bodies"][0];
            assert!(body["pose"].as_array().unwrap().len() >= 22 && !body["garments"][0]["strain"].is_null());
            assert_eq!(incident["loss"].as_str() == Some("NaN"), what == "position", "{}", incident["loss"]);
            assert_eq!(incident["gradient_norm"], "NaN");

            let (code, table, message) = replay(&file, &[]);
            assert_eq!(code, Some(0), "{table}\n{message}");
            assert!(table.contains("came back to the bit") && table.contains("gradient norm"), "{table}");
        }
        let metrics = std::fs::read_to_string(run.join("metrics.jsonl")).unwrap();
        assert_eq!(metrics.matches("\"skipped\":true").count(), 2);
        assert_eq!(metrics.lines().count(), 60, "the run went on");
    }
}

#[test]
fn a_replay_notices_other_numbers_and_other_files() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), &TWO.replace("WHAT", "gradient"));
    let run = folder.path().join("run");
    assert!(start(&config, &run, 2).status().unwrap().success());
    let file = run.join("incidents/step-25.json");

    let (code, table, message) = replay(&file, &["--set", "losses.material.thickness=0.002"]);
    assert_eq!(code, Some(1), "{table}");
    assert!(table.contains("differs") && holds(&message, "did not come back"), "{message}");

    let text = std::fs::read_to_string(&file).unwrap();
    let moved = folder.path().join("step-25.json");
    std::fs::write(&moved, &text).unwrap();
    let (code, _, message) = replay(&moved, &[]);
    assert!(code == Some(1) && holds(&message, "step-25.bpk"), "{message}");
    std::fs::write(&file, &text[..text.len() / 2]).unwrap();
    let (code, _, message) = replay(&file, &[]);
    assert!(code == Some(1) && holds(&message, "is no incident"), "{message}");
}

#[test]
fn too_many_incidents_end_the_run_at_its_last_good_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let more = "[guard]\ninject = { every = 4, what = \"position\" }\nmax_incidents = 3\nwindow = 10\nkept_incidents = 2\n";
    let config = tiny(folder.path(), more);
    let run = folder.path().join("run");
    let output = start(&config, &run, 1).output().unwrap();
    let message = said(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    for words in ["not finite in 3 of the last 10 steps", "step 12", "step-00000010", "clothcombo replay"] {
        assert!(holds(&message, words), "{words}: {message}");
    }
    let incidents = std::fs::read_dir(run.join("incidents")).unwrap().flatten();
    assert_eq!(incidents.filter(|e| e.path().extension().is_some_and(|x| x == "json")).count(), 2);
    assert!(std::fs::read_to_string(run.join("report.html")).unwrap().contains("gave up"));
}

/// Parameters that make every further step fail are no good checkpoint, and push none out.
#[test]
fn a_diverged_run_names_a_checkpoint_from_before_and_goes_on_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "[guard]\nmax_incidents = 6\n");
    let run = folder.path().join("run");
    let output = start(&config, &run, 1).args(["--set", "stages.1.learning_rate=1e30"]).output().unwrap();
    let message = said(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(holds(&message, "last good checkpoint") && holds(&message, "step-00000020"), "{message}");
    let repaired = ["--set", "stages.1.learning_rate=1e-4", "--allow-config-change", "stages"];
    let output = resume(&run, 1).args(repaired).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
}
