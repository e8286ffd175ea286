//! A run that is interrupted and continued equals one that never stopped, bit for bit.

use clothcombo_data::format::obj;
use clothcombo_tests::tiny_config;
use clothcombo_trainer::config::Config;
use clothcombo_trainer::dataset::{Dataset, ValidationGroup};
use clothcombo_trainer::evaluation::ValidationSet;
use clothcombo_trainer::run::checkpoint::{Checkpoint, TrainedModel};
use clothcombo_trainer::run::difference::AllowedChanges;
use clothcombo_trainer::run::event::{Observer, TrainEvent};
use clothcombo_trainer::run::folder::RunDir;
use clothcombo_trainer::system::device::default_device;
use clothcombo_trainer::system::stop::StopFlag;
use clothcombo_trainer::training::session::Session;
use clothcombo_trainer::training::train_loop::train;
use std::path::Path;
use std::sync::Arc;

/// Asks for a stop once `after` steps are done.
pub struct StopAfter(pub u64, pub StopFlag);

impl Observer for StopAfter {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), miette::Report> {
        if let TrainEvent::Step(record) = event
            && record.step == self.0
        {
            self.1.request();
        }
        Ok(())
    }
}

/// Cannot write at step `.0`.
struct FailsAt(u64);

impl Observer for FailsAt {
    fn observe(&mut self, event: &TrainEvent) -> Result<(), miette::Report> {
        match event {
            TrainEvent::Step(record) if record.step == self.0 => Err(miette::miette!("the disk is full")),
            _ => Ok(()),
        }
    }
}

fn run(config: &Config, dataset: &Arc<Dataset>, folder: &Path, resume: bool, stop_after: Option<u64>) {
    let device = default_device();
    let mut session = if resume {
        let run = RunDir::resume(folder, config, &[]).unwrap();
        let checkpoint = Checkpoint::open(folder).unwrap();
        Session::resume(run, config.clone(), dataset.clone(), &device, &checkpoint).unwrap()
    } else {
        let run = RunDir::create(folder, config).unwrap();
        Session::new(run, config.clone(), dataset.clone(), &device).unwrap()
    };
    let stop = StopFlag::default();
    let mut observers: Vec<Box<dyn Observer>> = Vec::new();
    if let Some(step) = stop_after {
        observers.push(Box::new(StopAfter(step, stop.clone())));
    }
    train(&mut session, &mut observers, &stop).unwrap();
}

fn read(run: &Path, file: &str) -> Vec<u8> {
    std::fs::read(run.join("checkpoints/step-00000060").join(file)).unwrap()
}

/// Trains in one go and in parts that end after each of `stops`; the final checkpoints must be the same.
fn parts_equal_the_whole(overrides: &[&str], stops: &[u64], files: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), overrides);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));
    run(&config, &dataset, &whole, false, None);
    for (i, stop) in stops.iter().enumerate() {
        run(&config, &dataset, &parts, i > 0, Some(*stop));
        assert!(!parts.join("checkpoints/step-00000060").exists());
        assert!(parts.join(format!("checkpoints/step-{stop:08}")).exists());
    }
    run(&config, &dataset, &parts, true, None);
    for file in files {
        assert!(read(&whole, file) == read(&parts, file), "{file} differs");
    }
    let state = |run: &Path| Checkpoint::open(&run.join("checkpoints/step-00000060")).unwrap().state;
    assert_eq!(state(&whole).best, state(&parts).best);
    assert_eq!(state(&whole).incidents, state(&parts).incidents);
    assert!(state(&whole).best.is_some());
}

#[test]
fn stopped_inside_every_stage_and_between_them() {
    // Step 30 lies inside the second stage, whose first stage is frozen: the resumed run must freeze the same weights.
    parts_equal_the_whole(&["validation.every=7"], &[11, 20, 30, 40, 53], &["model.safetensors"]);
}

#[test]
fn with_an_average_warm_up_a_curriculum_and_several_scenes_a_step() {
    let overrides = [
        "optimizer.ema_decay=0.9",
        "stages.0.warm_up_steps=15",
        "stages.1.accumulate=2",
        "stages.2.accumulate=3",
        "stages.1.layer_curriculum=0.6",
        "losses.strain.weight={ from = 0.5, to = 2.0, start = 0.2, end = 0.8, shape = \"cosine\" }",
    ];
    parts_equal_the_whole(&overrides, &[11, 30, 45], &["model.safetensors"]);
}

#[test]
fn skipped_steps_are_remembered() {
    let overrides =
        ["guard.inject={ every = 7, what = \"position\" }", "guard.kept_incidents=1", "validation.every=10"];
    parts_equal_the_whole(&overrides, &[14, 35], &["model.safetensors"]);
}

#[test]
fn a_run_starts_from_another_ones_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &["stages.0.steps=5"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let first = folder.path().join("first");
    run(&config, &dataset, &first, false, Some(5));
    // The numbers behind the header, which holds the step as well.
    let parameters = |checkpoint: &Path| {
        let bytes = std::fs::read(checkpoint.join("model.safetensors")).unwrap();
        let header = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        bytes[8 + header..].to_vec()
    };

    let further = |name: &str, overrides: &[&str]| {
        let init = format!("init_from={:?}", first.display().to_string());
        let overrides: Vec<&str> = [init.as_str()].into_iter().chain(overrides.iter().copied()).collect();
        let config = tiny_config(folder.path(), &overrides);
        let run = RunDir::create(&folder.path().join(name), &config).unwrap();
        Session::new(run, config, dataset.clone(), &default_device())
    };
    let session = further("second", &["seed=9"]).unwrap();
    assert!(parameters(&session.save().unwrap()) == parameters(&first.join("checkpoints/step-00000005")));

    let refused = further("third", &["model.width=24"]).err().expect("other sizes do not fit");
    assert!(refused.to_string().contains("init_from"), "{refused}");
}

#[test]
fn a_further_run_draws_other_scenes_and_can_be_scored_on_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let first = tiny_config(folder.path(), &[]);
    let dataset = Dataset::load(&first, &|_, _, _| {}).unwrap();
    let scored = |overrides: &[&str]| {
        let set = ValidationSet::new(&dataset, &tiny_config(folder.path(), overrides));
        [ValidationGroup::Single, ValidationGroup::Layered].map(|group| set.samples(group).to_vec())
    };
    let same = format!("validation.seed={}", first.seed);
    let [other, known] = [scored(&["seed=9"]), scored(&["seed=9", &same])];
    assert!(known.iter().all(|group| !group.is_empty()));
    assert_eq!(known, scored(&[]));
    assert_ne!(known, other);
}

#[test]
fn what_was_trained_is_kept_when_something_beside_it_fails() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &[]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let place = folder.path().join("run");
    let run = RunDir::create(&place, &config).unwrap();
    let device = default_device();
    let mut session = Session::new(run, config.clone(), dataset.clone(), &device).unwrap();
    let mut observers: Vec<Box<dyn Observer>> = vec![Box::new(FailsAt(7))];
    let error = train(&mut session, &mut observers, &StopFlag::default()).unwrap_err();
    assert!(error.to_string().contains("disk is full"), "{error}");
    let kept = Checkpoint::open(&place).unwrap();
    assert_eq!(kept.state.step, 7);
    assert_eq!(Session::resume(RunDir::follow(&place), config, dataset, &device, &kept).unwrap().step(), 7);
}

#[test]
fn a_run_does_not_go_on_with_other_data() {
    let folder = tempfile::tempdir().unwrap();
    let generated = Dataset::load(&tiny_config(folder.path(), &[]), &|_, _, _| {}).unwrap();
    let names: Vec<String> = (0..2)
        .map(|index| {
            let garment = generated.garments.garment(index).unwrap();
            let name = format!("garment_{index}.obj");
            let rest = &garment.garment.rest;
            obj::save(&folder.path().join(&name), rest.positions(), rest.faces(), &[]).unwrap();
            name
        })
        .collect();
    let config = tiny_config(
        folder.path(),
        &[&format!("data.garments=[{{folder={:?}}}]", folder.path()), "stages.0.steps=5"],
    );
    let load = |category: &str| {
        let entry = |name: &String| format!("[[garment]]\nfile = {name:?}\ncategory = {category:?}\n");
        let manifest: String = names.iter().map(entry).collect();
        std::fs::write(folder.path().join("garments.toml"), manifest).unwrap();
        let joints =
            Checkpoint::open(&folder.path().join("run")).ok().map(|checkpoint| checkpoint.state.joints);
        Arc::new(Dataset::load_for(&config, joints.as_deref(), &|_, _, _| {}).unwrap())
    };
    let place = folder.path().join("run");
    run(&config, &load("dress"), &place, false, Some(5));
    let resume = |dataset: Arc<Dataset>, allowed: &[&str]| {
        let checkpoint = Checkpoint::open(&place).unwrap();
        let device = default_device();
        let allowed: Vec<String> = allowed.iter().map(|key| (*key).to_owned()).collect();
        let allowed = AllowedChanges::new(&allowed, &[&config]).unwrap();
        let run = RunDir::follow(&place).allowing(allowed);
        Session::resume(run, config.clone(), dataset, &device, &checkpoint)
    };
    assert_eq!(resume(load("dress"), &[]).unwrap().step(), 5);
    // Skin weights are smoothed farther on a dress.
    for allowed in [&[][..], &["data.poses"]] {
        let refused = resume(load("top"), allowed).err().expect("another category has other skin weights");
        let refused = format!("{refused} {}", refused.help().unwrap());
        let words =
            ["garment garment_0: top", "dress", "in the checkpoint", "--allow-config-change data.garments"];
        assert!(words.iter().all(|word| refused.contains(word)), "{refused}");
    }
    assert_eq!(resume(load("top"), &["data"]).unwrap().step(), 5, "it may");
}

#[test]
fn garments_that_were_trained_on_before_they_were_held_out_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &["stages.0.steps=5"]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let first = folder.path().join("first");
    run(&config, &dataset, &first, false, Some(5));
    let trained = TrainedModel::open(&first).unwrap();
    assert!(trained.known_of_held_out(&config, &dataset).is_empty());

    let name = dataset.garments.info(dataset.split.training[0]).name.clone();
    let config = tiny_config(folder.path(), &[&format!("data.held_out_garments=[{name:?}]")]);
    let dataset = Dataset::load(&config, &|_, _, _| {}).unwrap();
    let known = trained.known_of_held_out(&config, &dataset);
    assert!(known.len() == 1 && known[0].contains(&name), "{known:?}");
}
