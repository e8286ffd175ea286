//! Frames of motion clips, by what they are for.

use crate::config::PoseConfig;
use crate::scene::LibraryError;
use clothcombo_data::asset::{Motion, Pose, Provenance};
use rand::RngExt;
use rand::distr::Distribution;
use rand::distr::weighted::{self, WeightedIndex};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// Frames by what they are for.
pub(super) struct Frames {
    training: Training,
    pub held_out: Vec<Pose>,
    pub unseen: Vec<Pose>,
    pub training_clips: Vec<String>,
    pub unseen_clips: Vec<String>,
    /// Where every clip comes from.
    pub sources: Vec<Provenance>,
}

impl Frames {
    /// Every clip is cut into blocks; one block in every `1 / held_out_share`, in the middle of its group, is held out. A clip
    /// of less than about half a group has none.
    ///
    /// # Errors
    /// Naming `folder`, when nothing is left to train on or nothing is held out, or the clips' lengths in time cannot be
    /// compared.
    pub fn split(clips: &[Motion], config: &PoseConfig, folder: &Path) -> Result<Self, LibraryError> {
        let (mut train, mut held_out, mut unseen) = (Vec::new(), Vec::new(), Vec::new());
        let (mut training_clips, mut unseen_clips) = (Vec::new(), Vec::new());
        let group = (1.0 / config.held_out_share).round().max(2.0) as usize;
        for clip in clips {
            if config.held_out_clips.iter().any(|name| clip.name.contains(name.as_str())) {
                unseen.extend_from_slice(&clip.poses);
                unseen_clips.push(clip.name.clone());
                continue;
            }
            training_clips.push(clip.name.clone());
            let block = ((config.held_out_block * clip.frame_rate).round() as usize).max(1);
            let mut poses = Vec::new();
            for (i, frames) in clip.poses.chunks(block).enumerate() {
                let part = if i % group == group / 2 { &mut held_out } else { &mut poses };
                part.extend_from_slice(frames);
            }
            if !poses.is_empty() {
                let seconds = poses.len() as f64 / clip.frame_rate;
                train.push(Clip { poses, seconds });
            }
        }
        let trained: usize = train.iter().map(|clip| clip.poses.len()).sum();
        if trained == 0 || held_out.is_empty() {
            let (folder, held_out) = (folder.to_owned(), held_out.len());
            return Err(LibraryError::EmptySplit { folder, train: trained, held_out });
        }
        let training = Training::new(train).map_err(|_| frame_rates(folder, clips))?;
        let sources = clips.iter().map(|clip| clip.source.clone()).collect();
        Ok(Self { training, held_out, unseen, training_clips, unseen_clips, sources })
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
    pub fn draw_training(&self, rng: &mut ChaCha8Rng) -> &Pose {
        self.training.draw(rng)
    }
}

/// The frame rates between which the lengths of the clips in `folder` cannot be compared.
fn frame_rates(folder: &Path, clips: &[Motion]) -> LibraryError {
    let rates = || clips.iter().map(|clip| clip.frame_rate);
    LibraryError::FrameRates {
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
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn long_clips_do_not_crowd_out_short_ones() {
        let clip = |frames: usize, rate: f64| Clip {
            poses: vec![Pose { rotations: vec![[frames as f64; 3]] }; frames],
            seconds: frames as f64 / rate,
        };
        // 64 s, 4 s, and 4 s at a high frame rate: 8 to 2 to 2.
        let training = Training::new(vec![clip(640, 10.0), clip(40, 10.0), clip(480, 120.0)]).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut counts = [0; 3];
        for _ in 0..12_000 {
            let length = training.draw(&mut rng).rotations[0][0] as usize;
            counts[[640, 40, 480].iter().position(|l| *l == length).unwrap()] += 1;
        }
        for (count, expected) in counts.into_iter().zip([8000.0_f64, 2000.0, 2000.0]) {
            assert!((f64::from(count) - expected).abs() < 4.0 * expected.sqrt(), "{counts:?}");
        }
    }

    #[test]
    fn frame_rates_that_are_none_are_refused() {
        let clip = |frame_rate: f64| Motion {
            name: "walk".into(),
            frame_rate,
            poses: vec![Pose::t_pose(2); 400],
            source: Provenance::default(),
        };
        let split = |rates: &[f64]| {
            let clips: Vec<Motion> = rates.iter().map(|rate| clip(*rate)).collect();
            // One frame a block at the absurd rates, and something held out at the good ones.
            let config = PoseConfig { held_out_block: 0.1, ..PoseConfig::default() };
            Frames::split(&clips, &config, Path::new("motions"))
        };
        assert!(split(&[30.0, 60.0]).is_ok());
        for rates in [[30.0, 0.0], [1e-320, 30.0], [30.0, f64::NAN], [30.0, -1.0]] {
            let error = split(&rates).err().unwrap_or_else(|| panic!("{rates:?} passed"));
            assert!(matches!(error, LibraryError::FrameRates { .. }), "{error}");
            assert!(error.to_string().starts_with("motions: "), "{error}");
        }
    }
}
