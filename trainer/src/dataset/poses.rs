//! Poses for training and validation: frames of motion clips, or the sampler within joint limits.

mod bank;
mod draw;
mod frames;
mod hold_out;

use super::error::DatasetError;
use crate::config::{Config, PoseConfig, PoseEncoding};
use bank::{Bank, BankProgress};
use clothcombo_data::asset::{Body, Pose, Provenance};
use clothcombo_data::folders::load_motion_folder;
use clothcombo_data::generate::{PoseAugmentation, PoseSampler, SelfContact};
use draw::{PoseDraw, SelfIntersectionFilter};
use frames::Frames;
pub use frames::{ClipSplit, HeldOut, Window};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::sync::Arc;

/// All poses of a run, split by clip.
pub struct PoseLibrary {
    draw: PoseDraw,
    self_intersecting: Option<SelfIntersecting>,
    /// How the networks see a pose.
    pub encoding: PoseEncoding,
    bank: Option<Bank>,
}

/// Self-intersections among training poses as they are drawn, before the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfIntersecting {
    /// Poses looked at.
    pub poses: usize,
    /// Share in which far-apart parts of the body intersect at all, 0–1.
    pub touching: f64,
    /// Share above the limit, which is drawn again, 0–1.
    pub above_limit: f64,
    /// The limit (m).
    pub limit: f64,
}

/// From this limit on nothing is filtered (m).
const NO_FILTER: f64 = 10.0;
/// Poses drawn before the least self-intersecting one is taken as it is.
const DRAWN_ATTEMPTS: usize = 8;
/// Poses drawn to report the share of self-intersecting ones.
const REPORTED_POSES: usize = 64;

/// Numbers of captured frames by what they are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameCounts {
    /// Trained on.
    pub training: usize,
    /// In the windows held out of the trained clips.
    pub windows: usize,
    /// In validation clips.
    pub validation: usize,
    /// In test clips.
    pub test: usize,
}

impl PoseLibrary {
    /// Reads the motions and splits them; without a motion folder poses are sampled. Self-intersections are judged on `body`
    /// of mean shape.
    ///
    /// # Errors
    /// When the folder cannot be read, one of the two parts is empty, or the frame rates of the clips are no rates.
    pub fn new(config: &PoseConfig, body: &Arc<Body>) -> Result<Self, DatasetError> {
        let split = |folder| {
            let clips = load_motion_folder(folder).map_err(DatasetError::data)?;
            Frames::split(&clips, config, folder)
        };
        let limit = config.max_self_intersection;
        let filter = || SelfIntersectionFilter { body: body.clone(), contact: SelfContact::new(body), limit };
        let draw = PoseDraw {
            frames: config.motions.as_deref().map(split).transpose()?,
            sampler: PoseSampler,
            augmentation: config.augmentation.then(PoseAugmentation::default),
            filter: (limit < NO_FILTER).then(filter),
            remove_heading: config.remove_heading,
        };
        let self_intersecting = survey_self_intersections(&draw);
        if let Some(s) = &self_intersecting {
            tracing::info!(
                "self-intersecting bodies: {:.0} % of {} training poses, {:.0} % above {} m and drawn again",
                100.0 * s.touching,
                s.poses,
                100.0 * s.above_limit,
                s.limit
            );
        }
        Ok(Self { draw, self_intersecting, encoding: config.encoding, bank: None })
    }

    /// The same with the bank of poses that `config` asks for, if any; it is made when it is first needed.
    #[must_use]
    pub fn with_bank(self, config: &Config) -> Self {
        Self { bank: Bank::new(config), ..self }
    }

    /// Makes the bank of training poses, or reads it from the cache; nothing without one.
    pub fn make_bank(&self, progress: BankProgress<'_>) {
        if let Some(bank) = &self.bank {
            bank.poses(&self.draw, progress);
        }
    }

    /// How many training poses intersect themselves before the filter; none where nothing is filtered.
    pub fn self_intersecting(&self) -> Option<SelfIntersecting> {
        self.self_intersecting
    }

    /// Numbers of captured frames; none when poses are sampled.
    pub fn frame_counts(&self) -> Option<FrameCounts> {
        self.draw.frames.as_ref().map(|f| FrameCounts {
            training: f.trained(),
            windows: f.windows.len(),
            validation: f.validation.len(),
            test: f.test.len(),
        })
    }

    /// All captured poses that a scene may show: trained on clip by clip, of held-out windows, of validation clips, of test
    /// clips.
    pub fn frames(&self) -> Vec<&[Pose]> {
        let Some(f) = &self.draw.frames else { return Vec::new() };
        f.trained_clips().chain([&f.windows, &f.validation, &f.test].map(Vec::as_slice)).collect()
    }

    /// The clips by what they are for; none when poses are sampled.
    pub fn clips(&self) -> ClipSplit {
        self.draw.frames.as_ref().map_or_else(ClipSplit::default, |f| f.clips.clone())
    }

    /// Where every clip comes from; none when poses are sampled.
    pub fn sources(&self) -> &[Provenance] {
        self.draw.frames.as_ref().map_or(&[], |f| &f.sources)
    }

    /// The captured poses of one kind; none when poses are sampled.
    pub fn held_out(&self, kind: HeldOut) -> &[Pose] {
        self.draw.frames.as_ref().map_or(&[], |f| f.held_out(kind))
    }

    /// Whether there are poses of this kind.
    pub fn has(&self, kind: HeldOut) -> bool {
        self.draw.frames.as_ref().map_or(kind == HeldOut::Windows, |f| !f.held_out(kind).is_empty())
    }

    /// A pose for training, scaled by the progressive schedule, as the networks see it: from the bank if there is one, else
    /// augmented. A pose that intersects itself beyond the limit is drawn again; if many in a row do, the least intersecting of
    /// them is taken.
    pub fn sample_training(&self, scale: f64, rng: &mut ChaCha8Rng) -> Pose {
        match &self.bank {
            Some(bank) => {
                let poses = bank.poses(&self.draw, &|_, _| ());
                poses[rng.random_range(0..poses.len())].scaled(scale)
            }
            None => {
                let mut draw = || self.draw.unfiltered(scale, rng);
                self.draw.least_intersecting(DRAWN_ATTEMPTS, |_| true, &mut draw)
            }
        }
    }

    /// A pose never trained on, as it was captured but for its heading.
    ///
    /// # Panics
    /// If there are none of this `kind` ([`has`](Self::has)).
    pub fn sample_held_out(&self, kind: HeldOut, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match &self.draw.frames {
            None => self.draw.sampler.sample(rng),
            Some(frames) => {
                let pool = frames.held_out(kind);
                pool[rng.random_range(0..pool.len())].clone()
            }
        };
        self.draw.facing_forward(&pose)
    }
}

fn survey_self_intersections(draw: &PoseDraw) -> Option<SelfIntersecting> {
    let filter = draw.filter.as_ref()?;
    let lengths: Vec<f64> = (0..REPORTED_POSES as u64)
        .into_par_iter()
        .map(|i| filter.measure(&draw.unfiltered(1.0, &mut ChaCha8Rng::seed_from_u64(i))))
        .collect();
    let share = |limit: f64| lengths.iter().filter(|l| **l > limit).count() as f64 / lengths.len() as f64;
    Some(SelfIntersecting {
        poses: lengths.len(),
        touching: share(0.0),
        above_limit: share(filter.limit),
        limit: filter.limit,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::generate::mannequin;

    fn dataset(max_self_intersection: f64) -> PoseLibrary {
        let config = PoseConfig { max_self_intersection, ..PoseConfig::default() };
        PoseLibrary::new(&config, &Arc::new(mannequin())).unwrap()
    }

    #[test]
    fn training_poses_that_run_through_themselves_are_drawn_again() {
        let body = mannequin();
        let contact = SelfContact::new(&body);
        let limit = 0.02;
        let (filtered, free) = (dataset(limit), dataset(NO_FILTER));
        assert!(free.self_intersecting().is_none());
        let report = filtered.self_intersecting().unwrap();
        assert!(report.above_limit > 0.0 && report.above_limit <= report.touching, "{report:?}");
        let draw =
            |dataset: &PoseLibrary, seed| dataset.sample_training(1.0, &mut ChaCha8Rng::seed_from_u64(seed));
        let length = |pose: &Pose| contact.of_pose(&body, pose).unwrap();
        let mut replaced = 0;
        for seed in 0..60 {
            let (kept, any) = (draw(&filtered, seed), draw(&free, seed));
            assert_eq!(kept, draw(&filtered, seed));
            assert!(length(&kept) <= limit, "seed {seed}");
            // What passes is not touched.
            assert_eq!(kept == any, length(&any) <= limit);
            replaced += usize::from(kept != any);
        }
        assert!(replaced > 0);
    }
}
