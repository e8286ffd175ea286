//! A run on disk. In: the events of a training, snapshots of its networks. Out: the run's folder with its lock, checkpoints,
//! metrics, logs, curves and report, and what a later program reads of it.

pub mod checkpoint;
pub mod difference;
pub mod error;
pub mod event;
pub mod folder;
pub mod lock;
pub mod memory;
pub mod observer;
pub mod report;
pub mod spread;
pub mod summary;
pub mod validation;
