//! Is the data still that of the checkpoint a run continues from, and may it be another?

use crate::dataset::{DataChange, Dataset, is_fingerprint};
use crate::run::checkpoint::{Checkpoint, CheckpointState};
use crate::run::difference::{AllowedChanges, listed};
use miette::{Report, miette};

/// What of `dataset` is not as it was at `checkpoint`; empty where all is.
///
/// # Errors
/// When something changed that `allowed` does not cover, or that networks cannot go on with.
pub(super) fn changed_data(
    checkpoint: &Checkpoint,
    dataset: &Dataset,
    allowed: &AllowedChanges,
) -> Result<Vec<DataChange>, Report> {
    let (found, expected) = (&checkpoint.state, CheckpointState::of(dataset, 0));
    let sizes = found.changed_sizes(&expected, "checkpoint");
    if !sizes.is_empty() {
        return Err(miette!(
            help = "networks keep the inputs they were made for: restore data.body, data.shape_components and \
                    data.poses.encoding, or start a new run",
            "the data does not fit the networks of checkpoint {}:{}",
            checkpoint.path.display(),
            listed(sizes)
        ));
    }
    let Some(fingerprint) = found.data.as_ref().filter(|data| is_fingerprint(data)) else {
        tracing::warn!(
            "checkpoint {} cannot tell whether the data is still the same",
            checkpoint.path.display()
        );
        return Ok(Vec::new());
    };
    if Some(fingerprint) == expected.data.as_ref() {
        return Ok(Vec::new());
    }
    let mut changes = checkpoint.data().map_or_else(Vec::new, |before| dataset.list().changes_since(&before));
    if changes.is_empty() {
        let text = "what the garments and clips are for, or their order".to_owned();
        changes.push(DataChange { key: "data", text });
    }
    let refused: Vec<&DataChange> = changes.iter().filter(|change| !allowed.touches(change.key)).collect();
    if refused.is_empty() {
        return Ok(changes);
    }
    let mut keys: Vec<&str> = refused.iter().map(|change| change.key).collect();
    keys.dedup();
    Err(miette!(
        help = format!(
            "restore the data, go on with it as it is with --allow-config-change {}, or start a new run",
            keys.join(",")
        ),
        "the data is not that of checkpoint {}:{}",
        checkpoint.path.display(),
        listed(refused.iter().map(|change| &change.text))
    ))
}
