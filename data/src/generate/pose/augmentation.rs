//! Variations of recorded poses: a thin collection of motion becomes a dense one.

use super::limits::JOINT_LIMITS;
use crate::asset::{BODY_JOINT_COUNT, Pose};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

/// How poses are varied for training. The defaults gave the best results on held-out motion; interpolation was not part of
/// that comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseAugmentation {
    /// Probability of mirroring left and right. Default 0.5.
    pub mirror: f64,
    /// Probability of mixing with another pose, perhaps of another clip, by a random share: fills the gaps between
    /// recordings. Default 0.25.
    pub interpolation: f64,
    /// Probability of taking the legs or the arms from another pose. Default 0.5.
    pub limb_swap: f64,
    /// Range of the factor on each joint's angle, the pelvis excepted. Default 0.7–1.15.
    pub scale: [f64; 2],
    /// Standard deviation of the noise on each component, the pelvis excepted, in degrees. Default 3.5.
    pub noise_degrees: f64,
}

impl Default for PoseAugmentation {
    fn default() -> Self {
        Self { mirror: 0.5, interpolation: 0.25, limb_swap: 0.5, scale: [0.7, 1.15], noise_degrees: 3.5 }
    }
}

const BOTH_LEGS: [usize; 8] = [1, 2, 4, 5, 7, 8, 10, 11];
const BOTH_ARMS: [usize; 8] = [13, 14, 16, 17, 18, 19, 20, 21];

impl PoseAugmentation {
    /// No change at all.
    pub fn none() -> Self {
        Self { mirror: 0.0, interpolation: 0.0, limb_swap: 0.0, scale: [1.0, 1.0], noise_degrees: 0.0 }
    }

    /// A variation of the body joints of `pose`, perhaps mixed with `other` or with limbs from it. Noise and scale
    /// carry no component beyond its joint limit, or beyond the recorded value where the recording itself exceeds the
    /// limit. Joints past the 22 body joints are mirrored but otherwise kept.
    pub fn apply<R: Rng + ?Sized>(&self, pose: &Pose, other: &Pose, rng: &mut R) -> Pose {
        let mirrored =
            |pose: &Pose, sample: f64| if sample < self.mirror { pose.mirrored() } else { pose.clone() };
        // The number of samples does not depend on their values, so that streams stay aligned.
        let samples: [f64; 6] = std::array::from_fn(|_| rng.random::<f64>());
        let mut result = mirrored(pose, samples[0]);
        let other = mirrored(other, samples[1]);
        if samples[4] < self.interpolation {
            result = result.between(&other, samples[5]);
        }
        if samples[2] < self.limb_swap {
            let limbs = if samples[3] < 0.5 { BOTH_LEGS } else { BOTH_ARMS };
            for joint in limbs {
                if joint < result.rotations.len() {
                    result.rotations[joint] = other.rotation(joint);
                }
            }
        }
        let noise = self.noise_degrees.to_radians();
        for (joint, rotation) in result.rotations.iter_mut().enumerate().take(BODY_JOINT_COUNT).skip(1) {
            let factor = self.scale[0] + (self.scale[1] - self.scale[0]) * rng.random::<f64>();
            let limits = JOINT_LIMITS[joint];
            for axis in 0..3 {
                let jitter: f64 = StandardNormal.sample(rng);
                let recorded = rotation[axis];
                let low = limits.low[axis].to_radians().min(recorded);
                let high = limits.high[axis].to_radians().max(recorded);
                rotation[axis] = (factor * recorded + noise * jitter).clamp(low, high);
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::super::{PoseSampler, is_within_limits};
    use super::*;
    use crate::asset::rotation::{
        matrix_from_axis_angle, quaternion_conjugate, quaternion_from_axis_angle, quaternion_product,
    };
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn poses(seed: u64) -> (Pose, Pose, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (PoseSampler.sample(&mut rng), PoseSampler.sample(&mut rng), rng)
    }

    #[test]
    fn nothing_switched_on_changes_nothing() {
        let (a, b, mut rng) = poses(1);
        assert_eq!(PoseAugmentation::none().apply(&a, &b, &mut rng), a);
    }

    #[test]
    fn each_part_does_what_it_says() {
        let (a, b, mut rng) = poses(2);
        let mirror = PoseAugmentation { mirror: 1.0, ..PoseAugmentation::none() };
        assert_eq!(mirror.apply(&a, &b, &mut rng), a.mirrored());
        let swap = PoseAugmentation { limb_swap: 1.0, ..PoseAugmentation::none() };
        for _ in 0..20 {
            let mixed = swap.apply(&a, &b, &mut rng);
            let from_b: Vec<usize> = (0..22).filter(|j| mixed.rotations[*j] == b.rotations[*j]).collect();
            assert!(from_b == BOTH_LEGS || from_b == BOTH_ARMS, "{from_b:?}");
            assert!((0..22).all(|j| from_b.contains(&j) || mixed.rotations[j] == a.rotations[j]));
        }
        let scale = PoseAugmentation { scale: [0.7, 0.7], ..PoseAugmentation::none() };
        let scaled = scale.apply(&a, &b, &mut rng);
        assert_eq!(scaled.rotations[0], a.rotations[0]);
        for j in 1..22 {
            assert!((0..3).all(|k| (scaled.rotations[j][k] - 0.7 * a.rotations[j][k]).abs() < 1e-12));
        }
    }

    #[test]
    fn interpolation_runs_from_one_pose_to_the_other_within_the_limits() {
        for seed in 0..40 {
            let (mut a, mut b, mut rng) = poses(seed);
            for pose in [&mut a, &mut b] {
                pose.rotations[0][1] = rng.random_range(-3.0..3.0);
            }
            let close = |p: &Pose, q: &Pose| {
                p.rotations.iter().zip(&q.rotations).all(|(p, q)| {
                    let (p, q) = (matrix_from_axis_angle(*p), matrix_from_axis_angle(*q));
                    p.as_flattened().iter().zip(q.as_flattened()).all(|(x, y)| (x - y).abs() < 1e-9)
                })
            };
            assert!(close(&a.between(&b, 0.0), &a) && close(&a.between(&b, 1.0), &b));
            let middle = a.between(&b, 0.5);
            assert!(close(&middle, &b.between(&a, 0.5)));
            assert!((1..22).all(|j| {
                (0..3).all(|x| {
                    (2.0 * middle.rotations[j][x] - a.rotations[j][x] - b.rotations[j][x]).abs() < 1e-12
                })
            }));
            assert!(is_within_limits(&Pose { rotations: [&[[0.0; 3]], &middle.rotations[1..]].concat() }));
            // The root is as far from both ends.
            let angle = |p: &Pose| {
                let ends = [p, &middle].map(|p| quaternion_from_axis_angle(p.rotations[0]));
                quaternion_product(quaternion_conjugate(ends[0]), ends[1])[0].abs()
            };
            assert!((angle(&a) - angle(&b)).abs() < 1e-9);
        }
        let (a, b, mut rng) = poses(9);
        let always = PoseAugmentation { interpolation: 1.0, ..PoseAugmentation::none() };
        let varied = always.apply(&a, &b, &mut rng);
        assert!(varied != a && varied != b);
    }

    #[test]
    fn defaults_keep_limits_and_are_reproducible() {
        let augmentation = PoseAugmentation::default();
        for seed in 0..50 {
            let (a, b, mut rng) = poses(seed);
            let mut again = rng.clone();
            let varied = augmentation.apply(&a, &b, &mut rng);
            assert_eq!(varied, augmentation.apply(&a, &b, &mut again));
            assert!(is_within_limits(&varied));
            assert_ne!(varied, a);
        }
    }
}
