//! The training framework: configuration, objective, schedule, loop, checkpoints, evaluation, and the two programs.

pub mod allocator;
pub mod checkpoint;
pub mod cli;
pub mod config;
pub mod device;
pub mod drape;
pub mod evaluate;
pub mod event;
pub mod learner;
pub mod measure;
pub mod objective;
pub mod observer;
pub mod picture;
pub mod run_dir;
pub mod samples;
pub mod scene;
pub mod schedule;
pub mod score;
pub mod session;
pub mod stop;
pub mod train_loop;
