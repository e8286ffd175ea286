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
    let arguments = ["--widths", "8", "--layers", "1,2", "--json"];
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
    let norms = &scene["expected"]["gradient_norms"];
    let of = |network: &str| norms[network].as_f64().unwrap_or_else(|| panic!("{network}"));
    let networks = ["garment_encoder", "draping", "skinning", "untangling"].map(of);
    assert!(networks.iter().all(|norm| *norm > 0.0), "{norms}");
    let total = scene["expected"]["gradient_norm"].as_f64().unwrap();
    let together = networks.iter().map(|norm| norm * norm).sum::<f64>().sqrt();
    assert!((total - together).abs() <= 1e-9 * total, "{total} {together}");
    let bytes = std::fs::metadata(folder.path().join("case/model.safetensors")).unwrap().len();
    assert!(bytes > 4 * report["cases"][0]["parameters"].as_u64().unwrap());
    assert!(folder.path().join("case/scene.npz").exists());
    bench(&["--widths", "8,16", "--export", "x"], folder.path())
        .assert()
        .code(1)
        .stderr(contains("one case"));
}

fn exported(folder: &Path, name: &str, arguments: &[&str], set: &[&str]) -> Value {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.current_dir(folder).args([
        "bench",
        "step",
        "--steps",
        "2",
        "--seconds",
        "0.01",
        "--export",
        name,
    ]);
    let output = command.args(arguments).args(set.iter().flat_map(|s| ["--set", s])).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&std::fs::read_to_string(folder.join(name).join("scene.json")).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn overrides_change_what_is_exported() {
    let folder = tempfile::tempdir().unwrap();
    let made_up =
        ["--widths", "8", "--layers", "1", "--vertices", "300", "--blocks", "1", "--eigen-count", "8"];
    let plain = exported(folder.path(), "plain", &made_up, &[]);
    let set =
        ["losses.gravity.weight=3", "losses.repulsion.per_vertex=false", "model.zero_sum_skinning=false"];
    let other = exported(folder.path(), "other", &made_up, &set);
    assert_eq!(plain["settings"]["repulsion_per_vertex"], true);
    assert_eq!(other["settings"]["repulsion_per_vertex"], false);
    assert_eq!(other["model"]["zero_sum_skinning"], false);
    let weight = |scene: &Value| number(&scene["garments"][0]["weights"]["gravity"]);
    assert_eq!((weight(&plain), weight(&other)), (1.0, 3.0));
    assert_ne!(plain["expected"]["loss"], other["expected"]["loss"]);

    let mut wrong =
        bench(&["--widths", "8", "--layers", "1", "--set", "losses.strian.weight=1"], folder.path());
    wrong.assert().code(1).stderr(contains("strian"));
}

#[test]
fn a_stage_of_a_configuration_is_exported_as_it_is_trained() {
    let folder = tempfile::tempdir().unwrap();
    let config = crate::common::tiny(folder.path(), "[losses]\nrepulsion = { subset = 0 }\n");
    let arguments = |stage: &'static str| {
        ["--config".into(), config.display().to_string(), "--stage".into(), stage.into()]
    };
    let of = |name: &str, stage: &'static str, set: &[&str]| {
        let arguments: Vec<String> = arguments(stage).to_vec();
        exported(folder.path(), name, &arguments.iter().map(String::as_str).collect::<Vec<_>>(), set)
    };
    let single = of("single", "0", &[]);
    assert_eq!((&single["trains"], &single["single_garments"]), (&"single".into(), &0.0.into()));
    assert_eq!(number(&single["expected"]["gradient_norms"]["untangling"]), 0.0);

    // Training end to end with the single garments: the whole of its loss.
    let outfits = ["stages.2.layers=[3, 3]"];
    let all = of("all", "2", &outfits);
    let with_single = of("with_single", "2", &[outfits[0], "losses.single_garments=0.5"]);
    assert_eq!((&with_single["trains"], number(&with_single["single_garments"])), (&"all".into(), 0.5));
    assert_eq!(with_single["garments"].as_array().unwrap().len(), 3);
    assert!(with_single["expected"]["loss"] != all["expected"]["loss"]);
    assert!(
        with_single["expected"]["gradient_norms"]["skinning"]
            != all["expected"]["gradient_norms"]["skinning"]
    );
    assert_eq!(
        with_single["expected"]["gradient_norms"]["untangling"],
        all["expected"]["gradient_norms"]["untangling"],
        "single garments do not depend on it"
    );

    let path = config.display().to_string();
    let fails = |more: &[&str], words: &str| {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.current_dir(folder.path()).args(["bench", "step", "--export", "x"]).args(more);
        command.assert().code(1).stderr(contains(words));
        assert!(!folder.path().join("x").exists());
    };
    fails(&["--config", &path], "--stage");
    fails(&["--config", &path, "--stage", "7"], "no such stage");
}
