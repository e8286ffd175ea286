//! The training framework: from a configuration to a trained model, from a model to draped garments, and the two programs.
//!
//! Rooms, from the ground up; each uses only those above it in this list:
//!
//! - [`system`]: what the machine provides: device, memory, threads, signals, paths.
//! - [`picture`]: meshes and numbers in, pictures out.
//! - [`config`]: TOML in, a checked [`Config`](config::Config) out.
//! - [`dataset`]: the configuration in, prepared scenes out.
//! - [`score`]: meshes in, the paper's energies and exact counts out.
//! - [`run`]: events in; the run's folder with checkpoints, logs, curves and report out.
//! - [`inference`]: a trained model, garments and a body in, draped garments out.
//! - [`evaluation`]: a trained model and a dataset in, tables and figures out.
//! - [`training`]: a configuration and a run folder in, a trained model out.
//! - [`cli`]: the command lines of the two programs.

pub mod cli;
pub mod config;
pub mod dataset;
pub mod evaluation;
pub mod inference;
pub mod picture;
pub mod run;
pub mod score;
pub mod system;
pub mod training;
