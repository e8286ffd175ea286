//! A run may move between devices: weights and moments go along, and the log says that the bits may differ.

use crate::resume::StopAfter;
use clothcombo_tests::tiny_config;
use clothcombo_trainer::dataset::Dataset;
use clothcombo_trainer::run::checkpoint::Checkpoint;
use clothcombo_trainer::run::event::Observer;
use clothcombo_trainer::run::folder::RunDir;
use clothcombo_trainer::run::observer::LogObserver;
use clothcombo_trainer::system::device::{DeviceChoice, name};
use clothcombo_trainer::system::stop::StopFlag;
use clothcombo_trainer::training::session::Session;
use clothcombo_trainer::training::train_loop::train;
use std::path::Path;
use std::sync::Arc;

/// Trains until `step`, with a log.
fn train_until(step: u64, session: &mut Session, root: &Path) {
    let stop = StopFlag::default();
    let log =
        LogObserver::new(&RunDir::follow(root), &session.device_name(), session.earlier_device()).unwrap();
    let mut observers: Vec<Box<dyn Observer>> = vec![Box::new(log), Box::new(StopAfter(step, stop.clone()))];
    train(session, &mut observers, &stop).unwrap();
}

#[test]
fn a_run_moves_between_the_devices_of_this_build_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &["validation.single_scenes=0", "validation.layered_scenes=0"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let root = folder.path().join("run");
    let log = || std::fs::read_to_string(root.join("log.txt")).unwrap();
    let opened = DeviceChoice::of_this_build().into_iter().filter_map(|choice| choice.open().ok());
    let devices: Vec<_> = opened.collect();

    let run = RunDir::create(&root, &config).unwrap();
    let mut session = Session::new(run.clone(), config.clone(), dataset.clone(), &devices[0]).unwrap();
    assert_eq!(session.earlier_device(), None);
    train_until(2, &mut session, &root);
    let mut step = 2;
    // Through all of them and back to the first.
    for pair in devices.iter().chain(&devices[..1]).collect::<Vec<_>>().windows(2) {
        let checkpoint = Checkpoint::open(&root).unwrap();
        assert_eq!(checkpoint.state.device_name(), name(pair[0]));
        let resumed = Session::resume(run.clone(), config.clone(), dataset.clone(), pair[1], &checkpoint);
        let mut session = resumed.unwrap();
        let earlier = name(pair[0]);
        assert_eq!(session.earlier_device(), Some(&*earlier).filter(|_| pair[0] != pair[1]));
        step += 2;
        train_until(step, &mut session, &root);
        assert!(log().contains(&format!("device: {}", name(pair[1]))), "{}", log());
    }
    assert_eq!(
        log().matches("its last bits may differ").count(),
        if devices.len() > 1 { devices.len() } else { 0 }
    );
}

#[test]
fn a_checkpoint_of_another_device_goes_on_with_a_note_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &["validation.single_scenes=0", "validation.layered_scenes=0"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let device = DeviceChoice::of_this_build()[0].open().unwrap();
    let end_of = |name: &str, earlier: Option<&str>| {
        let root = folder.path().join(name);
        let run = RunDir::create(&root, &config).unwrap();
        let mut session = Session::new(run.clone(), config.clone(), dataset.clone(), &device).unwrap();
        train_until(3, &mut session, &root);
        let mut checkpoint = Checkpoint::open(&root).unwrap();
        if let Some(earlier) = earlier {
            checkpoint.state = checkpoint.state.on_device(earlier);
        }
        let resumed = Session::resume(run, config.clone(), dataset.clone(), &device, &checkpoint);
        let mut session = resumed.unwrap();
        assert_eq!(session.earlier_device(), earlier);
        train_until(6, &mut session, &root);
        let last = Checkpoint::open(&root).unwrap();
        assert_eq!((last.state.step, last.state.device_name()), (6, &*session.device_name()));
        let log = std::fs::read_to_string(root.join("log.txt")).unwrap();
        (std::fs::read(last.path.join("model.safetensors")).unwrap(), log)
    };
    let (same, quiet) = end_of("same", None);
    let (moved, noted) = end_of("moved", Some("Some GPU (wgpu:7, Vulkan)"));
    assert!(same == moved, "where a checkpoint is from changes no number");
    let note = format!(
        "device: {}; the checkpoint was computed on Some GPU (wgpu:7, Vulkan): the run goes on, its last bits may differ",
        name(&device)
    );
    assert!(noted.contains(&note), "{noted}");
    assert!(!quiet.contains("may differ"), "{quiet}");
}
