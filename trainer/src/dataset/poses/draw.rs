//! Poses drawn at random: frames of motion clips, augmented, or the sampler within joint limits. Bodies that run through
//! themselves are drawn again.

use super::frames::Frames;
use clothcombo_data::asset::{Body, Pose};
use clothcombo_data::generate::{PoseAugmentation, PoseSampler, SelfContact};
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// What poses are drawn from, and how.
pub(super) struct PoseDraw {
    /// Frames of clips; without them poses are sampled.
    pub frames: Option<Frames>,
    pub sampler: PoseSampler,
    pub augmentation: Option<PoseAugmentation>,
    pub filter: Option<SelfIntersectionFilter>,
    pub remove_heading: bool,
}

/// Keeps bodies that run through themselves out of training.
pub(super) struct SelfIntersectionFilter {
    pub body: Arc<Body>,
    pub contact: SelfContact,
    /// Longest curves of intersection that pass (m).
    pub limit: f64,
}

impl SelfIntersectionFilter {
    /// Length of the curves of self-intersection (m).
    pub fn measure(&self, pose: &Pose) -> f64 {
        // Only a pose longer than the body's joint list is refused, and those joints are left out.
        self.contact.of_pose(&self.body, pose).unwrap_or(0.0)
    }
}

impl PoseDraw {
    /// The first of at most `attempts` poses of `draw` that is possible and intersects itself no more than the limit, or the one
    /// that comes nearest to it.
    pub fn least_intersecting(
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

    /// A pose for training, whether it intersects itself or not.
    pub fn unfiltered(&self, scale: f64, rng: &mut ChaCha8Rng) -> Pose {
        let pose = match (&self.frames, &self.augmentation) {
            (None, _) => self.sampler.sample(rng),
            (Some(frames), None) => frames.sample_training(rng).clone(),
            (Some(frames), Some(augmentation)) => {
                let pose = frames.sample_training(rng);
                augmentation.apply(pose, frames.sample_training(rng), rng)
            }
        };
        self.facing_forward(&pose).scaled(scale)
    }

    /// The pose as the networks and the body see it: heading removed when the configuration says so.
    pub fn facing_forward(&self, pose: &Pose) -> Pose {
        if self.remove_heading { pose.without_heading().0 } else { pose.clone() }
    }

    /// The recorded poses that are trained on, and how likely each is drawn.
    pub fn weighted_frames(&self) -> impl Iterator<Item = (&Pose, f64)> {
        self.frames.iter().flat_map(Frames::weighted)
    }
}
