//! A run that is interrupted and continued equals one that never stopped, bit for bit.

use clothcombo_tests::tiny_config;
use clothcombo_trainer::config::Config;
use clothcombo_trainer::device::Backend;
use clothcombo_trainer::event::{Observer, TrainEvent};
use clothcombo_trainer::run_dir::RunDir;
use clothcombo_trainer::scene::Library;
use clothcombo_trainer::session::Session;
use clothcombo_trainer::stop::StopFlag;
use clothcombo_trainer::train_loop::train;
use std::path::Path;
use std::sync::Arc;

/// Asks for a stop once `after` steps are done.
struct StopAfter(u64, StopFlag);

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

fn run(config: &Config, library: &Arc<Library>, folder: &Path, resume: bool, stop_after: Option<u64>) {
    let device = Backend::preferred().device();
    let mut session = if resume {
        let run = RunDir::resume(folder, config).unwrap();
        Session::resume(run, config.clone(), library.clone(), &device).unwrap()
    } else {
        let run = RunDir::create(folder, config).unwrap();
        Session::new(run, config.clone(), library.clone(), &device).unwrap()
    };
    let stop = StopFlag::default();
    let mut observers: Vec<Box<dyn Observer>> = Vec::new();
    if let Some(step) = stop_after {
        observers.push(Box::new(StopAfter(step, stop.clone())));
    }
    train(&mut session, &mut observers, &stop).unwrap();
}

#[test]
fn thirty_steps_resume_thirty_steps_equal_sixty() {
    let folder = tempfile::tempdir().unwrap();
    let config = tiny_config(folder.path(), &[]);
    let library = Arc::new(Library::load(&config, &|_, _, _| {}).unwrap());
    let (whole, parts) = (folder.path().join("whole"), folder.path().join("parts"));

    run(&config, &library, &whole, false, None);
    // Step 30 lies inside the second stage, whose first stage is frozen: the resumed run must freeze the same weights.
    run(&config, &library, &parts, false, Some(30));
    assert!(!parts.join("checkpoints/step-00000060").exists());
    run(&config, &library, &parts, true, None);

    let read = |run: &Path| std::fs::read(run.join("checkpoints/step-00000060/model.safetensors")).unwrap();
    assert!(read(&whole) == read(&parts), "the parameters differ");
}
