//! A pose: one axis-angle rotation per joint, relative to the parent joint, with the T-pose as zero.

use super::rotation::{
    axis_angle_from_quaternion, normalized_quaternion, quaternion_conjugate, quaternion_from_axis_angle,
    quaternion_product,
};
use super::skeleton::{BODY_JOINT_COUNT, mirrored_joint};

/// Axis-angle rotations in radians, the first 22 those of the SMPL body joints. Joints past the end are at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// One rotation per joint; `rotations[0]` turns the whole body about the pelvis.
    pub rotations: Vec<[f64; 3]>,
}

impl Pose {
    /// All joints at rest.
    pub fn t_pose(joint_count: usize) -> Self {
        Self { rotations: vec![[0.0; 3]; joint_count] }
    }

    /// Every rotation angle multiplied by `scale`: 0 is the T-pose, 1 this pose (progressive learning).
    pub fn scaled(&self, scale: f64) -> Self {
        Self { rotations: self.rotations.iter().map(|r| r.map(|x| x * scale)).collect() }
    }

    /// Splits the root rotation into a turn about the world's vertical axis and the rest (swing–twist decomposition):
    /// `root = turn(yaw) · remaining`. Returns the pose with the remaining root and the yaw in `(−π, π]`.
    ///
    /// Gravity does not see the heading, so the networks need not either.
    pub fn without_heading(&self) -> (Self, f64) {
        let Some(root) = self.rotations.first() else { return (self.clone(), 0.0) };
        let q = quaternion_from_axis_angle(*root);
        let norm = q[0].hypot(q[2]);
        // A half turn about a horizontal axis has no heading; any choice is right, so take none.
        if norm < 1e-12 {
            return (self.clone(), 0.0);
        }
        // q and −q are the same rotation: a non-negative w keeps the yaw in `(−π, π]`.
        let (w, y) = if q[0] < 0.0 { (-q[0], -q[2]) } else { (q[0], q[2]) };
        let twist = normalized_quaternion([w, 0.0, y, 0.0]);
        let yaw = 2.0 * y.atan2(w);
        let mut pose = self.clone();
        pose.rotations[0] = axis_angle_from_quaternion(quaternion_product(quaternion_conjugate(twist), q));
        (pose, yaw)
    }

    /// As [`Self::scaled`], but the pose faces where this one faces at every scale.
    pub fn scaled_keeping_heading(&self, share: f64) -> Self {
        if share == 1.0 || self.rotations.is_empty() {
            return self.clone();
        }
        let (rest, yaw) = self.without_heading();
        let mut pose = rest.scaled(share);
        let turn = quaternion_from_axis_angle([0.0, yaw, 0.0]);
        let root = quaternion_product(turn, quaternion_from_axis_angle(pose.rotations[0]));
        pose.rotations[0] = axis_angle_from_quaternion(root);
        pose
    }

    /// The pose between this one, at `share` 0, and `other`, at 1. Joint vectors are mixed linearly, so that poses within limits
    /// that are boxes stay within them; the root, which may face anywhere, turns by the smaller angle.
    pub fn between(&self, other: &Self, share: f64) -> Self {
        let mut result = self.clone();
        for (joint, rotation) in result.rotations.iter_mut().enumerate() {
            let other = other.rotation(joint);
            if joint == 0 {
                let from = quaternion_from_axis_angle(*rotation);
                let step = axis_angle_from_quaternion(quaternion_product(
                    quaternion_conjugate(from),
                    quaternion_from_axis_angle(other),
                ));
                let part = quaternion_from_axis_angle(step.map(|x| share * x));
                *rotation = axis_angle_from_quaternion(quaternion_product(from, part));
            } else {
                *rotation = std::array::from_fn(|x| rotation[x] + share * (other[x] - rotation[x]));
            }
        }
        result
    }

    /// The pose seen in a mirror in the plane x = 0: left and right joints change places.
    pub fn mirrored(&self) -> Self {
        let count = self.rotations.len();
        let joint_count = count.max(BODY_JOINT_COUNT);
        let mut mirrored = Self::t_pose(joint_count);
        for (joint, r) in self.rotations.iter().enumerate() {
            mirrored.rotations[mirrored_joint(joint, joint_count)] = [r[0], -r[1], -r[2]];
        }
        mirrored
    }

    /// The rotation of joint `joint`; zero for joints this pose does not have.
    pub fn rotation(&self, joint: usize) -> [f64; 3] {
        self.rotations.get(joint).copied().unwrap_or([0.0; 3])
    }
}

#[cfg(test)]
mod tests {
    use super::super::rotation::{matrix_from_axis_angle, product};
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn random_pose(seed: u64, joints: usize) -> Pose {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        Pose {
            rotations: (0..joints).map(|_| std::array::from_fn(|_| rng.random_range(-1.7..1.7))).collect(),
        }
    }

    #[test]
    fn scaling_by_one_keeps_and_by_zero_is_the_t_pose() {
        let pose = random_pose(1, 22);
        assert_eq!(pose.scaled(1.0), pose);
        assert_eq!(pose.scaled(0.0), Pose::t_pose(22).scaled(0.0));
        assert!(pose.scaled(0.0).rotations.iter().flatten().all(|x| *x == 0.0));
    }

    #[test]
    fn a_scaled_pose_keeps_its_heading() {
        for seed in 0..20 {
            let pose = random_pose(seed, 22);
            let (tilt, yaw) = pose.without_heading();
            assert_eq!(pose.scaled_keeping_heading(1.0), pose);
            for share in [0.0, 0.3, 0.7] {
                let (now, heading) = pose.scaled_keeping_heading(share).without_heading();
                let whole_turns = (heading - yaw) / std::f64::consts::TAU;
                assert!((whole_turns - whole_turns.round()).abs() < 1e-9, "{heading} {yaw}");
                let expected = tilt.scaled(share);
                let pairs = now.rotations.as_flattened().iter().zip(expected.rotations.as_flattened());
                assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9));
            }
        }
    }

    #[test]
    fn mirroring_twice_is_the_identity() {
        for joints in [22, 24, 52, 55] {
            let pose = random_pose(joints as u64, joints);
            assert_ne!(pose.mirrored(), pose);
            assert_eq!(pose.mirrored().mirrored(), pose);
        }
    }

    #[test]
    fn heading_and_rest_compose_to_the_root_and_any_heading_leaves_the_rest() {
        for seed in 0..100 {
            let pose = random_pose(seed, 22);
            let (rest, yaw) = pose.without_heading();
            let turn = matrix_from_axis_angle([0.0, yaw, 0.0]);
            let whole = product(&turn, &matrix_from_axis_angle(rest.rotations[0]));
            let root = matrix_from_axis_angle(pose.rotations[0]);
            for (a, b) in whole.as_flattened().iter().zip(root.as_flattened()) {
                assert!((a - b).abs() < 1e-12);
            }
            // The rest has no turn about the vertical axis left.
            assert!(quaternion_from_axis_angle(rest.rotations[0])[2].abs() < 1e-12);

            let extra = quaternion_from_axis_angle([0.0, 0.37 * seed as f64, 0.0]);
            let mut turned = pose.clone();
            turned.rotations[0] = axis_angle_from_quaternion(quaternion_product(
                extra,
                quaternion_from_axis_angle(pose.rotations[0]),
            ));
            let (again, _) = turned.without_heading();
            for (a, b) in again.rotations[0].iter().zip(&rest.rotations[0]) {
                assert!((a - b).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn pure_turn_has_its_angle_as_heading() {
        for yaw in [-3.0, -0.4, 0.0, 1.2, 3.1] {
            let mut pose = Pose::t_pose(22);
            pose.rotations[0] = [0.0, yaw, 0.0];
            let (rest, found) = pose.without_heading();
            assert!((found - yaw).abs() < 1e-12);
            assert!(rest.rotations[0].iter().all(|x| x.abs() < 1e-12));
        }
    }
}
