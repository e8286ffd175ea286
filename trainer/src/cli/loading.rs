//! Loading data under a progress bar.

use super::verbosity::progress_bar;
use crate::config::Config;
use crate::dataset::{Dataset, DatasetError, PoseLibrary};
use std::sync::Arc;

/// Runs `prepare` under a bar. `prepare` gets a callback that takes the garments done, all garments and the name of one.
pub(super) fn under_preparation_bar<T>(prepare: impl FnOnce(&(dyn Fn(usize, usize, &str) + Sync)) -> T) -> T {
    let bar = progress_bar(0, "preparing garments {bar:30} {pos}/{len} {msg}");
    prepare(&|done, total, name| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(name.to_owned());
    })
}

/// Makes the bank of training poses under a bar, if there is to be one.
pub(super) fn make_pose_bank(poses: &PoseLibrary) {
    let bar = progress_bar(0, "making poses {bar:30} {pos}/{len}");
    poses.make_bank(&|done, total| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    });
}

/// Loads the data of `config` under a bar.
///
/// # Errors
/// Names the garment or file at fault.
pub(super) fn load_dataset(config: &Config) -> Result<Arc<Dataset>, DatasetError> {
    load_dataset_for(config, None)
}

/// As [`load_dataset`], for networks that see the joints of these names.
///
/// # Errors
/// As [`load_dataset`].
pub(super) fn load_dataset_for(
    config: &Config,
    joints: Option<&[String]>,
) -> Result<Arc<Dataset>, DatasetError> {
    under_preparation_bar(|progress| Dataset::load_for(config, joints, progress)).map(Arc::new)
}
