//! New poses from recorded limbs: trunk, legs and arms each from a kernel density over what was recorded of them.

use super::limits::JOINT_LIMITS;
use crate::asset::{BODY_JOINT_COUNT, Pose};
use rand::distr::weighted::WeightedIndex;
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

/// Standard deviation of the kernel on each axis-angle component (degrees): neighbouring recordings of everyday motion lie about
/// so far apart, so that the density has no holes between them.
const BANDWIDTH: f64 = 8.0;

/// The pelvis, whose tilt goes with the spine, and what stands on it.
const TRUNK_JOINTS: [usize; 6] = [0, 3, 6, 9, 12, 15];
const LEGS_BY_SIDE: [[usize; 4]; 2] = [[1, 4, 7, 10], [2, 5, 8, 11]];
const ARMS_BY_SIDE: [[usize; 4]; 2] = [[13, 16, 18, 20], [14, 17, 19, 21]];

/// A kernel density over the limbs of recorded poses and of their mirror images.
#[derive(Debug, Clone)]
pub struct LimbDensity {
    poses: Vec<Pose>,
    weights: Vec<f64>,
    shares: WeightedIndex<f64>,
}

impl LimbDensity {
    /// That of `recorded` poses with their weights; `None` without a positive finite weight.
    pub fn new<'a>(recorded: impl IntoIterator<Item = (&'a Pose, f64)>) -> Option<Self> {
        let (mut poses, mut weights) = (Vec::new(), Vec::new());
        for (pose, weight) in recorded {
            poses.extend([pose.clone(), pose.mirrored()]);
            weights.extend([weight, weight]);
        }
        let shares = WeightedIndex::new(&weights).ok()?;
        Some(Self { poses, weights, shares })
    }

    /// A pose of limbs that were perhaps never seen together. The legs, which carry the body, are: the second one comes from the
    /// density given the first.
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pose {
        let mut pose = Pose::t_pose(BODY_JOINT_COUNT);
        self.copy(&TRUNK_JOINTS, self.shares.sample(rng), &mut pose, rng);
        self.copy(&LEGS_BY_SIDE[0], self.shares.sample(rng), &mut pose, rng);
        self.copy(&LEGS_BY_SIDE[1], self.given(&LEGS_BY_SIDE[0], &pose, rng), &mut pose, rng);
        for arm in &ARMS_BY_SIDE {
            self.copy(arm, self.shares.sample(rng), &mut pose, rng);
        }
        pose
    }

    /// Takes `joints` from recording `of`, a kernel away. No component leaves its joint limit, or the recorded value where the
    /// recording itself exceeds the limit.
    fn copy<R: Rng + ?Sized>(&self, joints: &[usize], of: usize, pose: &mut Pose, rng: &mut R) {
        for &joint in joints {
            let recorded = self.poses[of].rotation(joint);
            let limits = JOINT_LIMITS[joint];
            pose.rotations[joint] = std::array::from_fn(|axis| {
                let noise: f64 = StandardNormal.sample(rng);
                // The pelvis may lie or turn over.
                let (low, high) = match joint {
                    0 => (f64::NEG_INFINITY, f64::INFINITY),
                    _ => (limits.low[axis].to_radians(), limits.high[axis].to_radians()),
                };
                let moved = recorded[axis] + BANDWIDTH.to_radians() * noise;
                moved.clamp(low.min(recorded[axis]), high.max(recorded[axis]))
            });
        }
    }

    /// A recording, drawn by its weight times the kernel between its `joints` and those of `pose`.
    fn given<R: Rng + ?Sized>(&self, joints: &[usize], pose: &Pose, rng: &mut R) -> usize {
        let precision = 0.5 / BANDWIDTH.to_radians().powi(2);
        let mut sum = 0.0;
        let sums: Vec<f64> = (self.poses.iter().zip(&self.weights))
            .map(|(recorded, weight)| {
                let square = |joint: &usize| {
                    let (a, b) = (recorded.rotation(*joint), pose.rotation(*joint));
                    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>()
                };
                sum += weight * (-precision * joints.iter().map(square).sum::<f64>()).exp();
                sum
            })
            .collect();
        let wanted = sum * rng.random::<f64>();
        sums.partition_point(|sum| *sum <= wanted).min(sums.len() - 1)
    }
}

/// A pose whose every component is uniform within its joint limit; the pelvis keeps its heading.
pub fn uniform_pose<R: Rng + ?Sized>(rng: &mut R) -> Pose {
    let mut pose = Pose::t_pose(BODY_JOINT_COUNT);
    for (joint, (rotation, limits)) in pose.rotations.iter_mut().zip(&JOINT_LIMITS).enumerate() {
        for axis in 0..3 {
            let share = rng.random::<f64>();
            if joint > 0 || axis != 1 {
                let (low, high) = (limits.low[axis], limits.high[axis]);
                rotation[axis] = (low + (high - low) * share).to_radians();
            }
        }
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::super::is_within_limits;
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn degrees(joint: usize, angle: f64) -> Pose {
        let mut pose = Pose::t_pose(22);
        pose.rotations[joint][0] = angle.to_radians();
        pose
    }

    #[test]
    fn limbs_are_recombined_within_the_limits_and_the_legs_stay_together() {
        // Somebody who raises either one thigh by 60°, never both nor none, and nods or raises an arm.
        let mut recorded = Vec::new();
        for (nods, twists) in [(0.0, 0.0), (20.0, 0.0), (0.0, 50.0)] {
            let mut pose = degrees(1, -60.0);
            pose.rotations[15][0] = f64::to_radians(nods);
            pose.rotations[16][0] = f64::to_radians(twists);
            recorded.push(pose);
        }
        let density = LimbDensity::new(recorded.iter().map(|pose| (pose, 1.0))).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let poses: Vec<Pose> = (0..2000).map(|_| density.sample(&mut rng)).collect();
        assert!(
            poses.iter().all(|pose| is_within_limits(&Pose {
                rotations: [&[[0.0; 3]], &pose.rotations[1..]].concat()
            }))
        );
        let raised = |pose: &Pose, leg: usize| pose.rotations[leg][0] < -30f64.to_radians();
        let one = poses.iter().filter(|pose| raised(pose, 1) != raised(pose, 2)).count();
        assert!(one > 1990, "{one}");
        let left = poses.iter().filter(|pose| raised(pose, 1)).count();
        assert!((900..1100).contains(&left), "{left}");
        // A nod (one of three) with a twisted arm (one of six) was not recorded.
        let both = |pose: &&Pose| pose.rotations[15][0] > 0.2 && pose.rotations[16][0] > 0.5;
        let new = poses.iter().filter(both).count();
        assert!((60..160).contains(&new), "{new}");
        // The kernel is as wide as it should be.
        let angles: Vec<f64> =
            poses.iter().filter(|p| raised(p, 1)).map(|p| p.rotations[1][0].to_degrees()).collect();
        let variance = angles.iter().map(|a| (a + 60.0).powi(2)).sum::<f64>() / angles.len() as f64;
        assert!((variance.sqrt() - BANDWIDTH).abs() < 0.6, "{}", variance.sqrt());
    }

    #[test]
    fn nothing_recorded_has_no_density() {
        assert!(LimbDensity::new([]).is_none());
        assert!(LimbDensity::new([(&Pose::t_pose(22), 0.0)]).is_none());
    }

    #[test]
    fn uniform_poses_fill_the_limits() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let poses: Vec<Pose> = (0..500).map(|_| uniform_pose(&mut rng)).collect();
        assert!(poses.iter().all(|pose| is_within_limits(pose) && pose.rotations[0][1] == 0.0));
        let knees: Vec<f64> = poses.iter().map(|pose| pose.rotations[4][0].to_degrees()).collect();
        let mean = knees.iter().sum::<f64>() / 500.0;
        assert!(
            (mean - 67.5).abs() < 6.0 && knees.iter().any(|a| *a < 5.0) && knees.iter().any(|a| *a > 130.0)
        );
    }
}
