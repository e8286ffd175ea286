//! `clothcombo eval` on a model of a few steps: every table is there, and what cannot work is said before the work.

use crate::common::{TINY, clothcombo, holds, said, start, tiny};
use clothcombo_data::asset::{Motion, Pose, Provenance};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// The tiny run with garments and clips of every set: of six generated garments three are for validation, two more are for the
/// test, one of which says that somebody else made it.
fn with_every_set(folder: &Path) -> PathBuf {
    let (motions, garments) = (folder.join("motions"), folder.join("garments"));
    fs::create_dir(&motions).unwrap();
    for (number, name) in ["walk", "dance", "jump"].into_iter().enumerate() {
        let pose = |frame: usize| {
            let mut rotations = vec![[0.0; 3]; 22];
            rotations[16 + number] = [0.3 * (0.05 * frame as f64).sin(), 0.0, 0.2];
            Pose { rotations }
        };
        let motion = Motion {
            name: name.into(),
            frame_rate: 30.0,
            poses: (0..400).map(pose).collect(),
            source: Provenance::default(),
        };
        motion.save(&motions.join(format!("{name}.npz"))).unwrap();
    }
    let path = garments.display().to_string();
    let made = clothcombo(&["generate", "--vertices", "200", "--start", "40", "--count", "2", "-o", &path]);
    assert!(made.status.success(), "{}", said(&made));
    let list = garments.join("garments.toml");
    let text = fs::read_to_string(&list).unwrap();
    let names: Vec<&str> =
        text.lines().filter_map(|line| Some(line.strip_prefix("name = \"")?.trim_end_matches('"'))).collect();
    assert_eq!(names.len(), 2, "{text}");
    let held_out = format!("held_out_garments = {names:?}");
    let generated = text.lines().find(|line| line.starts_with("source")).unwrap();
    fs::write(&list, text.replacen(generated, "source = \"a scan\"", 1)).unwrap();

    let config = TINY
        .replace(
            "poses = { max_self_intersection = 10.0 }",
            &format!(
                "{held_out}\nsplit = {{ validation = 0.22 }}\nposes = {{ max_self_intersection = 10.0, motions = {motions:?}, \
                 validation_clips = [\"dance\"], test_clips = [\"jump\"] }}\n[[data.garments]]\nfolder = {garments:?}"
            ),
        )
        .replace("count = 3", "count = 6");
    let file = folder.join("sets.toml");
    fs::write(&file, config).unwrap();
    file
}

#[cfg(unix)]
#[test]
fn a_killed_evaluation_leaves_nothing() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().unwrap();
    let (run, report) = (folder.path().join("run"), folder.path().join("deep/report"));
    assert!(start(&tiny(folder.path(), ""), &run, 2).status().unwrap().success());
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_clothcombo"));
    let command = command.args(["eval", "--quick", "--checkpoint"]).arg(&run).arg("-o").arg(&report);
    let mut eval = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    // The first part has begun.
    let lines = BufReader::new(eval.stderr.take().unwrap()).lines();
    assert!(lines.map_while(Result::ok).any(|line| line.contains(" s  ")));
    eval.kill().unwrap();
    eval.wait().unwrap();
    assert!(!folder.path().join("deep").exists());
}

fn names(list: &Value) -> Vec<&str> {
    list.as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

#[test]
fn a_quick_evaluation_holds_every_table_of_the_paper() {
    let folder = tempfile::tempdir().unwrap();
    let (run, report) = (folder.path().join("run"), folder.path().join("report"));
    assert!(start(&with_every_set(folder.path()), &run, 2).status().unwrap().success());
    let split: Value = serde_json::from_slice(&fs::read(run.join("split.json")).unwrap()).unwrap();
    let test_garments = names(&split["test_garments"]);
    assert_eq!((names(&split["validation_garments"]).len(), test_garments.len()), (3, 2), "{split}");
    assert_eq!(names(&split["training_clips"]), ["walk"]);
    assert_eq!(split["validation_windows"][0]["seconds"][0], 10.0);
    assert_eq!(
        (names(&split["validation_clips"]), names(&split["test_clips"])),
        (vec!["dance"], vec!["jump"])
    );
    let arguments = |extra: &[&str]| {
        let (run, report) = (run.to_str().unwrap(), report.to_str().unwrap());
        let own = ["eval", "--checkpoint", run, "--quick", "--quiet", "-o", report];
        clothcombo(&own.iter().chain(extra).copied().collect::<Vec<_>>())
    };
    let output = arguments(&["--ablation", &format!("twin={}", run.display())]);
    assert!(output.status.success(), "{}", said(&output));

    let read = || serde_json::from_slice::<Value>(&fs::read(report.join("eval.json")).unwrap()).unwrap();
    let eval = read();
    let evaluation = &eval["evaluation"];
    // Every set by itself: none mixes garments or poses that validation looked at with those that no run read.
    for key in ["training_garments", "validation_garments", "test_garments", "validation_clips", "test_clips"]
    {
        assert_eq!(evaluation["sets"][key], split[key], "{key}");
    }
    let methods = evaluation["methods"].as_array().unwrap();
    let sets: Vec<[&str; 2]> =
        methods.iter().map(|m| ["garments", "poses"].map(|k| m["set"][k].as_str().unwrap())).collect();
    let expected = [
        ["training", "windows"],
        ["training", "validation_clips"],
        ["training", "test_clips"],
        ["validation", "windows"],
        ["test", "windows"],
        ["independent_test", "windows"],
        ["test", "test_clips"],
    ];
    assert_eq!(sets, expected);
    let scan = &test_garments[..1];
    let garments: Vec<Vec<&str>> = methods.iter().map(|m| names(&m["garments"])).collect();
    assert_eq!(garments[3], names(&split["validation_garments"]));
    assert_eq!((&garments[4], &garments[6], &garments[5][..]), (&test_garments, &test_garments, scan));
    for set in methods {
        let strain = &set["methods"][2]["raw"]["strain"];
        for number in ["mean", "median"]
            .map(|key| &strain[key])
            .into_iter()
            .chain(strain["interval"].as_array().unwrap())
        {
            assert!(number.as_f64().unwrap() > 0.0, "{set}");
        }
        // The model's own form of the collision has another weight, margin and scale than the paper's.
        let network = &set["methods"][0];
        assert!(
            network["paper_collision"]["mean"] != network["weighted"]["body_collision"]["mean"],
            "{network}"
        );
    }
    let first = &evaluation["methods"][0]["methods"];
    let methods: Vec<&str> =
        first.as_array().unwrap().iter().map(|m| m["method"].as_str().unwrap()).collect();
    assert_eq!(methods, ["LBS", "LBS + shape transfer", "network"]);
    let embeddings = evaluation["embeddings"].as_array().unwrap();
    assert_eq!(embeddings.iter().map(|e| &e["set"]["garments"]).collect::<Vec<_>>(), ["training", "test"]);
    assert_eq!(embeddings[0]["kinds"].as_array().unwrap().len(), 3);
    let strain = &first[2]["raw"]["strain"];
    let [low, high] = [0, 1].map(|i| strain["interval"][i].as_f64().unwrap());
    assert!(low <= strain["mean"].as_f64().unwrap() && strain["mean"].as_f64().unwrap() <= high, "{strain}");
    let layers: Vec<u64> =
        evaluation["layers"].as_array().unwrap().iter().map(|l| l["layers"].as_u64().unwrap()).collect();
    assert_eq!(layers, [1, 2, 3, 4, 5, 6, 7, 8, 12]);
    // One garment has nothing to untangle.
    assert_eq!(evaluation["layers"][0]["strain"][0]["of_means"], 1.0);
    assert_eq!(
        evaluation["layers"][0]["strain_of_single_garments"],
        evaluation["layers"][0]["strain_in_outfit"]
    );
    // The same model under another name finds the same on the same scenes.
    let ablations = evaluation["ablations"].as_array().unwrap();
    assert_eq!(ablations.len(), 2);
    assert_eq!(ablations[0]["result"], ablations[1]["result"]);
    assert!(ablations[0]["result"]["self_collision"]["mean"].as_f64().unwrap() >= 0.0);
    // The minimum is below everything it was compared with.
    for scenes in ["single_garments", "outfits"] {
        for scene in evaluation["pareto"][scenes]["samples"].as_array().unwrap() {
            let least = scene.as_array().unwrap().iter().map(|s| s["excess"].as_f64().unwrap());
            assert!(least.fold(f64::INFINITY, f64::min) >= -1e-9, "{scene}");
        }
        // Every solution stopped for one of the reasons.
        let comparison = &evaluation["pareto"][scenes];
        let stops = comparison["stops"].as_object().unwrap();
        assert_eq!(stops.values().filter_map(Value::as_u64).sum::<u64>(), comparison["scenes"], "{stops:?}");
        assert_eq!(stops.get("converged").unwrap_or(&0.into()), &comparison["converged"]);
    }
    let numerics = evaluation["numerics"].as_array().unwrap();
    assert_eq!(numerics.len(), 7);
    assert!(numerics.iter().all(|choice| choice["milliseconds"].as_f64() > Some(0.0)), "{numerics:?}");
    assert!(numerics[1]["distance_mm"].as_f64() > Some(0.0) && numerics[0]["distance_mm"] == 0.0);
    for test in evaluation["stress_tests"].as_array().unwrap() {
        assert_eq!((&test["not_finite"], &test["refused"]), (&0.into(), &0.into()), "{test}");
    }
    let html = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(html.contains("Table 2") && html.matches("class=\"dot\"").count() > 20);
    for title in
        ["Test garments, test clips", "Independent test garments, held-out windows", "self-collision"]
    {
        assert!(html.contains(title), "{title}");
    }
    assert!(
        !html.contains("src=\"http") && !html.contains("href="),
        "the page asks the network for something"
    );
    let markdown = fs::read_to_string(report.join("eval.md")).unwrap();
    assert!(markdown.contains("pareto.png") && report.join("pareto.png").is_file());

    // A part by itself.
    assert!(arguments(&["--only", "numerics"]).status.success());
    let part = &read()["evaluation"];
    assert!(part["numerics"].is_array() && part["methods"].is_null() && part["pareto"].is_null(), "{part}");

    // Random outfits are another part, for which their number is given; their meshes can be looked at.
    assert!(evaluation["certificates"].is_null(), "{evaluation}");
    let meshes = folder.path().join("meshes");
    let outfits = ["--only", "certificates", "--outfits", "3", "--meshes", meshes.to_str().unwrap()];
    let output = arguments(&outfits);
    assert!(output.status.success(), "{}", said(&output));
    let certificates = &read()["evaluation"]["certificates"];
    let outfits = certificates["outfits"].as_array().unwrap();
    let garments = |outfit: &Value| names(&outfit["garments"]).len();
    assert_eq!(outfits.iter().map(garments).collect::<Vec<_>>(), [1, 2, 3]);
    let count_after = |holds: &dyn Fn(&Value) -> bool| outfits.iter().filter(|o| holds(o)).count() as u64;
    let is_clear =
        |o: &Value| o["after"]["body_triangle_pairs"] == 0 && o["after"]["layer_triangle_pairs"] == 0;
    let groups = certificates["groups"].as_array().unwrap();
    let group = |name: &str| groups.iter().find(|group| group["name"] == name);
    assert_eq!(group("all").unwrap()["outfits"], 3);
    assert_eq!(group("all").unwrap()["intersection_free"][1]["count"], count_after(&is_clear));
    assert!(group("2 garments").is_some() && group("4 garments").is_none(), "{groups:?}");
    let feasible = group("feasible orders").map_or(0, |group| group["outfits"].as_u64().unwrap());
    assert_eq!(feasible, count_after(&|outfit| outfit["is_feasible"] == true));
    for state in ["rest", "draped", "resolved"] {
        assert_eq!(fs::read_dir(meshes.join("0001").join(state)).unwrap().count(), 2);
    }

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
fn a_file_in_the_place_of_the_report_is_an_error_before_anything_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("thesis.tex");
    fs::write(&file, "mine").unwrap();
    for output in [file.clone(), file.join("report")] {
        // The model is not there either: it would be missed first.
        let output = clothcombo(&["eval", "--checkpoint", "nowhere", "-o", output.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(2));
        assert!(holds(&said(&output), "thesis.tex is a file, not a folder"), "{}", said(&output));
    }
}
