//! `clothcombo eval` on a model of a few steps: every table is there, and what cannot work is said before the work.

use crate::common::{clothcombo, holds, said, start, tiny};
use serde_json::Value;
use std::fs;

#[test]
fn a_quick_evaluation_holds_every_table_of_the_paper() {
    let folder = tempfile::tempdir().unwrap();
    let (run, report) = (folder.path().join("run"), folder.path().join("report"));
    assert!(start(&tiny(folder.path(), ""), &run, 2).status().unwrap().success());
    let arguments = |extra: &[&str]| {
        let (run, report) = (run.to_str().unwrap(), report.to_str().unwrap());
        let own = ["eval", "--checkpoint", run, "--quick", "--quiet", "-o", report];
        clothcombo(&own.iter().chain(extra).copied().collect::<Vec<_>>())
    };
    let output = arguments(&["--ablation", &format!("twin={}", run.display())]);
    assert!(output.status.success(), "{}", said(&output));

    let eval: Value = serde_json::from_slice(&fs::read(report.join("eval.json")).unwrap()).unwrap();
    let study = &eval["study"];
    let first = &study["methods"][0]["methods"];
    let names: Vec<&str> = first.as_array().unwrap().iter().map(|m| m["method"].as_str().unwrap()).collect();
    assert_eq!(names, ["LBS of rest", "LBS", "network"]);
    let strain = &first[2]["raw"]["strain"];
    let [low, high] = [0, 1].map(|i| strain["interval"][i].as_f64().unwrap());
    assert!(low <= strain["mean"].as_f64().unwrap() && strain["mean"].as_f64().unwrap() <= high, "{strain}");
    let layers: Vec<u64> =
        study["layers"].as_array().unwrap().iter().map(|l| l["layers"].as_u64().unwrap()).collect();
    assert_eq!(layers, [1, 2, 3, 4, 5, 6, 7, 8, 12]);
    // One garment has nothing to untangle: the same strain as alone.
    assert_eq!(study["layers"][0]["strain"][0]["of_means"], 1.0);
    assert_eq!(study["layers"][0]["strain_alone"], study["layers"][0]["strain_worn"]);
    // The same model under another name finds the same on the same scenes.
    let ablations = study["ablations"].as_array().unwrap();
    assert_eq!(ablations.len(), 2);
    assert_eq!(ablations[0]["result"], ablations[1]["result"]);
    // The minimum is below everything it was compared with.
    for scene in study["pareto"]["samples"].as_array().unwrap() {
        let least = scene.as_array().unwrap().iter().map(|s| s["excess"].as_f64().unwrap());
        assert!(least.fold(f64::INFINITY, f64::min) >= -1e-9, "{scene}");
    }
    for extreme in study["extremes"].as_array().unwrap() {
        assert_eq!((&extreme["not_finite"], &extreme["refused"]), (&0.into(), &0.into()), "{extreme}");
    }
    let html = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(html.contains("Table 2") && html.contains("data:image/png;base64,"));
    assert!(
        !html.contains("src=\"http") && !html.contains("href="),
        "the page asks the network for something"
    );
    let markdown = fs::read_to_string(report.join("eval.md")).unwrap();
    assert!(markdown.contains("pareto.png") && report.join("pareto.png").is_file());

    // An evaluation is replaced, anything else is not.
    fs::write(folder.path().join("report").join("note.txt"), "mine").unwrap();
    for foreign in [None, Some("mine"), Some("{ \"mine\": 1 }")] {
        fs::remove_file(report.join("eval.json")).unwrap_or_default();
        if let Some(text) = foreign {
            fs::write(report.join("eval.json"), text).unwrap();
        }
        let output = arguments(&[]);
        assert_eq!(output.status.code(), Some(1));
        assert!(holds(&said(&output), "holds files that are no evaluation"), "{}", said(&output));
    }
    assert!(report.join("note.txt").is_file());
}

#[test]
fn a_file_in_the_place_of_the_report_is_told_before_anything_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("thesis.tex");
    fs::write(&file, "mine").unwrap();
    for output in [file.clone(), file.join("report")] {
        // The model is not there either: it would be missed first.
        let output = clothcombo(&["eval", "--checkpoint", "nowhere", "-o", output.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(1));
        assert!(holds(&said(&output), "thesis.tex is no folder"), "{}", said(&output));
    }
}
