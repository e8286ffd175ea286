//! Frames of motion clips, by what they are for.

use super::hold_out::{HeldOutFrames, Purpose, hold_out, remedy, runs_of};
use crate::config::PoseConfig;
use crate::dataset::DatasetError;
use clothcombo_data::asset::{Motion, Pose, Provenance};
use rand::RngExt;
use rand::distr::Distribution;
use rand::distr::weighted::WeightedIndex;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::path::Path;

/// Poses never trained on, by what reads them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HeldOut {
    /// Windows of the trained clips, which every validation of a run scores; sampled poses where there are no clips.
    Windows,
    /// Clips that every validation of a run scores.
    ValidationClips,
    /// Clips that no run reads.
    TestClips,
}

/// Motion clips by what they are for.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ClipSplit {
    /// Trained on, but for the windows held out of them and the margins around those.
    pub training: Vec<String>,
    /// Never trained on; scored by every validation of a run.
    pub validation: Vec<String>,
    /// Never trained on, and read by no run.
    pub test: Vec<String>,
    /// Windows held out of the trained clips, and short clips held out whole; scored by every validation of a run.
    pub windows: Vec<Window>,
}

/// A part of a trained clip, or a whole clip, that is not trained on.
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

/// Whether the name of a clip contains one of `names`.
fn is_named(clip: &str, names: &[String]) -> bool {
    names.iter().any(|name| clip.contains(name.as_str()))
}

/// Whether every name of the configuration that is not optional fits a clip, and no clip is for two things.
fn check_names(clips: &[Motion], config: &PoseConfig, folder: &Path) -> Result<(), DatasetError> {
    let sets = [("validation_clips", &config.validation_clips), ("test_clips", &config.test_clips)];
    for (key, names) in sets {
        let fits = |name: &&String| {
            config.optional_clips.contains(name) || clips.iter().any(|clip| clip.name.contains(name.as_str()))
        };
        if let Some(name) = names.iter().find(|name| !fits(name)) {
            let clips = clips.iter().map(|clip| clip.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(DatasetError::new(
                format!("data.poses.{key} names {name:?}, which fits no clip in {}", folder.display()),
                format!(
                    "a name that may fit none belongs in data.poses.optional_clips as well; the clips are: {clips}"
                ),
            ));
        }
    }
    let in_both = |clip: &&Motion| sets.iter().all(|(_, names)| is_named(&clip.name, names));
    match clips.iter().find(in_both) {
        None => Ok(()),
        Some(Motion { name, .. }) => Err(DatasetError::new(
            format!("clip {name} is named by data.poses.validation_clips and by data.poses.test_clips"),
            "a clip is for one of them; a name stands for every clip whose name contains it",
        )),
    }
}

/// Frames by what they are for.
pub(super) struct Frames {
    /// Clips that are trained on, none of them empty.
    trained_on: Vec<TrainedClip>,
    shares: WeightedIndex<f64>,
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
    /// Clips are split by their names; of those that are trained on, frames are held out ([`hold_out`]).
    ///
    /// # Errors
    /// Naming `folder`, when a clip of the configuration is missing or named twice, nothing is left to train on, nothing is held
    /// out, or the clips' lengths in time cannot be compared.
    pub fn split(clips: &[Motion], config: &PoseConfig, folder: &Path) -> Result<Self, DatasetError> {
        check_names(clips, config, folder)?;
        let (mut train, mut windows) = (Vec::new(), Vec::new());
        let (mut validation, mut test) = (Vec::new(), Vec::new());
        let mut names = ClipSplit::default();
        let mut own: Vec<&Motion> = Vec::new();
        for clip in clips {
            if is_named(&clip.name, &config.test_clips) {
                test.extend_from_slice(&clip.poses);
                names.test.push(clip.name.clone());
            } else if is_named(&clip.name, &config.validation_clips) {
                validation.extend_from_slice(&clip.poses);
                names.validation.push(clip.name.clone());
            } else {
                own.push(clip);
            }
        }
        if own.iter().all(|clip| clip.poses.is_empty()) {
            return Err(DatasetError::new(
                format!(
                    "{}: no clip to train on: {} are named by data.poses.validation_clips or test_clips, the others have no \
                     frames",
                    folder.display(),
                    clips.len() - own.len()
                ),
                "name fewer clips there, or add some: a run needs frames to train on beside those that it validates on",
            ));
        }
        let HeldOutFrames { purposes, note } = hold_out(&own, config);
        if let Some(note) = note {
            tracing::warn!("{}: {note}", folder.display());
        }
        for (clip, purposes) in own.iter().zip(&purposes) {
            let of = |wanted: Purpose| {
                let frames = clip.poses.iter().zip(purposes).filter(move |(_, purpose)| **purpose == wanted);
                frames.map(|(pose, _)| pose.clone())
            };
            windows.extend(of(Purpose::HeldOut));
            names.windows.extend(Window::list(&clip.name, clip.frame_rate, purposes));
            let poses: Vec<Pose> = of(Purpose::Training).collect();
            if purposes.iter().any(|purpose| *purpose != Purpose::HeldOut) || purposes.is_empty() {
                names.training.push(clip.name.clone());
            }
            if !poses.is_empty() {
                let seconds = poses.len() as f64 / clip.frame_rate;
                train.push(TrainedClip { poses, seconds });
            }
        }
        if train.is_empty() || windows.is_empty() {
            let trained: usize = train.iter().map(|clip: &TrainedClip| clip.poses.len()).sum();
            return Err(DatasetError::new(
                format!(
                    "{}: {trained} frames to train on and {} held out to validate on; the clips are too few or too short to \
                     hold a part out of them",
                    folder.display(),
                    windows.len()
                ),
                remedy(&own, config),
            ));
        }
        let shares = WeightedIndex::new(train.iter().map(TrainedClip::share));
        let shares = shares.map_err(|_| frame_rates(folder, clips))?;
        let sources = clips.iter().map(|clip| clip.source.clone()).collect();
        Ok(Self { trained_on: train, shares, windows, validation, test, clips: names, sources })
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
        self.trained_on.iter().map(|clip| clip.poses.as_slice())
    }

    /// The frames trained on, each with how likely [`sample_training`](Self::sample_training) is to draw it, relative to the
    /// others.
    pub fn weighted(&self) -> impl Iterator<Item = (&Pose, f64)> {
        self.trained_on.iter().flat_map(|clip| {
            let weight = clip.share() / clip.poses.len() as f64;
            clip.poses.iter().map(move |pose| (pose, weight))
        })
    }

    /// A frame to train on.
    pub fn sample_training(&self, rng: &mut ChaCha8Rng) -> &Pose {
        let poses = &self.trained_on[self.shares.sample(rng)].poses;
        &poses[rng.random_range(0..poses.len())]
    }
}

/// The frame rates between which the lengths of the clips in `folder` cannot be compared.
fn frame_rates(folder: &Path, clips: &[Motion]) -> DatasetError {
    let rates = || clips.iter().map(|clip| clip.frame_rate);
    let (lowest, highest) =
        (rates().fold(f64::INFINITY, f64::min), rates().fold(f64::NEG_INFINITY, f64::max));
    DatasetError::new(
        format!(
            "{}: at frame rates from {lowest:?} to {highest:?} a second the clips' lengths in time cannot be compared",
            folder.display()
        ),
        "`clothcombo check` tells the frame rate of every motion; set mocap_framerate, for example to 30",
    )
}

/// What is trained on of a clip.
struct TrainedClip {
    poses: Vec<Pose>,
    seconds: f64,
}

impl TrainedClip {
    /// Its share grows with the square root of its length in time: neighbouring frames are alike, so that by frames alone a long
    /// clip, or one of a high frame rate, would crowd out the others.
    fn share(&self) -> f64 {
        self.seconds.sqrt()
    }
}

#[cfg(test)]
mod tests;
