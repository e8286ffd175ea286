//! Frames of motion clips, by what they are for.

use super::HeldOut;
use crate::config::PoseConfig;
use crate::dataset::DatasetError;
use clothcombo_data::asset::{Motion, Pose, Provenance};
use rand::RngExt;
use rand::distr::Distribution;
use rand::distr::weighted::{self, WeightedIndex};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::path::Path;

/// Motion clips by what they are for.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ClipSplit {
    /// Trained on, but for the windows held out of them and the margins around those.
    pub training: Vec<String>,
    /// Never trained on; scored by every validation of a run.
    pub validation: Vec<String>,
    /// Never trained on, and read by no run.
    pub test: Vec<String>,
    /// Windows held out of the trained clips; scored by every validation of a run.
    pub windows: Vec<Window>,
}

/// A part of a trained clip that is not trained on.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Window {
    /// The clip.
    pub clip: String,
    /// Begin and end in it (s).
    pub seconds: [f64; 2],
}

impl Window {
    /// The windows of a clip whose frames have these purposes.
    fn list(clip: &str, frame_rate: f64, purposes: &[Purpose]) -> Vec<Self> {
        let window = |frames: [usize; 2]| Self {
            clip: clip.to_owned(),
            seconds: frames.map(|frame| frame as f64 / frame_rate),
        };
        runs_of(purposes, Purpose::HeldOut).into_iter().map(window).collect()
    }
}

/// What a frame of a trained clip is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    Training,
    HeldOut,
    /// Too near to a held-out frame to train on.
    Margin,
}

/// First frame, and the one after the last, of every run of frames that are for `wanted`.
fn runs_of(purposes: &[Purpose], wanted: Purpose) -> Vec<[usize; 2]> {
    let mut start = 0;
    let mut runs = Vec::new();
    for run in purposes.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        if run[0] == wanted {
            runs.push([start, end]);
        }
        start = end;
    }
    runs
}

/// The purposes of the frames of a clip.
fn purposes(count: usize, frame_rate: f64, config: &PoseConfig) -> Vec<Purpose> {
    let block = ((config.held_out_block * frame_rate).round() as usize).max(1);
    let group = config.blocks_per_window();
    let held_out = |frame: usize| frame / block % group == group / 2;
    let mut purposes = vec![Purpose::Training; count];
    // A trained frame is at least so many frames from any held-out one.
    let distance = (config.held_out_margin * frame_rate).ceil() as usize;
    let reach = distance.saturating_sub(1);
    for frame in (0..count).filter(|frame| held_out(*frame)) {
        purposes[frame] = Purpose::HeldOut;
    }
    for [start, end] in runs_of(&purposes, Purpose::HeldOut) {
        let around = [start.saturating_sub(reach)..start, end..end.saturating_add(reach).min(count)];
        for frame in around.into_iter().flatten().filter(|frame| !held_out(*frame)) {
            purposes[frame] = Purpose::Margin;
        }
    }
    purposes
}

/// Whether the name of a clip contains one of `names`.
fn is_named(clip: &str, names: &[String]) -> bool {
    names.iter().any(|name| clip.contains(name.as_str()))
}

/// Whether every name of the configuration fits a clip, and no clip is for two things.
fn check_names(clips: &[Motion], config: &PoseConfig, folder: &Path) -> Result<(), DatasetError> {
    let sets = [("validation_clips", &config.validation_clips), ("test_clips", &config.test_clips)];
    for (key, names) in sets {
        let fits = |name: &&String| clips.iter().any(|clip| clip.name.contains(name.as_str()));
        if let Some(name) = names.iter().find(|name| !fits(name)) {
            return Err(DatasetError::UnknownClip {
                key,
                folder: folder.to_owned(),
                name: name.clone(),
                clips: clips.iter().map(|clip| clip.name.as_str()).collect::<Vec<_>>().join(", "),
            });
        }
    }
    let in_both = |clip: &&Motion| sets.iter().all(|(_, names)| is_named(&clip.name, names));
    match clips.iter().find(in_both) {
        None => Ok(()),
        Some(clip) => Err(DatasetError::ClipOfTwoSets { clip: clip.name.clone() }),
    }
}

/// Frames by what they are for.
pub(super) struct Frames {
    training: Training,
    /// Frames of the windows held out of the trained clips.
    pub windows: Vec<Pose>,
    /// Frames of the validation clips.
    pub validation: Vec<Pose>,
    /// Frames of the test clips.
    pub test: Vec<Pose>,
    /// The clips by name.
    pub clips: ClipSplit,
    /// Where every clip comes from.
    pub sources: Vec<Provenance>,
}

impl Frames {
    /// Every clip but those for validation and test is cut into blocks; one block in every `1 / held_out_share`, in the middle
    /// of its group, is held out. A clip of less than about half a group has none. Frames within `held_out_margin` of a
    /// held-out one are for nothing.
    ///
    /// # Errors
    /// Naming `folder`, when a clip of the configuration is missing or named twice, nothing is left to train on, nothing is held
    /// out, or the clips' lengths in time cannot be compared.
    pub fn split(clips: &[Motion], config: &PoseConfig, folder: &Path) -> Result<Self, DatasetError> {
        check_names(clips, config, folder)?;
        let (mut train, mut windows) = (Vec::new(), Vec::new());
        let (mut validation, mut test) = (Vec::new(), Vec::new());
        let mut names = ClipSplit::default();
        for clip in clips {
            if is_named(&clip.name, &config.test_clips) {
                test.extend_from_slice(&clip.poses);
                names.test.push(clip.name.clone());
                continue;
            }
            if is_named(&clip.name, &config.validation_clips) {
                validation.extend_from_slice(&clip.poses);
                names.validation.push(clip.name.clone());
                continue;
            }
            names.training.push(clip.name.clone());
            let purposes = purposes(clip.poses.len(), clip.frame_rate, config);
            let of = |wanted: Purpose| {
                let frames = clip.poses.iter().zip(&purposes).filter(move |(_, purpose)| **purpose == wanted);
                frames.map(|(pose, _)| pose.clone())
            };
            windows.extend(of(Purpose::HeldOut));
            names.windows.extend(Window::list(&clip.name, clip.frame_rate, &purposes));
            let poses: Vec<Pose> = of(Purpose::Training).collect();
            if !poses.is_empty() {
                let seconds = poses.len() as f64 / clip.frame_rate;
                train.push(Clip { poses, seconds });
            }
        }
        let trained: usize = train.iter().map(|clip| clip.poses.len()).sum();
        if trained == 0 || windows.is_empty() {
            let (folder, held_out) = (folder.to_owned(), windows.len());
            return Err(DatasetError::EmptySplit { folder, train: trained, held_out });
        }
        let training = Training::new(train).map_err(|_| frame_rates(folder, clips))?;
        let sources = clips.iter().map(|clip| clip.source.clone()).collect();
        Ok(Self { training, windows, validation, test, clips: names, sources })
    }

    /// The frames of one kind of held-out poses.
    pub fn held_out(&self, kind: HeldOut) -> &[Pose] {
        match kind {
            HeldOut::Windows => &self.windows,
            HeldOut::ValidationClips => &self.validation,
            HeldOut::TestClips => &self.test,
        }
    }

    /// Number of frames trained on.
    pub fn trained(&self) -> usize {
        self.trained_clips().map(<[Pose]>::len).sum()
    }

    /// The frames trained on, clip by clip.
    pub fn trained_clips(&self) -> impl Iterator<Item = &[Pose]> {
        self.training.clips.iter().map(|clip| clip.poses.as_slice())
    }

    /// A frame to train on.
    pub fn sample_training(&self, rng: &mut ChaCha8Rng) -> &Pose {
        self.training.draw(rng)
    }
}

/// The frame rates between which the lengths of the clips in `folder` cannot be compared.
fn frame_rates(folder: &Path, clips: &[Motion]) -> DatasetError {
    let rates = || clips.iter().map(|clip| clip.frame_rate);
    DatasetError::FrameRates {
        folder: folder.to_owned(),
        lowest: rates().fold(f64::INFINITY, f64::min),
        highest: rates().fold(f64::NEG_INFINITY, f64::max),
    }
}

/// What is trained on of a clip.
struct Clip {
    poses: Vec<Pose>,
    seconds: f64,
}

/// Clips that are trained on, none of them empty.
struct Training {
    clips: Vec<Clip>,
    shares: WeightedIndex<f64>,
}

impl Training {
    /// The share of a clip grows with the square root of its length in time: neighbouring frames are alike, so that by frames
    /// alone a long clip, or one of a high frame rate, would crowd out the others.
    fn new(clips: Vec<Clip>) -> Result<Self, weighted::Error> {
        let shares = WeightedIndex::new(clips.iter().map(|clip| clip.seconds.sqrt()))?;
        Ok(Self { clips, shares })
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> &Pose {
        let poses = &self.clips[self.shares.sample(rng)].poses;
        &poses[rng.random_range(0..poses.len())]
    }
}

#[cfg(test)]
mod tests;
