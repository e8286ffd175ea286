//! Memory: what is streamed stays within its limits, and garments that no machine holds are refused before anything is made.

use crate::common::{clothcombo, holds, said, start, tiny, with_small_networks};
use clothcombo_data::asset::Provenance;
use clothcombo_data::generate::mannequin;
use std::path::Path;

/// The mannequin as a body of 300 shape components, its own over and over: as many as SMPL-X has.
fn body_of_300_components(path: &Path) {
    let mut body = mannequin();
    let k = body.shape_count;
    let repeated = |row: &[f32]| (0..300).map(|i| row[i % k] / 40.0).collect::<Vec<f32>>();
    body.shape_directions = body.shape_directions.chunks_exact(k).flat_map(repeated).collect();
    let repeated = |row: &[f64]| (0..300).map(|i| row[i % k] / 40.0).collect::<Vec<f64>>();
    body.joint_shape_directions = body.joint_shape_directions.chunks_exact(k).flat_map(repeated).collect();
    body.shape_count = 300;
    body.save(path, &Provenance::default()).unwrap();
}

/// `count` garments on a body of 300 shape components, without shape transfer as in `configs/paper.toml`.
fn config(folder: &Path, count: usize, vertices: usize) -> std::path::PathBuf {
    let body = folder.join("body.npz");
    body_of_300_components(&body);
    let text = with_small_networks(&format!(
        r#"
seed = 5
[data]
body = {body:?}
poses = {{ max_self_intersection = 10.0 }}
memory_mib = 40
cache = {{ folder = {cache:?} }}
[[data.garments]]
generate = {{ count = {count}, seed = 5, vertices = {vertices}, categories = ["t_shirt", "trousers", "skirt", "top"] }}
[start]
smooth_weights = false
shape_transfer = false
[[stages]]
name = "single"
trains = "single"
steps = 24
[validation]
single_scenes = 4
layered_scenes = 0
[output]
sample_scenes = 0
"#,
        cache = folder.join("cache"),
    ));
    let file = folder.join("config.toml");
    std::fs::write(&file, text.replace("eigen_count = 8", "eigen_count = 64")).unwrap();
    file
}

/// Peak of the resident memory and its estimate (MiB) as the report of a run says them.
#[cfg(target_os = "linux")]
fn peak_and_estimate(run: &Path) -> [f64; 2] {
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    let tile = page.split("<small>peak memory</small><b>").nth(1).unwrap().split("</b>").next().unwrap();
    let size = |text: &str| {
        let (number, unit) = text.trim().split_once(' ').unwrap();
        number.parse::<f64>().unwrap() * if unit == "GiB" { 1024.0 } else { 1.0 }
    };
    let (peak, estimate) = tile.split_once("(estimated").unwrap();
    [size(peak), size(estimate.trim_end_matches(')'))]
}

/// Garments that take 150 MiB in memory with their tensors, and 230 MiB more where shape displacements that nobody uses are
/// stored, within 40.
#[test]
#[cfg(target_os = "linux")]
fn a_cached_start_and_its_steps_stay_within_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let output = start(&config(folder.path(), 26, 2500), &run, 1).output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let [peak, estimate] = peak_and_estimate(&run);
    println!("peak {peak} MiB, estimated {estimate} MiB");
    // Program, networks, a body of 300 components and its file, the preparation of one garment, scenes: 110 MiB.
    assert!(peak < 110.0 + 40.0 + 50.0, "{peak} MiB");
    assert!((0.8..1.3).contains(&(estimate / peak)), "{estimate} MiB expected, {peak} MiB used");
}

#[test]
fn garments_that_no_machine_holds_are_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny(folder.path(), "");
    let run = folder.path().join("run");
    let more = [
        "--set",
        "data.garments.0.generate.count=1000000",
        "--set",
        "data.garments.0.generate.vertices=19000",
    ];
    let output = start(&config, &run, 1).args(more).output().unwrap();
    let message = said(&output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    for words in ["1000000 garments take about", "are available", "data.cache.folder"] {
        assert!(holds(&message, words), "{words:?} is missing in: {message}");
    }
    assert!(!run.exists(), "nothing is left behind");
    // The check of the configuration says how much it would be, and refuses as well.
    let check = clothcombo(&[&["config", "check", &config.display().to_string()], &more[..]].concat());
    let table = String::from_utf8_lossy(&check.stdout);
    assert!(table.contains("all garments, for want of data.cache.folder"), "{table}");
    assert!(holds(&said(&check), "data.cache.folder"), "{}", said(&check));
}

#[test]
fn memory_is_stated_for_garments_that_are_not_at_hand() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/paper.toml");
    let check =
        |more: &[&str]| clothcombo(&[&["config", "check", &paper.display().to_string()], more].concat());
    let garments = ["--garments", "4300", "--vertices", "8000", "--shape-components", "300"];
    let cached = ["--set", "data.cache.folder=\"somewhere\""];
    let output = check(&[&garments[..], &cached].concat());
    assert!(output.status.success(), "{}", said(&output));
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(table.contains("4300 garments of 8000 vertices on average, 300 shape components"), "{table}");
    let together = table.lines().find(|line| line.trim_start().starts_with("together")).unwrap();
    let sizes: Vec<f64> = together
        .split_whitespace()
        .zip(together.split_whitespace().skip(1))
        .filter(|(_, unit)| ["GiB", "MiB"].contains(unit))
        .map(|(size, unit)| size.parse::<f64>().unwrap() / if unit == "MiB" { 1024.0 } else { 1.0 })
        .collect();
    let [host, device, _] = sizes[..] else { panic!("{together}") };
    assert!(host < 64.0 / 1.0737 && device < 24.0 / 1.0737, "{together}");

    let output = check(&["--garments", "4300"]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
}
