//! Training. In: a configuration, a dataset and a run folder. Out: events, checkpoints, a trained model.

pub mod average;
pub mod estimate;
pub mod guard;
pub mod incident;
pub mod learner;
pub mod measure;
pub mod process_group;
pub mod scenes;
pub mod schedule;
pub mod session;
pub mod step_record;
pub mod train_loop;
