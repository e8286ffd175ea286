//! `clothcombo bench error` on two scenes of tiny garments, with and without a network.

use crate::common::with_small_networks;
use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

const CONFIG: &str = r#"
seed = 4
[data]
[[data.garments]]
generate = { count = 2, seed = 5, vertices = 200, categories = ["t_shirt", "skirt"] }
[[stages]]
name = "all"
trains = "all"
steps = 2
[validation]
single_scenes = 2
layered_scenes = 0
[output]
sample_scenes = 0
"#;

fn bench(arguments: &[&str], folder: &Path) -> Command {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.current_dir(folder).args(["bench", "error", "--scenes", "2"]).args(arguments);
    command
}

fn check(report: &Value, methods: &[&str]) {
    let scenes = report["scenes"].as_array().unwrap();
    assert_eq!(scenes.len(), 2);
    for scene in scenes {
        let found: Vec<&str> =
            scene["methods"].as_array().unwrap().iter().map(|m| m["method"].as_str().unwrap()).collect();
        assert_eq!(found, methods);
        let reference = &scene["runs"][scene["reference"].as_u64().unwrap() as usize];
        let lowest = reference["energy"].as_f64().unwrap();
        for m in scene["methods"].as_array().unwrap() {
            let (energy, excess) = (m["energy"].as_f64().unwrap(), m["excess"].as_f64().unwrap());
            assert!(excess > 0.0 && (energy - lowest - excess).abs() < 1e-9 * energy.abs().max(1.0), "{m}");
            assert!(m["distance_mm"].as_f64().unwrap() > 0.0);
            assert_terms(&m["terms"], energy);
        }
        assert_terms(&reference["terms"], lowest);
        // Percent are of what the second method, LBS + shape transfer, has.
        assert!((scene["methods"][1]["excess_percent"].as_f64().unwrap() - 100.0).abs() < 1e-6, "{scene}");
        let gradient = reference["relative_gradient"].as_f64().unwrap();
        assert_eq!(
            reference["stop"] == "converged",
            gradient <= report["tolerance"].as_f64().unwrap(),
            "{reference}"
        );
    }
    let converged =
        scenes.iter().filter(|s| s["runs"][s["reference"].as_u64().unwrap() as usize]["stop"] == "converged");
    assert_eq!(converged.count() as u64, report["solver"]["converged"].as_u64().unwrap());
}

/// The terms add up to the energy.
fn assert_terms(terms: &Value, energy: f64) {
    let terms = terms.as_object().unwrap();
    assert!(terms.contains_key("strain") && terms.contains_key("body_collision"), "{terms:?}");
    let sum: f64 = terms.values().map(|v| v.as_f64().unwrap()).sum();
    assert!((sum - energy).abs() < 1e-9 * energy.abs().max(1.0), "{terms:?} {energy}");
}

#[test]
fn skinning_and_a_network_are_measured_against_the_minimum() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tiny.toml"), with_small_networks(CONFIG)).unwrap();
    let output =
        bench(&["--config", "tiny.toml", "--iterations", "150", "--json"], folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    check(&serde_json::from_slice(&output.stdout).unwrap(), &["LBS", "LBS + shape transfer"]);

    Command::cargo_bin("clothcombo-train")
        .unwrap()
        .current_dir(folder.path())
        .args(["--config", "tiny.toml", "--run-dir", "run", "--quiet"])
        .assert()
        .success();
    let output =
        bench(&["--checkpoint", "run", "--iterations", "150", "--json"], folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    check(&report, &["LBS", "LBS + shape transfer", "network"]);
    let above = report["scenes"].as_array().unwrap().iter().filter(|s| {
        let energy = |i: usize| s["methods"][i]["energy"].as_f64().unwrap();
        let skinning = energy(0).min(energy(1));
        energy(2) > skinning + 1e-5 * skinning.abs().max(1.0)
    });
    assert_eq!(report["above_skinning"], 0, "networks are judged beside skinning");
    assert_eq!(report["above_skinning"].as_u64().unwrap(), above.count() as u64);
    let means = report["methods"].as_array().unwrap().iter().map(|m| &m["terms"]);
    assert!(means.chain([&report["reference_terms"]]).all(|terms| terms["strain"].as_f64() > Some(0.0)));
    assert!(report["scenes"].as_array().unwrap().iter().all(|s| s["runs"].as_array().unwrap().len() == 2));

    // Outfits start from the post-process as well, and report the strain of their layers.
    let outfits = ["--checkpoint", "run", "--layers", "2", "--iterations", "30"];
    let output = bench(&[&outfits[..], &["--json"]].concat(), folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    check(&report, &["LBS", "LBS + shape transfer", "network", "network + post-process"]);
    for scene in report["scenes"].as_array().unwrap() {
        assert_eq!(scene["garments"].as_array().unwrap().len(), 2);
        assert_eq!(scene["runs"].as_array().unwrap().len(), 3);
        assert_eq!(scene["layers"].as_array().unwrap().len(), 2);
    }
    let ratios = report["strain_ratios"].as_array().unwrap();
    assert_eq!(ratios.len(), 2);
    assert!(
        ratios.iter().all(|r| r["equilibrium"].as_f64() > Some(0.0) && r["network"].as_f64() > Some(0.0))
    );
    let output = bench(&outfits, folder.path()).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("strain in the outfit over that of the single garment"), "{text}");

    // One iteration converges nowhere: said in the table, and still a result.
    let output = bench(&["--config", "tiny.toml", "--iterations", "1"], folder.path()).output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("mean of every energy, weighted [J]") && text.contains("equilibrium"), "{text}");
    assert!(text.contains("0 of 2; stops: 2 iterations"), "{text}");
}

#[test]
fn bad_arguments_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tiny.toml"), with_small_networks(CONFIG)).unwrap();
    bench(&["--config", "missing.toml"], folder.path())
        .assert()
        .code(1)
        .stderr(predicates::str::contains("missing.toml"));
    bench(&["--config", "tiny.toml", "--checkpoint", "nowhere"], folder.path())
        .assert()
        .code(1)
        .stderr(predicates::str::contains("nowhere"));
    bench(&["--config", "tiny.toml", "--tolerance=-1"], folder.path())
        .assert()
        .code(1)
        .stderr(predicates::str::contains("tolerance"));
}
