//! `clothcombo bench stability` prints one row per case and says with its exit code whether every case keeps the invariant.

use crate::common::assert_fails;
use assert_cmd::Command;
use serde_json::Value;

fn bench(extra: &[&str]) -> std::process::Output {
    let mut command = Command::cargo_bin("clothcombo").unwrap();
    command.env("NO_COLOR", "1").args(["bench", "stability"]).args(extra).output().unwrap()
}

#[test]
fn prints_one_row_per_case_and_one_per_term() {
    let output = bench(&["--case", "hinge"]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{table}{}", String::from_utf8_lossy(&output.stderr));
    for name in ["hinge angle 0", "hinge angle pi", "collapsed hinge edge"] {
        let row =
            table.lines().find(|line| line.starts_with(name)).unwrap_or_else(|| panic!("{name}\n{table}"));
        assert!(row.contains("yes") && row.ends_with("kept"), "{row}");
    }
    for term in ["strain", "layer_distance"] {
        assert!(table.lines().any(|line| line.starts_with(term)), "{term}\n{table}");
    }
}

#[test]
fn json_holds_every_term_and_the_message_of_a_refused_case() {
    let output = bench(&["--json", "--case", "triangle"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let whole: Value = serde_json::from_slice(&output.stdout).unwrap();
    let cases = whole["cases"].as_array().unwrap();
    let case = cases.iter().find(|case| case["name"] == "needle rest triangles").unwrap();
    assert_eq!(case["terms"].as_object().unwrap().len(), 8);
    assert!(case["terms"]["strain"]["gradient_error"].as_f64().unwrap() <= 1e-6);
    assert!(case["faults"].as_array().unwrap().is_empty());

    let output = bench(&["--json", "--case", "repeated"]);
    assert!(output.status.success());
    let whole: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(whole["cases"][0]["error"].as_str().unwrap().contains("face 20 uses vertex"));
}

#[test]
fn an_unknown_case_or_body_is_one_clear_message() {
    for (arguments, words) in [
        (["--case", "no such thing"], ["no such thing", "hinge angle 0"]),
        (["--body", "nobody.npz"], ["nobody.npz", "nobody"]),
    ] {
        let output = bench(&arguments);
        assert_fails(&output, 1, &words);
    }
}
