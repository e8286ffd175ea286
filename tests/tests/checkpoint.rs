//! A checkpoint stands alone, and a damaged one is never loaded.

use burn::store::{ModuleSnapshot, SafetensorsStore};
use clothcombo_tests::tiny_config;
use clothcombo_trainer::checkpoint::{Checkpoint, CheckpointError};
use clothcombo_trainer::device::Backend;
use clothcombo_trainer::run_dir::RunDir;
use clothcombo_trainer::scene::Library;
use clothcombo_trainer::session::Session;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

/// A checkpoint of the untrained networks of the fixture.
fn saved(folder: &tempfile::TempDir) -> PathBuf {
    let config = tiny_config(folder.path(), &["validation.single_scenes=0", "validation.layered_scenes=0"]);
    let library = Arc::new(Library::load(&config, &|_, _, _| {}).unwrap());
    let run = RunDir::create(&folder.path().join("run"), &config).unwrap();
    Session::new(run, config, library, &Backend::preferred().device()).unwrap().save().unwrap()
}

#[test]
fn it_restores_the_networks_from_nothing_but_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let path = saved(&folder);
    let elsewhere = folder.path().join("copied");
    fs::rename(&path, &elsewhere).unwrap();

    let checkpoint = Checkpoint::open(&elsewhere).unwrap();
    let config = checkpoint.config().unwrap();
    let model = checkpoint.model(&config, &Backend::preferred().device()).unwrap();
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
    fs::write(path.join("state.json"), state.replace("\"format\": 1", "\"format\": 99")).unwrap();
    assert!(Checkpoint::open(&path).unwrap_err().to_string().contains("version 99"));
    fs::write(path.join("state.json"), &state[..state.len() / 2]).unwrap();
    assert!(matches!(Checkpoint::open(&path), Err(CheckpointError::Unusable { .. })));
    fs::remove_file(path.join("state.json")).unwrap();
    assert!(matches!(Checkpoint::open(&path), Err(CheckpointError::Missing { .. })));
}
