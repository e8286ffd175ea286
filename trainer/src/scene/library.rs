//! What a run draws its scenes from: body, garments, poses.

use super::active_joints::ActiveJoints;
use super::error::LibraryError;
use super::poses::PoseLibrary;
use super::split::{GarmentSplit, SplitNames};
use super::wardrobe::Wardrobe;
use crate::config::Config;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body, BodyFileSettings};
use clothcombo_data::generate::mannequin;
use std::path::Path;
use std::sync::Arc;

/// What a run draws its scenes from.
pub struct Library {
    /// The body model.
    pub body: Arc<Body>,
    /// All garments, in source order.
    pub wardrobe: Wardrobe,
    /// Which garments are trained on.
    pub split: GarmentSplit,
    /// Poses.
    pub poses: PoseLibrary,
    /// Memory for garments of a streamed wardrobe, on the host and again on the device [bytes].
    pub memory_limit: usize,
    /// Shape components drawn.
    pub shape_count: usize,
    /// Range every component is drawn from.
    pub shape_range: [f64; 2],
}

/// Reads `"mannequin"` or a body npz with at most `shape_components` components (0: all it has).
///
/// # Errors
/// When the file is not a body model.
pub fn load_body(name: &str, shape_components: usize) -> Result<Body, LibraryError> {
    let settings = match shape_components {
        0 => BodyFileSettings { shape_components: usize::MAX },
        limit => BodyFileSettings { shape_components: limit },
    };
    match name {
        "mannequin" => Ok(mannequin()),
        path => Body::load(Path::new(path), &settings).map_err(LibraryError::data),
    }
}

impl Library {
    /// Loads and prepares everything `config` names. `progress(done, total, name)` is called per garment.
    ///
    /// # Errors
    /// [`LibraryError`] names the file or garment at fault.
    pub fn load(
        config: &Config,
        progress: &(dyn Fn(usize, usize, &str) + Sync),
    ) -> Result<Self, LibraryError> {
        let body = Arc::new(load_body(&config.data.body, config.data.shape_components)?);
        if body.joint_count() < BODY_JOINT_COUNT {
            return Err(LibraryError::FewJoints { name: body.name.clone(), joints: body.joint_count() });
        }
        let shape_count = match config.data.shape_components {
            0 => body.shape_count,
            asked if asked <= body.shape_count => asked,
            asked => return Err(LibraryError::ShapeComponents { asked, available: body.shape_count }),
        };
        let poses = PoseLibrary::new(&config.data.poses, &body)?;
        let wardrobe = Wardrobe::load(config, body.clone(), progress)?;
        let names: Vec<&str> = (0..wardrobe.len()).map(|i| wardrobe.card(i).name.as_str()).collect();
        let split = GarmentSplit::new(&names, &config.data)?;
        Ok(Self {
            body,
            wardrobe,
            split,
            poses,
            memory_limit: config.data.memory_limit(),
            shape_count,
            shape_range: config.data.shape_range,
        })
    }

    /// Which garments and clips are for what, by name: what a run writes down.
    pub fn split_names(&self) -> SplitNames {
        let names = |indices: &[usize]| indices.iter().map(|&i| self.wardrobe.card(i).name.clone()).collect();
        let [training_clips, unseen_clips] = self.poses.clips();
        SplitNames {
            training_garments: names(&self.split.training),
            validation_garments: names(&self.split.validation),
            test_garments: names(&self.split.test),
            training_clips: training_clips.to_vec(),
            unseen_clips: unseen_clips.to_vec(),
        }
    }

    /// Joints the networks see.
    pub fn joints(&self) -> &ActiveJoints {
        self.wardrobe.joints()
    }
}
