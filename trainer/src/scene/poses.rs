//! Poses for training and validation: frames of motion clips, or the sampler within joint limits.

use super::error::LibraryError;
use crate::config::{PoseConfig, PoseEncoding};
use clothcombo_data::asset::rotation::matrix_from_axis_angle;
use clothcombo_data::asset::{Motion, Pose};
use clothcombo_data::dataset::load_motion_folder;
use clothcombo_data::generate::{PoseAugmentation, PoseSampler};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// All poses of a run, split by clip.
pub struct PoseLibrary {
    source: Source,
    augmentation: Option<PoseAugmentation>,
    encoding: PoseEncoding,
    remove_heading: bool,
}

enum Source {
    Frames(Frames),
    Sampler(PoseSampler),
}

/// Frames by what they are for.
#[derive(Default)]
struct Frames {
    train: Vec<Pose>,
    held_out: Vec<Pose>,
    unseen: Vec<Pose>,
    training_clips: Vec<String>,
    unseen_clips: Vec<String>,
}

/// Which poses a validation scene draws from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unseen {
    /// Frames of the trained clips that were never trained on.
    Poses,
    /// Clips that were never trained on.
    Clips,
}

impl PoseLibrary {
    /// Reads the motions and splits them; without a motion folder poses are sampled.
    ///
    /// # Errors
    /// When the folder cannot be read or one of the two parts is empty.
    pub fn new(config: &PoseConfig) -> Result<Self, LibraryError> {
        let source = match &config.motions {
            None => Source::Sampler(PoseSampler::default()),
            Some(folder) => {
                let clips = load_motion_folder(folder).map_err(LibraryError::data)?;
                let frames = split(&clips, config);
                if frames.train.is_empty() || frames.held_out.is_empty() {
                    return Err(LibraryError::EmptySplit {
                        folder: folder.clone(),
                        train: frames.train.len(),
                        held_out: frames.held_out.len(),
                    });
                }
                Source::Frames(frames)
            }
        };
        Ok(Self {
            source,
            augmentation: config.augmentation.then(PoseAugmentation::default),
            encoding: config.encoding,
            remove_heading: config.remove_heading,
        })
    }

    /// Number of frames trained on, held out of the trained clips, and of unseen clips; none when poses are sampled.
    pub fn frame_counts(&self) -> Option<[usize; 3]> {
        match &self.source {
            Source::Frames(f) => Some([f.train.len(), f.held_out.len(), f.unseen.len()]),
            Source::Sampler(_) => None,
        }
    }

    /// Names of the clips trained on, and of those never trained on.
    pub fn clips(&self) -> [&[String]; 2] {
        match &self.source {
            Source::Frames(f) => [&f.training_clips, &f.unseen_clips],
            Source::Sampler(_) => [&[], &[]],
        }
    }

    /// Whether there are clips that are never trained on.
    pub fn has_unseen_clips(&self) -> bool {
        self.frame_counts().is_some_and(|[_, _, unseen]| unseen > 0)
    }

    /// A pose for training, augmented, scaled by the progressive schedule, heading removed.
    pub fn draw_training(&self, scale: f64, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match &self.source {
            Source::Sampler(sampler) => sampler.sample(rng),
            Source::Frames(Frames { train, .. }) => {
                let pose = &train[rng.random_range(0..train.len())];
                match &self.augmentation {
                    Some(augmentation) => {
                        let other = &train[rng.random_range(0..train.len())];
                        augmentation.apply(pose, other, rng)
                    }
                    None => pose.clone(),
                }
            }
        };
        self.facing_forward(&pose).scaled(scale)
    }

    /// A pose never trained on, as it was captured, heading removed.
    pub fn draw_held_out(&self, kind: Unseen, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match &self.source {
            Source::Sampler(sampler) => sampler.sample(rng),
            Source::Frames(frames) => {
                let pool = match kind {
                    Unseen::Clips if !frames.unseen.is_empty() => &frames.unseen,
                    _ => &frames.held_out,
                };
                pool[rng.random_range(0..pool.len())].clone()
            }
        };
        self.facing_forward(&pose)
    }

    /// The pose as the networks and the body see it: heading removed when the configuration says so.
    pub fn facing_forward(&self, pose: &Pose) -> Pose {
        if self.remove_heading { pose.without_heading().0 } else { pose.clone() }
    }

    /// Numbers per joint of the pose feature.
    pub fn features_per_joint(&self) -> usize {
        match self.encoding {
            PoseEncoding::RotationMatrix => 9,
            PoseEncoding::AxisAngle => 3,
        }
    }

    /// Network input of `pose`: the features of `joints`, in order.
    pub fn features(&self, pose: &Pose, joints: &[usize]) -> Vec<f32> {
        let mut out = Vec::with_capacity(joints.len() * self.features_per_joint());
        for &j in joints {
            let rotation = pose.rotation(j);
            match self.encoding {
                PoseEncoding::AxisAngle => out.extend(rotation.map(|v| v as f32)),
                PoseEncoding::RotationMatrix => {
                    let matrix = matrix_from_axis_angle(rotation);
                    for (r, row) in matrix.iter().enumerate() {
                        for (c, v) in row.iter().enumerate() {
                            out.push((v - if r == c { 1.0 } else { 0.0 }) as f32);
                        }
                    }
                }
            }
        }
        out
    }
}

/// Every clip is cut into blocks; one block in every `1 / held_out_share`, in the middle of its group, is held out.
fn split(clips: &[Motion], config: &PoseConfig) -> Frames {
    let mut frames = Frames::default();
    let group = (1.0 / config.held_out_share).round().max(2.0) as usize;
    for clip in clips {
        if config.held_out_clips.iter().any(|name| clip.name.contains(name.as_str())) {
            frames.unseen.extend_from_slice(&clip.poses);
            frames.unseen_clips.push(clip.name.clone());
            continue;
        }
        frames.training_clips.push(clip.name.clone());
        let block = ((config.held_out_block * clip.frame_rate).round() as usize).max(1);
        for (i, poses) in clip.poses.chunks(block).enumerate() {
            let part = if i % group == group / 2 { &mut frames.held_out } else { &mut frames.train };
            part.extend_from_slice(poses);
        }
    }
    frames
}
