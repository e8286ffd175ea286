//! Poses for training and validation: frames of motion clips, or the sampler within joint limits.

mod bank;
mod frames;
mod hold_out;

use super::error::DatasetError;
use crate::config::{PoseConfig, PoseEncoding};
use bank::Bank;
use clothcombo_data::asset::{Body, Pose, Provenance};
use clothcombo_data::folders::load_motion_folder;
use clothcombo_data::generate::{PoseAugmentation, PoseSampler, SelfContact};
use frames::Frames;
pub use frames::{ClipSplit, Window};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use std::sync::Arc;

/// All poses of a run, split by clip.
pub struct PoseLibrary {
    source: Source,
    augmentation: Option<PoseAugmentation>,
    filter: Option<Filter>,
    self_intersecting: Option<SelfIntersecting>,
    /// How the networks see a pose.
    pub encoding: PoseEncoding,
    remove_heading: bool,
    bank: Option<Bank>,
}

/// Keeps bodies that run through themselves out of training.
struct Filter {
    body: Arc<Body>,
    contact: SelfContact,
    /// Longest curves of intersection that pass (m).
    limit: f64,
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
const ATTEMPTS: usize = 8;
/// Poses drawn to report the share of self-intersecting ones.
const REPORTED_POSES: usize = 64;

enum Source {
    Frames(Box<Frames>),
    Sampler(PoseSampler),
}

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
        let source = match &config.motions {
            None => Source::Sampler(PoseSampler),
            Some(folder) => {
                let clips = load_motion_folder(folder).map_err(DatasetError::data)?;
                Source::Frames(Box::new(Frames::split(&clips, config, folder)?))
            }
        };
        let limit = config.max_self_intersection;
        let filter = (limit < NO_FILTER).then(|| Filter {
            body: body.clone(),
            contact: SelfContact::new(body),
            limit,
        });
        let mut dataset = Self {
            source,
            augmentation: config.augmentation.then(PoseAugmentation::default),
            filter,
            self_intersecting: None,
            encoding: config.encoding,
            remove_heading: config.remove_heading,
            bank: None,
        };
        dataset.self_intersecting = dataset.survey_self_intersections();
        if let Some(s) = &dataset.self_intersecting {
            tracing::info!(
                "self-intersecting bodies: {:.0} % of {} training poses, {:.0} % above {} m and drawn again",
                100.0 * s.touching,
                s.poses,
                100.0 * s.above_limit,
                s.limit
            );
        }
        Ok(dataset)
    }

    /// How many training poses intersect themselves before the filter; none where nothing is filtered.
    pub fn self_intersecting(&self) -> Option<SelfIntersecting> {
        self.self_intersecting
    }

    fn survey_self_intersections(&self) -> Option<SelfIntersecting> {
        let filter = self.filter.as_ref()?;
        let lengths: Vec<f64> = (0..REPORTED_POSES as u64)
            .into_par_iter()
            .map(|i| filter.measure(&self.draw_unfiltered(1.0, &mut ChaCha8Rng::seed_from_u64(i))))
            .collect();
        let share = |limit: f64| lengths.iter().filter(|l| **l > limit).count() as f64 / lengths.len() as f64;
        Some(SelfIntersecting {
            poses: lengths.len(),
            touching: share(0.0),
            above_limit: share(filter.limit),
            limit: filter.limit,
        })
    }

    /// Numbers of captured frames; none when poses are sampled.
    pub fn frame_counts(&self) -> Option<FrameCounts> {
        match &self.source {
            Source::Frames(f) => Some(FrameCounts {
                training: f.trained(),
                windows: f.windows.len(),
                validation: f.validation.len(),
                test: f.test.len(),
            }),
            Source::Sampler(_) => None,
        }
    }

    /// All captured poses that a scene may show: trained on clip by clip, of held-out windows, of validation clips, of test
    /// clips.
    pub fn frames(&self) -> Vec<&[Pose]> {
        match &self.source {
            Source::Frames(f) => {
                let held_out = [&f.windows, &f.validation, &f.test].map(Vec::as_slice);
                f.trained_clips().chain(held_out).collect()
            }
            Source::Sampler(_) => Vec::new(),
        }
    }

    /// The clips by what they are for; none when poses are sampled.
    pub fn clips(&self) -> ClipSplit {
        match &self.source {
            Source::Frames(f) => f.clips.clone(),
            Source::Sampler(_) => ClipSplit::default(),
        }
    }

    /// Where every clip comes from; none when poses are sampled.
    pub fn sources(&self) -> &[Provenance] {
        match &self.source {
            Source::Frames(f) => &f.sources,
            Source::Sampler(_) => &[],
        }
    }

    /// The captured poses of one kind; none when poses are sampled.
    pub fn held_out(&self, kind: HeldOut) -> &[Pose] {
        match &self.source {
            Source::Frames(f) => f.held_out(kind),
            Source::Sampler(_) => &[],
        }
    }

    /// Whether there are poses of this kind.
    pub fn has(&self, kind: HeldOut) -> bool {
        match &self.source {
            Source::Frames(f) => !f.held_out(kind).is_empty(),
            Source::Sampler(_) => kind == HeldOut::Windows,
        }
    }

    /// A pose for training, scaled by the progressive schedule, as the networks see it: from the bank if there is one, else
    /// augmented. A pose that intersects itself beyond the limit is drawn again; if many in a row do, the least intersecting of
    /// them is taken.
    pub fn sample_training(&self, scale: f64, rng: &mut ChaCha8Rng) -> Pose {
        match &self.bank {
            Some(bank) => {
                let poses = bank.poses(self, &|_, _| ());
                poses[rng.random_range(0..poses.len())].scaled(scale)
            }
            None => self.least_intersecting(ATTEMPTS, |_| true, &mut || self.draw_unfiltered(scale, rng)),
        }
    }

    /// The first of at most `attempts` poses of `draw` that is possible and intersects itself no more than the limit, or the one
    /// that comes nearest to it.
    fn least_intersecting(
        &self,
        attempts: usize,
        is_possible: fn(&Pose) -> bool,
        draw: &mut dyn FnMut() -> Pose,
    ) -> Pose {
        let limit = self.filter.as_ref().map_or(f64::MAX, |filter| filter.limit);
        let measured = |pose: Pose| {
            let length = match is_possible(&pose) {
                true => self.filter.as_ref().map_or(0.0, |filter| filter.measure(&pose)),
                false => f64::INFINITY,
            };
            (pose, length)
        };
        let mut best = measured(draw());
        for _ in 1..attempts {
            if best.1 <= limit {
                break;
            }
            let other = measured(draw());
            if other.1 < best.1 {
                best = other;
            }
        }
        best.0
    }

    fn draw_unfiltered(&self, scale: f64, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match &self.source {
            Source::Sampler(sampler) => sampler.sample(rng),
            Source::Frames(frames) => {
                let pose = frames.sample_training(rng);
                match &self.augmentation {
                    Some(augmentation) => {
                        let other = frames.sample_training(rng);
                        augmentation.apply(pose, other, rng)
                    }
                    None => pose.clone(),
                }
            }
        };
        self.facing_forward(&pose).scaled(scale)
    }

    /// A pose never trained on, as it was captured but for its heading.
    ///
    /// # Panics
    /// If there are none of this `kind` ([`has`](Self::has)).
    pub fn sample_held_out(&self, kind: HeldOut, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match &self.source {
            Source::Sampler(sampler) => sampler.sample(rng),
            Source::Frames(frames) => {
                let pool = frames.held_out(kind);
                pool[rng.random_range(0..pool.len())].clone()
            }
        };
        self.facing_forward(&pose)
    }

    /// The pose as the networks and the body see it: heading removed when the configuration says so.
    pub fn facing_forward(&self, pose: &Pose) -> Pose {
        if self.remove_heading { pose.without_heading().0 } else { pose.clone() }
    }
}

impl Filter {
    /// Length of the curves of self-intersection (m).
    fn measure(&self, pose: &Pose) -> f64 {
        // Only a pose longer than the body's joint list is refused, and those joints are left out.
        self.contact.of_pose(&self.body, pose).unwrap_or(0.0)
    }
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
