//! A trained model, apart from the run that made it.

use super::{
    CheckpointError, CheckpointState, MODEL_EXCHANGE, STATE, newest, other_networks, read_state, verify,
};
use crate::config::{Config, ConfigError, PoseConfig, load, parse};
use crate::dataset::{ClipSplit, Dataset, DatasetError, GarmentPurpose, load_body, purpose, read_body};
use crate::run::difference::listed;
use crate::run::folder::CONFIG_FILE;
use burn::store::{ModuleSnapshot, SafetensorsStore};
use burn::tensor::Device;
use clothcombo_data::asset::Body;
use clothcombo_data::format::NpzFile;
use clothcombo_model::ClothCombo;
use std::path::{Path, PathBuf};

/// The body beside a model.
const BODY: &str = "body.npz";

/// The files of a model that is part of the program.
#[derive(Debug)]
pub struct ModelFiles {
    /// `state.json`.
    pub state: &'static str,
    /// `config.toml`.
    pub config: &'static str,
    /// `model.safetensors`.
    pub parameters: &'static [u8],
    /// `body.npz`.
    pub body: &'static [u8],
}

/// Trained networks for use, not for training on: `model.safetensors`, `config.toml` and `state.json` of a checkpoint,
/// whatever else lies beside them. A model that is handed on needs no more than these three files.
#[derive(Clone, Debug)]
pub struct TrainedModel {
    /// Its folder; of a model that is part of the program, what it is called.
    pub folder: PathBuf,
    /// What it says about itself.
    pub state: CheckpointState,
    /// The configuration it was trained with.
    pub config: Config,
    built_in: Option<&'static ModelFiles>,
}

impl TrainedModel {
    /// Opens a model that is part of the program.
    ///
    /// # Errors
    /// When its files are damaged or of another version.
    pub fn built_in(files: &'static ModelFiles) -> Result<Self, CheckpointError> {
        let folder = PathBuf::from("built in");
        let unusable = |what: String| CheckpointError::Unusable {
            path: folder.clone(),
            reason: format!("{STATE} {what}"),
        };
        let state = CheckpointState::read(files.state).map_err(unusable)?;
        // Paths in it are relative to the working folder.
        let config = parse(files.config, Path::new(CONFIG_FILE), &[])?;
        Ok(Self { folder, state, config, built_in: Some(files) })
    }

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
            let files = [MODEL_EXCHANGE, CONFIG_FILE];
            let state = read_state(folder, &files)?;
            files.iter().try_for_each(|file| verify(folder, &state, file))?;
            let config = load(&folder.join(CONFIG_FILE), &[])?;
            Ok(Self { folder: folder.to_owned(), state, config, built_in: None })
        })
    }

    /// Its configuration, with `overrides`.
    ///
    /// # Errors
    /// When an override is wrong.
    pub fn config_with(&self, overrides: &[String]) -> Result<Config, ConfigError> {
        match self.built_in {
            Some(files) => parse(files.config, Path::new(CONFIG_FILE), overrides),
            None => load(&self.folder.join(CONFIG_FILE), overrides),
        }
    }

    /// The body it was trained on; `None` where that is not there.
    ///
    /// # Errors
    /// When its file is damaged.
    pub fn body(&self) -> Result<Option<Body>, DatasetError> {
        let (own, count) = (&self.config.data.body, self.state.shape_count);
        if own == "mannequin" {
            return load_body(own, count).map(Some);
        }
        if let Some(files) = self.built_in {
            let file = NpzFile::of_bytes(Path::new(BODY), files.body).map_err(DatasetError::data)?;
            return read_body(file, count).map(Some);
        }
        // A run lies somewhere below the folder its paths are relative to.
        let places = std::iter::once(Path::new("")).chain(self.folder.ancestors());
        let mut paths = std::iter::once(self.folder.join(BODY)).chain(places.map(|place| place.join(own)));
        let found = paths.find(|path| path.is_file());
        found.map(|path| load_body(&path.display().to_string(), count)).transpose()
    }

    /// The networks, on `device`.
    ///
    /// # Errors
    /// When the stored parameters do not fit the configuration.
    pub fn networks(&self, device: &Device) -> Result<ClothCombo, CheckpointError> {
        let unusable = |reason: String| CheckpointError::Unusable { path: self.folder.clone(), reason };
        let mut model = ClothCombo::new(&self.config.model, &self.state.dimensions(), 0, device)
            .map_err(|e| unusable(e.to_string()))?;
        let mut store = match self.built_in {
            Some(files) => SafetensorsStore::from_bytes(Some(files.parameters.to_vec())),
            None => SafetensorsStore::from_file(self.folder.join(MODEL_EXCHANGE)),
        };
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
    fn check_fits(&self, dataset: &Dataset) -> Result<(), CheckpointError> {
        let sizes = self.state.changed_sizes(&CheckpointState::of(dataset, 0), "model");
        match sizes.is_empty() {
            true => Ok(()),
            false => {
                let reason = format!("the data does not fit its networks:{}", listed(sizes));
                Err(CheckpointError::Foreign { path: self.folder.clone(), reason })
            }
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

    /// The networks as the start of a run of `config` on `dataset`.
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
        self.networks(device)
    }

    /// Whether a run of `config` could start from these networks, as far as its `[model]` section tells.
    ///
    /// # Errors
    /// Names the keys that differ.
    pub fn check_networks(&self, config: &Config) -> Result<(), CheckpointError> {
        let changes =
            other_networks(&Config { model: config.model.clone(), ..self.config.clone() }, &self.config);
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
