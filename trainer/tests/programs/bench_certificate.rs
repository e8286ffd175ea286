//! `clothcombo bench certificate` on a few tiny outfits.

use assert_cmd::Command;
use serde_json::Value;
use std::fs;

const CONFIG: &str = r#"
seed = 4
[data]
[[data.garments]]
generate = { count = 3, seed = 5, vertices = 300, categories = ["t_shirt", "trousers", "skirt"] }
[[stages]]
name = "all"
trains = "all"
steps = 2
"#;

#[test]
fn draws_are_counted_and_failures_listed() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tiny.toml"), CONFIG).unwrap();
    let run = |extra: &[&str]| {
        let mut command = Command::cargo_bin("clothcombo").unwrap();
        command.current_dir(folder.path()).args(["bench", "certificate", "--config", "tiny.toml"]);
        command.args(["--layers", "2", "--outfits", "4"]).args(extra);
        command.assert().success().get_output().stdout.clone()
    };
    let report: Value = serde_json::from_slice(&run(&["--json"])).unwrap();
    let outfits = report["outfits"].as_array().unwrap();
    assert_eq!((outfits.len(), report["all"]["outfits"].as_u64()), (4, Some(4)));
    let clear = |r: &&Value| {
        r["after"]["body_triangle_pairs"].as_u64().unwrap()
            + r["after"]["layer_triangle_pairs"].as_u64().unwrap()
            == 0
    };
    let share = outfits.iter().filter(clear).count() as f64 / 4.0;
    assert_eq!(report["all"]["clear_after"].as_f64(), Some(share));
    let in_the_end = report["clear_within"].as_array().unwrap().last().unwrap();
    assert_eq!(in_the_end["share"].as_f64(), Some(share), "{in_the_end}");
    let groups = ["in_one_go", "hardly_pinched"].map(|key| report[key]["outfits"].as_u64().unwrap());
    let belongs: [fn(&&Value) -> bool; 2] =
        [|r| r["steps"] == 0, |r| r["before"]["pinched_pairs"].as_u64().unwrap() < 200];
    assert_eq!(groups, belongs.map(|belongs| outfits.iter().filter(belongs).count() as u64));
    assert_eq!(report["failures"].as_array().unwrap().len(), outfits.iter().filter(|r| !clear(r)).count());
    assert_eq!(outfits[0]["garments"].as_array().unwrap().len(), 1);
    assert_eq!(outfits[1]["garments"].as_array().unwrap().len(), 2);

    // One outfit by itself is the same outfit, and its meshes can be looked at.
    let one: Value = serde_json::from_slice(&run(&["--json", "--only", "1", "--meshes", "meshes"])).unwrap();
    assert_eq!(one["outfits"][0]["after"], outfits[1]["after"]);
    for state in ["rest", "draped", "resolved"] {
        assert_eq!(fs::read_dir(folder.path().join("meshes/0001").join(state)).unwrap().count(), 2);
    }
    // Nor does it matter how many are resolved at a time, or on how many cores.
    let beside: Value = serde_json::from_slice(&run(&["--json", "--jobs", "3"])).unwrap();
    for (alone, beside) in outfits.iter().zip(beside["outfits"].as_array().unwrap()) {
        for key in ["outfit", "garments", "before", "after", "strain_added"] {
            assert_eq!(alone[key], beside[key], "{key}");
        }
    }
    let table = String::from_utf8(run(&[])).unwrap();
    assert!(
        table.contains("clear %") && table.contains("2 garments") && table.contains("in 600 s"),
        "{table}"
    );
}
