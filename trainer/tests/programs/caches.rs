//! A cache saves time. One that cannot be used costs time and one warning, and nothing else.

use crate::common::{clothcombo, said, tiny};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Trains a few steps with the cache in `cache` and returns what was said.
fn train(config: &Path, run: &str, cache: &Path) -> String {
    let run = config.with_file_name(run);
    let cache = format!("data.cache.folder={:?}", cache.display().to_string());
    let steps =
        ["stages.0.steps=1", "stages.1.steps=1", "stages.2.steps=1"].map(|set| ["--set", set]).concat();
    let mut command = Command::new(env!("CARGO_BIN_EXE_clothcombo-train"));
    command.arg("--config").arg(config).arg("--run-dir").arg(&run).args(["--set", &cache]).args(steps);
    let output = command.env("NO_COLOR", "1").output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    said(&output)
}

fn records(cache: &Path) -> Vec<PathBuf> {
    let shelves = std::fs::read_dir(cache).unwrap().flatten().map(|shelf| shelf.path());
    shelves.flat_map(|shelf| std::fs::read_dir(shelf).unwrap().flatten().map(|file| file.path())).collect()
}

fn warnings(said: &str) -> Vec<&str> {
    said.lines().filter(|line| line.contains("WARN") && line.contains("cache")).collect()
}

#[test]
fn training_goes_on_without_a_cache_it_cannot_use() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    for (run, cache) in [("a", file.join("cache")), ("b", file)] {
        let said = train(&config, run, &cache);
        let [warning] = warnings(&said)[..] else { panic!("{said}") };
        assert!(warning.contains("going on without a cache"), "{warning}");
    }
}

#[test]
fn cut_records_are_one_warning_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let cache = folder.path().join("cache");
    assert!(warnings(&train(&config, "a", &cache)).is_empty());
    let whole = records(&cache);
    for record in &whole {
        let length = std::fs::metadata(record).unwrap().len();
        std::fs::File::options().write(true).open(record).unwrap().set_len(length / 2).unwrap();
    }
    let said = train(&config, "b", &cache);
    let [warning] = warnings(&said)[..] else { panic!("{said}") };
    assert!(warning.contains("removed, computed anew"), "{warning}");
    assert!(warnings(&train(&config, "c", &cache)).is_empty());
    assert_eq!(records(&cache).len(), whole.len());
}

#[test]
fn draping_goes_on_without_a_cache_it_cannot_use() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    std::fs::write(at("file"), "").unwrap();
    let body = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/default/body.npz");
    let made = clothcombo(&[
        "generate",
        "--count",
        "1",
        "--vertices",
        "250",
        "--categories",
        "skirt",
        "--body",
        body,
        "-o",
        &at("g"),
    ]);
    assert!(made.status.success(), "{}", said(&made));
    let checkpoint = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/default");
    let garment = at("g/skirt_000000.obj");
    let drape = |more: &[&str]| {
        let scene =
            ["drape", "--checkpoint", checkpoint, "--body", body, "--no-resolve", "--garments", &garment];
        clothcombo(&[&scene[..], more].concat())
    };
    let output = drape(&["--cache", &at("file/cache"), "-o", &at("out")]);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(warnings(&said(&output)).len(), 1, "{}", said(&output));
    assert!(folder.path().join("out/report.json").exists());
}
