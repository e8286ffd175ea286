//! A checkpoint stands alone, and a damaged one is never loaded.

use burn::store::{ModuleSnapshot, SafetensorsStore};
use clothcombo_tests::{fuzz_cases, tiny_config};
use clothcombo_trainer::dataset::Dataset;
use clothcombo_trainer::run::checkpoint::{Checkpoint, CheckpointError};
use clothcombo_trainer::run::folder::RunDir;
use clothcombo_trainer::system::device::default_device;
use clothcombo_trainer::training::session::Session;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checkpoint of the untrained networks of the fixture.
fn saved(folder: &tempfile::TempDir) -> PathBuf {
    let config = tiny_config(folder.path(), &["validation.single_scenes=0", "validation.layered_scenes=0"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let run = RunDir::create(&folder.path().join("run"), &config).unwrap();
    Session::new(run, config, dataset, &default_device()).unwrap().save().unwrap()
}

#[test]
fn it_restores_the_networks_from_nothing_but_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(&folder);
    let elsewhere = folder.path().join("copied");
    fs::rename(&path, &elsewhere).unwrap();

    // A colleague who may read the configuration may read the parameters.
    let may = |file: &str| fs::metadata(elsewhere.join(file)).unwrap().permissions();
    assert_eq!(may("model.safetensors"), may("config.toml"));

    let checkpoint = Checkpoint::open(&elsewhere).unwrap();
    let config = checkpoint.config().unwrap();
    let model = checkpoint.model(&config, &default_device()).unwrap();
    // Both stored forms hold the same parameters, under the same names.
    let again = folder.path().join("again.safetensors");
    let mut store = SafetensorsStore::from_file(&again)
        .clear_metadata()
        .metadata("clothcombo_step", checkpoint.state.step.to_string());
    model.save_into(&mut store).unwrap();
    assert!(fs::read(&again).unwrap() == fs::read(elsewhere.join("model.safetensors")).unwrap());
}

#[test]
fn every_damaged_file_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(&folder);
    for file in ["model.safetensors", "model.bpk", "optimizer.bpk", "config.toml"] {
        let whole = fs::read(path.join(file)).unwrap();
        let mut flipped = whole.clone();
        let middle = flipped.len() / 2;
        flipped[middle] ^= 1;
        for damaged in [flipped, whole[..middle].to_vec()] {
            fs::write(path.join(file), damaged).unwrap();
            let error = Checkpoint::open(&path).unwrap_err();
            assert!(error.to_string().contains(file), "{error}");
        }
        fs::write(path.join(file), whole).unwrap();
    }
    assert!(Checkpoint::open(&path).is_ok());

    let state = fs::read_to_string(path.join("state.json")).unwrap();
    fs::write(path.join("state.json"), state.replace("\"format\": 2", "\"format\": 99")).unwrap();
    assert!(Checkpoint::open(&path).unwrap_err().to_string().contains("version 99"));
    fs::write(path.join("state.json"), &state[..state.len() / 2]).unwrap();
    assert!(matches!(Checkpoint::open(&path), Err(CheckpointError::Unusable { .. })));
    fs::remove_file(path.join("state.json")).unwrap();
    assert!(matches!(Checkpoint::open(&path), Err(CheckpointError::Missing { .. })));
}

const FILES: [&str; 6] =
    ["model.safetensors", "model.bpk", "optimizer.bpk", "config.toml", "data.json", "state.json"];

/// Damages one file of `checkpoint` at random so that it changes, and says how.
fn damage(checkpoint: &Path, rng: &mut ChaCha8Rng) -> String {
    let file = FILES[rng.random_range(0..FILES.len())];
    let path = checkpoint.join(file);
    let mut bytes = fs::read(&path).unwrap();
    let at = rng.random_range(0..bytes.len());
    let how = match rng.random_range(0..6) {
        0 | 1 => {
            bytes[at] ^= 1 << rng.random_range(0..8);
            "one bit flipped"
        }
        2 => {
            bytes.truncate(at);
            "cut off"
        }
        3 => {
            let end = (at + rng.random_range(1..=4096)).min(bytes.len());
            bytes[at..end].iter_mut().for_each(|b| *b = !*b);
            "a block inverted"
        }
        4 => {
            bytes.insert(at, rng.random());
            "a byte inserted"
        }
        _ => {
            fs::remove_file(&path).unwrap();
            return format!("{file} removed");
        }
    };
    fs::write(&path, bytes).unwrap();
    format!("{file} {how} at {at}")
}

#[test]
fn a_thousand_damaged_checkpoints_are_all_noticed_and_the_older_whole_one_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let whole = saved(&folder);
    let run = folder.path().join("run");
    let newest = run.join("checkpoints/step-00000009");
    let kept: Vec<Vec<u8>> = FILES.iter().map(|f| fs::read(whole.join(f)).unwrap()).collect();
    fs::create_dir(&newest).unwrap();
    let (cases, seed) = fuzz_cases(1000);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..cases {
        FILES.iter().zip(&kept).for_each(|(file, bytes)| fs::write(newest.join(file), bytes).unwrap());
        let how = damage(&newest, &mut rng);
        assert!(Checkpoint::open(&newest).is_err(), "{how}");
        assert_eq!(Checkpoint::open(&run).unwrap().path, whole, "{how}");
    }
    FILES.iter().zip(&kept).for_each(|(file, bytes)| fs::write(newest.join(file), bytes).unwrap());
    assert_eq!(Checkpoint::open(&run).unwrap().path, newest);
}

#[test]
fn files_of_two_whole_checkpoints_do_not_mix() {
    let folder = tempfile::tempdir().unwrap();
    let first = saved(&folder);
    let other = tempfile::tempdir().unwrap();
    let config =
        tiny_config(other.path(), &["seed=4", "validation.single_scenes=0", "validation.layered_scenes=0"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let run = RunDir::create(&other.path().join("run"), &config).unwrap();
    let second = Session::new(run, config, dataset, &default_device()).unwrap().save().unwrap();
    fs::copy(second.join("model.bpk"), first.join("model.bpk")).unwrap();
    assert!(Checkpoint::open(&first).unwrap_err().to_string().contains("model.bpk"));
}
