//! A trained model, apart from the run that made it.

use super::{
    CONFIG, CheckpointError, CheckpointState, MODEL_EXCHANGE, newest, other_networks, read_state, verify,
};
use crate::config::{Config, PoseConfig, load};
use crate::dataset::{ClipSplit, Dataset, GarmentPurpose, purpose};
use burn::store::{ModuleSnapshot, SafetensorsStore};
use burn::tensor::Device;
use clothcombo_model::{ClothCombo, Initializer, ModelConfig};
use std::path::{Path, PathBuf};

/// Trained networks for use, not for training on: `model.safetensors`, `config.toml` and `state.json` of a checkpoint,
/// whatever else lies beside them. A model that is handed on needs no more than these three files.
#[derive(Clone, Debug)]
pub struct TrainedModel {
    /// Its folder.
    pub folder: PathBuf,
    /// What it says about itself.
    pub state: CheckpointState,
    /// The configuration it was trained with.
    pub config: Config,
}

impl TrainedModel {
    /// Opens a run, a checkpoints folder, one checkpoint, or a `model.safetensors` with its two companions.
    ///
    /// # Errors
    /// When there is none, or one of the three files is missing, damaged or of another version.
    pub fn open(path: &Path) -> Result<Self, CheckpointError> {
        let path = match path.file_name().is_some_and(|name| name == MODEL_EXCHANGE) && path.is_file() {
            true => path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new(".")),
            false => path,
        };
        newest(path, u64::MAX, |folder| {
            let files = [MODEL_EXCHANGE, CONFIG];
            let state = read_state(folder, &files)?;
            files.iter().try_for_each(|file| verify(folder, &state, file))?;
            let config = load(&folder.join(CONFIG), &[])?;
            Ok(Self { folder: folder.to_owned(), state, config })
        })
    }

    /// Where its configuration lies.
    pub fn config_file(&self) -> PathBuf {
        self.folder.join(CONFIG)
    }

    /// The networks, on `device`.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn networks(&self, device: &Device) -> Result<ClothCombo, CheckpointError> {
        let unusable = |reason: String| CheckpointError::Unusable { path: self.folder.clone(), reason };
        let mut model = ClothCombo::new(&self.config.model, &self.state.dimensions(), 0, device)
            .map_err(|e| unusable(e.to_string()))?;
        let mut store = SafetensorsStore::from_file(self.folder.join(MODEL_EXCHANGE));
        let applied = model.load_from(&mut store).map_err(|e| unusable(format!("{MODEL_EXCHANGE}: {e}")))?;
        match applied.errors.first() {
            Some(error) => Err(unusable(format!("{MODEL_EXCHANGE}: {error}"))),
            None => Ok(model),
        }
    }

    /// Whether the networks know what `dataset` is made of: its joints in their order, shape components and pose features.
    ///
    /// # Errors
    /// Names the model when they do not.
    pub fn check_fits(&self, dataset: &Dataset) -> Result<(), CheckpointError> {
        let (expected, found) = (CheckpointState::of(dataset, 0), &self.state);
        let fits = (&found.joints, found.shape_count, found.pose_features)
            == (&expected.joints, expected.shape_count, expected.pose_features);
        let reason = || {
            format!(
                "it was trained for {} joints, {} shape components and {} pose features, the data has {}, {} and {} (or other \
                 joints)",
                found.joints.len(),
                found.shape_count,
                found.pose_features,
                expected.joints.len(),
                expected.shape_count,
                expected.pose_features
            )
        };
        if fits {
            Ok(())
        } else {
            Err(CheckpointError::Foreign { path: self.folder.clone(), reason: reason() })
        }
    }

    /// What `config` holds out of `dataset`, its data, although these networks were trained on it, or what it keeps for the
    /// test although the validation of their run looked at it, in words: scores would be those of known garments or poses.
    /// Only where the garments come from the same sources, or the motions from the same folder, is that known.
    pub fn known_of_held_out(&self, config: &Config, dataset: &Dataset) -> Vec<String> {
        let mut found = Vec::new();
        let (trained, data) = (&self.config.data, &config.data);
        let known = |garments: &[usize], was: GarmentPurpose| -> Vec<&str> {
            let names = garments.iter().map(|&garment| dataset.garments.info(garment).name.as_str());
            names.filter(|name| purpose(name, trained) == was).collect()
        };
        let held_out = [dataset.split.validation.as_slice(), &dataset.split.test].concat();
        if trained.garments == data.garments {
            for (names, what) in [
                (known(&held_out, GarmentPurpose::Training), "was trained on held-out garments"),
                (known(&dataset.split.test, GarmentPurpose::Validation), "was validated on test garments"),
            ] {
                if !names.is_empty() {
                    found.push(format!("{what}: {}", names.join(", ")));
                }
            }
        }
        let [before, now] = [trained, data].map(|data| &data.poses);
        if before.motions.is_some() && before.motions == now.motions {
            let ClipSplit { training, validation, test, .. } = dataset.poses.clips();
            let clips = [training, validation, test].concat();
            if held_out_poses(before, &clips) != held_out_poses(now, &clips) {
                found.push(
                    "may have been trained on held-out poses: other ones were held out of it".to_owned(),
                );
            }
            let was_validated =
                |clip: &String| before.validation_clips.iter().any(|name| clip.contains(name));
            let validated: Vec<String> =
                dataset.poses.clips().test.into_iter().filter(was_validated).collect();
            if !validated.is_empty() {
                found.push(format!("was validated on test clips: {}", validated.join(", ")));
            }
        }
        found
    }

    /// Whether the networks fit the data ([`check_fits`](Self::check_fits)); warns of what they know already.
    ///
    /// # Errors
    /// When they do not fit.
    pub fn check_data(&self, config: &Config, dataset: &Dataset) -> Result<(), CheckpointError> {
        self.check_fits(dataset)?;
        for what in self.known_of_held_out(config, dataset) {
            tracing::warn!("{} {what}", self.folder.display());
        }
        Ok(())
    }

    /// The networks as the start of a run of `config` on `dataset`; with untrained correction networks if those are new.
    ///
    /// # Errors
    /// When data or sizes of the networks are not the model's own.
    pub fn start_of(
        &self,
        config: &Config,
        dataset: &Dataset,
        device: &Device,
    ) -> Result<ClothCombo, CheckpointError> {
        self.check_networks(config)?;
        self.check_data(config, dataset)?;
        let networks = self.networks(device)?;
        Ok(match self.adds_corrections(config) {
            true => networks.with_corrections(&config.model, &mut Initializer::new(config.seed, device)),
            false => networks,
        })
    }

    fn adds_corrections(&self, config: &Config) -> bool {
        self.config.model.corrections == 0 && config.model.corrections > 0
    }

    /// Whether a run of `config` could start from these networks, as far as its [model] section tells.
    ///
    /// # Errors
    /// Names the keys that differ.
    pub fn check_networks(&self, config: &Config) -> Result<(), CheckpointError> {
        let adds_corrections = self.adds_corrections(config);
        let expected = match adds_corrections {
            true => ModelConfig {
                correction_width: self.config.model.correction_width,
                ..config.model.without_corrections()
            },
            false => config.model.clone(),
        };
        // How many steps are taken is a choice of inference, not of the networks.
        let expected = ModelConfig { correction_steps: self.config.model.correction_steps, ..expected };
        let changes = other_networks(&Config { model: expected, ..self.config.clone() }, &self.config);
        match changes.is_empty() {
            true => Ok(()),
            false => Err(CheckpointError::OtherStart { path: self.folder.clone(), changes }),
        }
    }

    /// Checksum of the parameters.
    pub fn checksum(&self) -> &str {
        self.state.checksums.get(MODEL_EXCHANGE).map_or("", String::as_str)
    }
}

/// What of `clips` is never trained on, whatever reads it; share, length and margin of the windows.
fn held_out_poses<'a>(poses: &PoseConfig, clips: &'a [String]) -> (Vec<&'a String>, [u64; 3]) {
    let names: Vec<&String> = poses.validation_clips.iter().chain(&poses.test_clips).collect();
    let mut held_out: Vec<&String> =
        clips.iter().filter(|clip| names.iter().any(|name| clip.contains(name.as_str()))).collect();
    held_out.sort_unstable();
    (held_out, [poses.held_out_share, poses.held_out_block, poses.held_out_margin].map(f64::to_bits))
}
