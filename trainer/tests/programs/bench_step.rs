//! `clothcombo bench step` on tiny cases: shares add up, one garment costs no untangling, exports are complete.

use assert_cmd::Command;
use predicates::str::contains;
use serde_json::Value;
use std::path::Path;

fn bench(arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    let small =
        ["--vertices", "300", "--blocks", "1", "--eigen-count", "8", "--steps", "2", "--seconds", "0.01"];
    command.current_dir(folder).args(["bench", "step"]).args(small).args(arguments);
    command
}

#[test]
fn shares_add_up_and_one_garment_costs_no_untangling() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--widths", "8", "--layers", "1,2", "--json", "--picture", "step.png"];
    let output = bench(&arguments, folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    for case in report["cases"].as_array().unwrap() {
        let phases = case["profile"]["phases_ms"].as_array().unwrap();
        let of = |name: &str| phases.iter().find(|phase| phase[0] == name).unwrap()[1].as_f64().unwrap();
        let step = case["profile"]["step_ms"].as_f64().unwrap();
        for part in ["embedding", "draping", "skinning", "energies", "backward", "optimiser"] {
            assert!(of(part) > 0.0 && of(part) < step, "{part} {} of {step}", of(part));
        }
        let (layers, untangling) = (case["layers"].as_u64().unwrap(), of("untangling"));
        assert_eq!(layers > 1, untangling > 0.0, "{layers} layers, {untangling} ms of untangling");
        assert!(case["costs"]["terms_ms"]["strain"].as_f64().unwrap() > 0.0);
    }
    assert!(image::open(folder.path().join("step.png")).unwrap().width() > 500);
}

#[test]
fn an_export_holds_all_parameters_and_our_results() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--widths", "8", "--layers", "2", "--export", "case", "--json"];
    let output = bench(&arguments, folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let text = std::fs::read_to_string(folder.path().join("case/scene.json")).unwrap();
    let scene: Value = serde_json::from_str(&text).unwrap();
    assert!(scene["expected"]["gradient_norm"].as_f64().unwrap() > 0.0);
    let bytes = std::fs::metadata(folder.path().join("case/model.safetensors")).unwrap().len();
    assert!(bytes > 4 * report["cases"][0]["parameters"].as_u64().unwrap());
    assert!(folder.path().join("case/scene.npz").exists());
    bench(&["--widths", "8,16", "--export", "x"], folder.path())
        .assert()
        .code(1)
        .stderr(contains("one case"));
}
