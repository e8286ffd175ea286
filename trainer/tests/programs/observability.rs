//! Report, event files, table of runs, and what the programs print.

use crate::common::{clothcombo, holds, said, start, tiny};
use std::fs;
use std::path::Path;
use std::process::Command;

fn trained(folder: &Path, name: &str) -> std::path::PathBuf {
    let config = tiny(folder, "");
    let run = folder.join(name);
    let pictures = ["--set", "output.sample_scenes=1"];
    assert!(start(&config, &run, 2).args(pictures).status().unwrap().success());
    run
}

/// All tags of `html` in order, without their attributes; what has no end is left out.
fn tags(html: &str) -> Vec<&str> {
    const EMPTY: [&str; 3] = ["!DOCTYPE", "meta", "img"];
    html.split('<')
        .skip(1)
        .filter(|t| !t.split('>').next().unwrap().ends_with('/'))
        .map(|t| t.split([' ', '>']).next().unwrap())
        .filter(|t| !EMPTY.contains(t))
        .collect()
}

#[test]
fn the_report_is_whole_and_needs_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let run = trained(folder.path(), "run");
    let html = std::fs::read_to_string(run.join("report.html")).unwrap();

    // Every tag is closed in order.
    let mut open = Vec::new();
    for tag in tags(&html) {
        match tag.strip_prefix('/') {
            Some(end) => assert_eq!(open.pop(), Some(end)),
            None => open.push(tag),
        }
    }
    assert!(open.is_empty(), "{open:?}");
    for outside in ["http:", "https:", "src=\"/", "href=", "url(", "@import", "<script"] {
        assert!(!html.contains(outside), "{outside}");
    }

    // Every figure is there and has a curve through real numbers.
    let terms = [
        "strain",
        "bending",
        "gravity",
        "body_collision",
        "repulsion",
        "holding",
        "layer_collision",
        "layer_distance",
    ];
    for id in terms.iter().copied().chain(["loss", "grad_norm", "lr"]) {
        let start = html.find(&format!("<figure id=\"chart-{id}\">")).unwrap_or_else(|| panic!("{id}"));
        let figure = &html[start..start + html[start..].find("</figure>").unwrap()];
        let curve = figure.split("class=\"curve\" d=\"").nth(1).unwrap().split('"').next().unwrap();
        assert!(curve.matches('L').count() > 10, "{id}: {curve}");
        assert_eq!(figure.contains("class=\"baseline\""), terms.contains(&id), "{id}");
        assert_eq!(figure.matches("class=\"stage\"").count(), 3, "{id}");
    }
    assert_eq!(html.matches("id=\"chart-time\"").count(), 1);
    assert!(html.matches("class=\"part").count() >= 10);
    let picture = html.split("data:image/png;base64,").nth(1).expect("a sample").split('"').next().unwrap();
    assert!(picture.starts_with("iVBORw0KGgo") && picture.len() > 10_000);
    for words in [
        "finished",
        "60 of 60",
        "CC0-1.0",
        "siren_width = 16",
        "Validation after step 60",
        "LBS + shape transfer",
        "peak memory",
    ] {
        assert!(html.contains(words), "{words}");
    }
    assert!(!html.contains("http-equiv"), "a finished page does not look for news");
}

#[test]
fn runs_are_compared_in_a_table_and_as_json() {
    let folder = tempfile::tempdir().unwrap();
    trained(folder.path(), "first");
    trained(folder.path(), "second");
    std::fs::create_dir(folder.path().join("no run")).unwrap();
    let path = folder.path().display().to_string();
    let table = clothcombo(&["runs", &path]);
    let text = String::from_utf8(table.stdout).unwrap();
    assert_eq!(text.lines().count(), 3, "{text}");
    assert!(text.lines().skip(1).all(|l| l.contains("finished") && l.contains("60/60") && l.contains("all")));
    let json = clothcombo(&["runs", &path, "--json", "--sort", "score"]);
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(runs.len(), 2);
    assert!(runs[0]["best_score"].as_f64().unwrap() > 0.0 && runs[0]["checkpoint"] == 60);
    assert_eq!(runs[0]["best_score"], runs[1]["best_score"], "the same configuration is the same run");
    let nothing = clothcombo(&["runs", &folder.path().join("no run").display().to_string()]);
    assert!(nothing.status.code() == Some(1) && holds(&said(&nothing), "holds no run"));
    let missing = clothcombo(&["runs", &folder.path().join("missing").display().to_string()]);
    assert!(missing.status.code() == Some(1) && holds(&said(&missing), "cannot list"), "{}", said(&missing));

    // A damaged run is shown beside the others.
    std::fs::write(folder.path().join("first/config.toml"), "seed = ").unwrap();
    let text = String::from_utf8(clothcombo(&["runs", &path]).stdout).unwrap();
    let row = text.lines().find(|line| line.starts_with("first")).unwrap();
    assert!(row.contains("unreadable") && text.lines().count() == 3, "{text}");
    let json = clothcombo(&["runs", &path, "--json", "--sort", "score"]);
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!((&runs[0]["name"], &runs[1]["state"]), (&"second".into(), &"unreadable".into()));
    assert!(!runs[1]["error"].as_str().unwrap().is_empty());
}

#[test]
fn away_from_a_terminal_there_are_plain_lines_and_quiet_is_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = |name: &str, more: &[&str], log: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"))
            .arg("--config")
            .arg(&config)
            .arg("--run-dir")
            .arg(folder.path().join(name))
            .args(more)
            .env("RUST_LOG", log)
            .env_remove("NO_COLOR")
            .output()
            .unwrap();
        assert!(output.status.success());
        assert!(output.stdout.is_empty(), "a log is no data");
        String::from_utf8(output.stderr).unwrap()
    };
    let plain = run("plain", &[], "warn");
    assert!(!plain.contains('\u{1b}') && !plain.contains('\r'), "{plain:?}");
    for words in
        ["run folder", "memory: about", "stage untangling: 20 steps from step 20", "finished after step 60"]
    {
        assert!(plain.contains(words), "{words}: {plain}");
    }
    assert_eq!(run("quiet", &["--quiet"], "error"), "");
    let verbose = run("verbose", &["--quiet"], "info");
    assert!(verbose.contains("INFO") && !verbose.contains('\u{1b}'), "{verbose:?}");
}

#[test]
fn spikes_of_the_gradient_are_counted_and_stand_in_the_log_alone() {
    let folder = tempfile::tempdir().unwrap();
    // What is usual already counts as one.
    let config = tiny(folder.path(), "[guard]\nspike_factor = 0.5\n");
    let root = folder.path().join("run");
    let run = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"))
            .args(arguments)
            .args(["--run-dir", &root.display().to_string()])
            .env_remove("RUST_LOG")
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", said(&output));
        said(&output)
    };
    let count = |text: &str| text.lines().filter(|line| line.contains("gradient norm")).count();
    let log = || std::fs::read_to_string(root.join("log.txt")).unwrap();
    let marked = || {
        let metrics = std::fs::read_to_string(root.join("metrics.jsonl")).unwrap();
        metrics.matches("\"spike\":true").count()
    };

    let first = run(&["--config", &config.display().to_string(), "--set", "output.metrics_every=1000"]);
    let spikes = count(&log());
    assert!(spikes > 5, "no spike, no test: {}", log());
    assert_eq!(count(&first), 0, "{first}");
    let last = first.lines().last().unwrap();
    assert!(
        last.starts_with("finished after step 60")
            && last.contains(&format!("{spikes} spikes of the gradient")),
        "{last}"
    );
    assert!(last.ends_with("log.txt"), "{last}");
    assert_eq!(marked(), spikes, "every one is in the metrics");

    // Those of the sessions before count.
    let longer = ["--set", "stages.2.steps=21", "--allow-config-change", "stages", "--resume"];
    let again = run(&longer);
    assert!(again.lines().last().unwrap().contains(&format!("{} spikes", marked())), "{again}");
    assert!(log().contains("session starts after step 60 of 61") && log().contains("finished after step 60"));
    let runs = clothcombo(&["runs", &root.display().to_string(), "--json"]);
    let runs: Vec<serde_json::Value> = serde_json::from_slice(&runs.stdout).unwrap();
    assert_eq!(runs[0]["spikes"], marked());
}

#[test]
fn the_schema_is_json_and_the_plan_names_its_stages() {
    let schema = clothcombo(&["config", "schema"]);
    // The one that editors find through the first line of a configuration is the same: `clothcombo config schema > configs/schema.json`.
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    assert!(
        fs::read(configs.join("schema.json")).unwrap() == schema.stdout,
        "configs/schema.json is not of this program"
    );
    for file in fs::read_dir(&configs).unwrap().map(|entry| entry.unwrap().path()) {
        if file.extension().is_some_and(|e| e == "toml") {
            assert!(
                fs::read_to_string(&file).unwrap().starts_with("#:schema schema.json\n"),
                "{}",
                file.display()
            );
        }
    }
    let schema: serde_json::Value = serde_json::from_slice(&schema.stdout).unwrap();
    assert!(schema["properties"]["stages"].is_object());
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let path = config.display().to_string();
    let plan = clothcombo(&["config", "check", &path, "--timed-steps", "2"]);
    let text = String::from_utf8(plan.stdout).unwrap();
    for words in [
        "60 steps",
        "\"untangling\": 20 steps, 20 to 40",
        "0 → 1 (0–50 %)",
        "2 to 3",
        "ms/step",
        "layer_distance",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    std::fs::write(&config, "seed = 1\nstagse = []\n").unwrap();
    let wrong = clothcombo(&["config", "check", &path]);
    assert!(wrong.status.code() == Some(1) && holds(&said(&wrong), "stagse"));
}

#[test]
fn shells_and_man_know_both_programs_and_logs_can_be_json() {
    for shell in ["bash", "zsh", "fish"] {
        let text = String::from_utf8(clothcombo(&["completions", shell]).stdout).unwrap();
        assert!(text.contains("no-resolve") && text.contains("allow-config-change"), "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man1");
    assert!(clothcombo(&["manual", "-o", &pages.display().to_string()]).status.success());
    for page in ["clothcombo.1", "clothcombo-drape.1", "clothcombo-train.1"] {
        assert!(fs::read_to_string(pages.join(page)).unwrap().contains("SYNOPSIS"), "{page}");
    }
    let config = tiny(folder.path(), "");
    let checked =
        clothcombo(&["config", "check", &config.display().to_string(), "--log-format", "json", "-vv"]);
    let log = said(&checked);
    let lines: Vec<&str> = log.lines().filter(|line| line.starts_with('{')).collect();
    assert!(!lines.is_empty(), "{log}");
    for line in lines {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        assert!(line["level"].is_string() && line["fields"]["message"].is_string(), "{line}");
    }
}
