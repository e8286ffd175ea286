//! A folder of OBJ garments, as a user would bring one: made by `clothcombo generate`, one of them rewritten by hand
//! with quads and texture coordinates, trained on for a few steps.

use crate::common::with_small_networks;
use assert_cmd::Command;
use std::fs;

const CONFIG: &str = r#"
seed = 1
[data]
[[data.garments]]
folder = "GARMENTS"
[[stages]]
name = "all"
trains = "all"
steps = 3
layers = [3, 3]
[validation]
single_scenes = 1
layered_scenes = 1
layers = [2, 2]
[output]
sample_scenes = 1
"#;

/// An open tube of quads with texture coordinates around the mannequin's waist.
fn quad_band() -> String {
    let (around, rows) = (24, 6);
    let mut text = String::from("# a waistband\nvt 0 0\n");
    for row in 0..rows {
        for k in 0..around {
            let angle = f64::from(k) / f64::from(around) * std::f64::consts::TAU;
            let y = 0.03 * f64::from(row);
            text += &format!("v {} {} {}\n", 0.17 * angle.sin(), y, 0.14 * angle.cos());
        }
    }
    for row in 0..rows - 1 {
        for k in 0..around {
            let index = |r: i32, k: i32| r * around + k % around + 1;
            let corners = [index(row, k), index(row, k + 1), index(row + 1, k + 1), index(row + 1, k)];
            text += &format!("f {}\n", corners.map(|c| format!("{c}/1")).join(" "));
        }
    }
    text
}

#[test]
fn generated_and_hand_made_garments_train_together() {
    let folder = tempfile::tempdir().unwrap();
    let garments = folder.path().join("garments");
    Command::cargo_bin("clothcombo")
        .unwrap()
        .args(["generate", "--count", "2", "--vertices", "250", "--categories", "top,skirt", "-o"])
        .arg(&garments)
        .assert()
        .success();
    // Other garments of the same names must not overwrite them.
    Command::cargo_bin("clothcombo")
        .unwrap()
        .args(["generate", "--count", "1", "--vertices", "300", "--categories", "top,skirt", "-o"])
        .arg(&garments)
        .assert()
        .code(1);

    fs::write(garments.join("band.obj"), quad_band()).unwrap();
    let manifest = garments.join("garments.toml");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text + "\n[[garment]]\nfile = \"band.obj\"\ncategory = \"skirt\"\n").unwrap();

    let config = folder.path().join("config.toml");
    fs::write(&config, with_small_networks(&CONFIG.replace("GARMENTS", &garments.display().to_string())))
        .unwrap();
    let run = folder.path().join("run");
    Command::cargo_bin("clothcombo-train")
        .unwrap()
        .arg("--config")
        .arg(&config)
        .arg("--run-dir")
        .arg(&run)
        .arg("--quiet")
        .assert()
        .success();

    let metrics = fs::read_to_string(run.join("metrics.jsonl")).unwrap();
    let last: serde_json::Value = serde_json::from_str(metrics.lines().last().unwrap()).unwrap();
    assert_eq!((last["step"].as_u64(), last["layers"].as_u64()), (Some(3), Some(3)));
    for term in ["strain", "bending", "gravity", "repulsion", "holding", "layer_collision", "layer_distance"]
    {
        assert!(last["raw"][term].as_f64().is_some_and(f64::is_finite), "{term} is missing: {last}");
        assert!(last["weighted"][term].as_f64().is_some_and(f64::is_finite), "{term} is missing: {last}");
    }
    for file in ["config.toml", "curves.png", "validation.jsonl", "samples/step-00000003.png"] {
        assert!(run.join(file).exists(), "{file} is missing");
    }
    let checkpoint = run.join("checkpoints/step-00000003");
    for file in ["model.safetensors", "model.bpk", "optimizer.bpk", "state.json", "config.toml"] {
        assert!(checkpoint.join(file).exists(), "{file} is missing");
    }
}
