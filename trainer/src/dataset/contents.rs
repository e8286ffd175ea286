//! What the scenes of a run are sampled from: body, garments, poses.

use super::active_joints::ActiveJoints;
use super::body::{body_source, load_body};
use super::data_list::DataList;
use super::error::DatasetError;
use super::garment_store::GarmentStore;
use super::poses::{HeldOut, PoseLibrary, Window};
use super::sizes::{DataSizes, reads_tests};
use super::split::GarmentSplit;
use crate::config::{Config, DataConfig};
use crate::system::lru_cache::MemoryBudget;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body, Pose, Provenance};
use clothcombo_data::cache::{Key, KeyBuilder, body_key};
use clothcombo_model::{Dimensions, Graph};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// What the scenes of a run are sampled from.
pub struct Dataset {
    /// The body model.
    pub body: Arc<Body>,
    /// Where the body comes from.
    pub body_source: Provenance,
    /// All garments, in source order.
    pub garments: GarmentStore,
    /// Which garments are trained on.
    pub split: GarmentSplit,
    /// Poses.
    pub poses: PoseLibrary,
    /// Which garments of a scene have layer losses with each other (`model.graph`).
    pub graph: Graph,
    /// How thick a garment is for those above it (m), if the networks ask.
    pub layer_thickness: Option<f64>,
    /// Memory for what is kept of garments and can be made again: garments of a streamed dataset, tensors, embeddings. A
    /// device with memory of its own has a budget of its own.
    pub memory: Arc<MemoryBudget>,
    /// Shape components sampled.
    pub shape_count: usize,
    /// Range every component is sampled from.
    pub shape_range: [f64; 2],
    /// Folder of the motions, if poses come from motions.
    motions: Option<PathBuf>,
    fingerprint: OnceLock<String>,
    list: OnceLock<DataList>,
}

/// Assets of one author under one licence.
#[derive(Clone, Debug, PartialEq)]
pub struct LicenceLine {
    /// `"body"`, `"garment"` or `"motion"`.
    pub kind: &'static str,
    /// Author, licence, and the source of the first of them; empty where unknown.
    pub from: Provenance,
    /// Number of assets.
    pub count: usize,
}

/// The split of a run by name.
#[derive(Clone, Debug, Serialize)]
pub struct SplitNames {
    /// Garments trained on.
    pub training_garments: Vec<String>,
    /// Garments scored during the run, never trained on.
    pub validation_garments: Vec<String>,
    /// Garments neither trained on nor scored during the run.
    pub test_garments: Vec<String>,
    /// Motion clips trained on, but for the windows held out of them and the margins around those.
    pub training_clips: Vec<String>,
    /// Windows held out of those clips, and short clips held out whole, scored during the run.
    pub validation_windows: Vec<Window>,
    /// Motion clips scored during the run, never trained on.
    pub validation_clips: Vec<String>,
    /// Motion clips neither trained on nor scored during the run.
    pub test_clips: Vec<String>,
}

/// What a fingerprint of this kind begins with; earlier ones looked at less, or split the poses otherwise.
const FINGERPRINT: &str = "4:";

/// Whether `text` is a [fingerprint](Dataset::fingerprint) as they are made now, and can be compared with another.
pub fn is_fingerprint(text: &str) -> bool {
    text.starts_with(FINGERPRINT)
}

/// `key` with the poses of every one of `parts`.
fn poses_key(mut key: KeyBuilder, parts: &[&[Pose]]) -> Key {
    for part in parts {
        key = key.number(part.len() as u64);
        for pose in *part {
            key = key.array(pose.rotations.as_flattened());
        }
    }
    key.finish()
}

impl Dataset {
    /// Loads and prepares everything `config` names. `progress(done, total, name)` is called per garment.
    ///
    /// # Errors
    /// [`DatasetError`] names the file or garment at fault.
    pub fn load(
        config: &Config,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, DatasetError> {
        Self::load_for(config, None, progress)
    }

    /// As [`load`](Self::load), for networks that see the joints of these names, whatever joints carry the garments.
    ///
    /// # Errors
    /// As [`load`](Self::load), and when the body lacks one of the joints.
    pub fn load_for(
        config: &Config,
        joints: Option<&[String]>,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, DatasetError> {
        DatasetError::check_inputs(config)?;
        let body = Arc::new(load_body(&config.data.body, config.data.shape_components)?);
        if body.joint_count() < BODY_JOINT_COUNT {
            return Err(DatasetError::few_joints(&body));
        }
        let shape_count = match config.data.shape_components {
            0 => body.shape_count,
            asked if asked <= body.shape_count => asked,
            asked => {
                return Err(DatasetError::new(
                    format!("data.shape_components = {asked}, but the body has {}", body.shape_count),
                    "use 0 to take all the body has",
                ));
            }
        };
        let poses = PoseLibrary::new(&config.data.poses, &body)?.with_bank(config);
        let memory = MemoryBudget::new(config.data.memory_limits());
        let garments = GarmentStore::load(config, body.clone(), joints, &memory, progress)?;
        let names: Vec<&str> = (0..garments.len()).map(|i| garments.info(i).name.as_str()).collect();
        let split = GarmentSplit::new(&names, &config.data)?;
        Ok(Self {
            body_source: body_source(&config.data.body),
            body,
            garments,
            split,
            poses,
            graph: config.model.graph,
            layer_thickness: config.layer_thickness(),
            memory,
            shape_count,
            shape_range: config.data.shape_range,
            motions: config.data.poses.motions.clone(),
            fingerprint: OnceLock::new(),
            list: OnceLock::new(),
        })
    }

    /// Which garments and clips are for what, by name: what a run writes down.
    pub fn split_names(&self) -> SplitNames {
        let names = |indices: &[usize]| indices.iter().map(|&i| self.garments.info(i).name.clone()).collect();
        let clips = self.poses.clips();
        SplitNames {
            training_garments: names(&self.split.training),
            validation_garments: names(&self.split.validation),
            test_garments: names(&self.split.test),
            training_clips: clips.training,
            validation_windows: clips.windows,
            validation_clips: clips.validation,
            test_clips: clips.test,
        }
    }

    /// A fingerprint of what scenes are sampled from: garments (name, category, mesh), body and every frame of the poses with
    /// what it is for. Equal data gives equal scenes.
    pub fn fingerprint(&self) -> &str {
        self.fingerprint.get_or_init(|| format!("{FINGERPRINT}{}", self.key()))
    }

    /// What the data consists of, by name.
    pub fn list(&self) -> &DataList {
        self.list.get_or_init(|| {
            DataList::of(&self.body, &self.garments, self.motions.as_deref(), &self.poses.clips())
        })
    }

    /// A fingerprint of what outfits in held-out windows are sampled from: garments, body, and the frames of the
    /// windows. Two models for which it is the same can be asked about the same outfits, whatever else their poses were
    /// split into.
    pub fn fingerprint_of_windows(&self) -> String {
        poses_key(self.assets(), &[self.poses.held_out(HeldOut::Windows)]).to_string()
    }

    fn key(&self) -> Key {
        poses_key(self.assets(), &self.poses.frames())
    }

    /// Body and garments.
    fn assets(&self) -> KeyBuilder {
        let body = &self.body;
        let mut key = KeyBuilder::new("data")
            .key(body_key(body))
            .array(body.joint_template.as_flattened())
            .array(&body.joint_shape_directions)
            .array(body.pose_directions.as_deref().unwrap_or_default())
            .number(self.shape_count as u64);
        for info in (0..self.garments.len()).map(|i| self.garments.info(i)) {
            key = key
                .text(&info.name)
                .text(info.category.name())
                .number(u64::from(info.holding))
                .key(info.mesh);
            // Data of one material has the key that it had before garments could have their own.
            if !info.material.is_empty() {
                key = key.text("material").text(&info.material.to_string());
            }
        }
        key
    }

    /// Under which terms the data may be used: body, garments, motions, one line per author and licence.
    pub fn licences(&self) -> Vec<LicenceLine> {
        let mut lines: Vec<LicenceLine> = Vec::new();
        let mut add = |kind: &'static str, from: &Provenance| {
            let same = |l: &&mut LicenceLine| {
                (l.kind, &l.from.author, &l.from.licence) == (kind, &from.author, &from.licence)
            };
            match lines.iter_mut().find(same) {
                Some(line) => line.count += 1,
                None => lines.push(LicenceLine { kind, from: from.clone(), count: 1 }),
            }
        };
        add("body", &self.body_source);
        (0..self.garments.len()).for_each(|i| add("garment", &self.garments.info(i).source));
        self.poses.sources().iter().for_each(|source| add("motion", source));
        lines
    }

    /// Input sizes of networks that are trained on it.
    pub fn dimensions(&self) -> Dimensions {
        let joints = self.joints().len();
        Dimensions { joints, shape: self.shape_count, pose: joints * self.poses.encoding.per_joint() }
    }

    /// What of it a run's memory depends on; `config` names the data.
    pub fn sizes(&self, config: &DataConfig) -> DataSizes {
        let tests = if reads_tests(config) { &self.split.test[..] } else { &[] };
        let read = self.split.training.iter().chain(&self.split.validation).chain(tests);
        let vertices = read.map(|i| self.garments.info(*i).vertices).collect();
        DataSizes { joints: self.joints().len(), ..DataSizes::of_body(vertices, &self.body) }
    }

    /// Joints the networks see.
    pub fn joints(&self) -> &ActiveJoints {
        self.garments.joints()
    }
}
