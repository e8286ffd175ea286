//! What a checkpoint says about itself, sealed against damage.

use crate::dataset::Dataset;
use crate::system::device::FLEX;
use crate::system::exact::Exact;
use clothcombo_model::Dimensions;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of the layout; newer ones are refused. Version 1 had no seal, no best score and no incidents: it is still read.
pub(super) const STATE_FORMAT: u32 = 2;
const UNSEALED: u32 = 1;

/// What a checkpoint says about itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointState {
    /// Layout version.
    pub format: u32,
    /// Steps done.
    pub step: u64,
    /// Joints the networks see, in order.
    pub joints: Vec<String>,
    /// Shape components.
    pub shape_count: usize,
    /// Length of the pose feature.
    pub pose_features: usize,
    /// Fingerprint of the garments, the body and the poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data: Option<String>,
    /// The best validation so far.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best: Option<BestValidation>,
    /// Recent steps that were skipped because their loss or gradient was not finite.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub incidents: Vec<u64>,
    /// Name of the device it was computed on, where that is another than the usual [`FLEX`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
    /// BLAKE3 checksum of each file.
    pub checksums: BTreeMap<String, String>,
}

/// The best validation of a run so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BestValidation {
    /// Steps done when it was taken.
    pub step: u64,
    /// Its score: mean total loss of the networks, mean over the groups of scenes; less is better.
    pub score: Exact,
}

impl CheckpointState {
    /// A state of the current format without checksums.
    pub fn new(step: u64, joints: Vec<String>, shape_count: usize, pose_features: usize) -> Self {
        Self {
            format: STATE_FORMAT,
            step,
            joints,
            shape_count,
            pose_features,
            data: None,
            best: None,
            incidents: Vec::new(),
            device: None,
            checksums: BTreeMap::new(),
        }
    }

    /// Of networks for `dataset` after `step` steps, without checksums.
    pub fn of(dataset: &Dataset, step: u64) -> Self {
        let names = dataset.joints().indices.iter().map(|&j| dataset.body.joint_names[j].clone());
        let mut state = Self::new(step, names.collect(), dataset.shape_count, dataset.dimensions().pose);
        state.data = Some(dataset.fingerprint().to_owned());
        state
    }

    /// The same, computed on the device of this name.
    #[must_use]
    pub fn on_device(mut self, name: &str) -> Self {
        self.device = (name != FLEX).then(|| name.to_owned());
        self
    }

    /// Name of the device it was computed on.
    pub fn device_name(&self) -> &str {
        self.device.as_deref().unwrap_or(FLEX)
    }

    /// Input sizes of the networks.
    pub fn dimensions(&self) -> Dimensions {
        Dimensions { joints: self.joints.len(), shape: self.shape_count, pose: self.pose_features }
    }

    /// In which inputs of the networks those of `data` differ from its own, in words; `what` it is of.
    pub fn changed_sizes(&self, data: &Self, what: &str) -> Vec<String> {
        let sizes = |state: &Self| {
            let counts = [state.shape_count, state.pose_features].map(|count| count.to_string());
            [[state.joints.join(", ")].as_slice(), &counts].concat()
        };
        let names = ["joints", "shape components", "numbers of a pose"];
        let sizes = names.into_iter().zip(sizes(data).into_iter().zip(sizes(self)));
        let changed = sizes.filter(|(_, (now, before))| now != before);
        changed.map(|(name, (now, before))| format!("{name}: {now} now; {before} in the {what}")).collect()
    }

    /// As text, with the checksum of that text as its last line.
    pub(super) fn sealed(&self) -> Result<String, serde_json::Error> {
        let text = serde_json::to_string_pretty(self)?;
        let body = text.strip_suffix("\n}").unwrap_or(&text);
        Ok(format!("{body}{}", seal(body)))
    }

    /// Reads what [`sealed`](Self::sealed) or an older program wrote.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let damaged = |e: serde_json::Error| format!("is damaged: {e}");
        let mut tree: serde_json::Value = serde_json::from_str(text).map_err(damaged)?;
        match tree["format"].as_u64() {
            Some(version) if version == u64::from(STATE_FORMAT) => {
                let whole = text.rfind(SEAL_KEY).is_some_and(|at| text[at..] == seal(&text[..at]));
                if !whole {
                    return Err("does not match its own checksum".into());
                }
                tree.as_object_mut().map(|map| map.remove("seal"));
            }
            // A sealed text whose version was damaged has keys that version 1 does not know.
            Some(version) if version == u64::from(UNSEALED) && tree.get("seal").is_none() => {}
            Some(version) => {
                return Err(format!(
                    "has version {version}, this program reads versions {UNSEALED} and {STATE_FORMAT}"
                ));
            }
            None => {
                return Err(format!(
                    "has no version, this program reads versions {UNSEALED} and {STATE_FORMAT}"
                ));
            }
        }
        serde_json::from_value(tree).map_err(damaged)
    }
}

const SEAL_KEY: &str = ",\n  \"seal\": \"";

/// The end of the file whose text so far is `body`.
fn seal(body: &str) -> String {
    format!("{SEAL_KEY}{}\"\n}}\n", blake3::hash(body.as_bytes()).to_hex())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> CheckpointState {
        let mut state = CheckpointState::new(120, vec!["pelvis".into(), "spine".into()], 10, 198);
        state.best = Some(BestValidation { step: 100, score: Exact(0.1 + 0.2) });
        state.checksums.insert("model.bpk".into(), "ab".into());
        state
    }

    #[test]
    fn reads_what_it_wrote_and_no_single_changed_byte_of_it() {
        let text = state().sealed().unwrap();
        let again = CheckpointState::read(&text).unwrap();
        assert_eq!((again.step, again.best), (120, state().best));
        assert_eq!(again.sealed().unwrap(), text);
        for at in 0..text.len() {
            for flip in [1_u8, 2, 4, 8, 16, 32, 64, 128] {
                let mut bytes = text.clone().into_bytes();
                bytes[at] ^= flip;
                let read = String::from_utf8(bytes).map(|t| CheckpointState::read(&t).is_ok());
                assert_ne!(read, Ok(true), "byte {at} ^ {flip}");
            }
            assert!(CheckpointState::read(&text[..at]).is_err(), "cut at {at}");
        }
    }

    #[test]
    fn version_1_is_read_and_others_are_refused_by_number() {
        let old = r#"{ "format": 1, "step": 7, "joints": ["pelvis"], "shape_count": 2, "pose_features": 9, "checksums": {} }"#;
        assert_eq!(CheckpointState::read(old).unwrap().step, 7);
        for (found, said) in [("99", "version 99"), ("\"x\"", "no version")] {
            let error = CheckpointState::read(&old.replace("\"format\": 1", &format!("\"format\": {found}")));
            assert!(error.unwrap_err().contains(said));
        }
        let text = state().sealed().unwrap().replace("\"format\": 2", "\"format\": 1");
        assert!(CheckpointState::read(&text).is_err());
    }
}
