//! Joints by their names, what they say about the stance of a body, and bodies whose skeletons have other joints than asked for.

use super::Body;
use crate::asset::skeleton::{BODY_JOINT_COUNT, family_ancestors, joint_index};

/// Heights of a body in metres, from a small child to a giant.
const BODY_HEIGHTS: std::ops::RangeInclusive<f64> = 0.4..=2.8;

impl Body {
    /// The joint of this SMPL name; in a skeleton that names no joint so, the one that SMPL has at its place.
    pub fn joint(&self, name: &str) -> Option<usize> {
        let has_smpl_names = || self.joint_names.iter().any(|n| joint_index(n).is_some());
        let named = self.joint_names.iter().position(|n| n == name);
        named.or_else(|| joint_index(name).filter(|j| *j < self.joint_count() && !has_smpl_names()))
    }

    /// Where that joint of the zero body lies (m).
    pub fn joint_place(&self, name: &str) -> Option<[f64; 3]> {
        self.joint(name).and_then(|j| self.joint_template.get(j)).copied()
    }

    /// Why the zero body is no person who stands in a T-pose, in metres with y up and +x to the left; `None` if it is one.
    pub fn implausibility(&self) -> Option<String> {
        let (low, high) = self.zero_body.bounds();
        let height = high[1] - low[1];
        if !BODY_HEIGHTS.contains(&height) {
            return Some(format!("{height:.2} m high: are the units metres and y up?"));
        }
        if self.joint_count() < BODY_JOINT_COUNT {
            return None;
        }
        let joint = &self.joint_template;
        let is_upright = joint[12][1] > joint[0][1] + 0.2 && joint[4][1] < joint[1][1] - 0.15;
        let is_spread = joint[20][0] > joint[16][0] + 0.2 && joint[21][0] < joint[17][0] - 0.2;
        (!is_upright || !is_spread).then(|| {
            "its joints are not in a T-pose in metres with y up and the left arm along +x: is it turned or mirrored?".into()
        })
    }

    /// The same body with joints of these names. One that it lacks is added without weight where its nearest ancestor of the SMPL
    /// family is, and follows that: to a body without fingers, hands are as stiff as if their fingers were at rest.
    ///
    /// # Errors
    /// The names of joints that are none of the SMPL family.
    pub fn with_joints(mut self, names: &[String]) -> Result<Self, Vec<String>> {
        let has = |body: &Self, name: &str| body.joint_names.iter().position(|n| n == name);
        let mut unknown = Vec::new();
        for name in names {
            if has(&self, name).is_some() {
                continue;
            }
            match family_ancestors(name).find_map(|ancestor| has(&self, &ancestor)) {
                Some(parent) => self.add_joint(name, parent),
                None => unknown.push(name.clone()),
            }
        }
        if unknown.is_empty() { Ok(self) } else { Err(unknown) }
    }

    /// Adds a joint without weight at the place of `parent`.
    fn add_joint(&mut self, name: &str, parent: usize) {
        let (joints, k) = (self.joint_count(), self.shape_count);
        let place = self.joint_template[parent];
        let directions = self.joint_shape_directions[3 * k * parent..3 * k * (parent + 1)].to_vec();
        self.joint_template.push(place);
        self.joint_shape_directions.extend(directions);
        self.parents.push(Some(parent));
        self.joint_names.push(name.to_owned());
        if let Some(old) = self.pose_directions.take() {
            // Nine more columns of zeros in every row.
            let columns = 9 * (joints - 1);
            let rows = old.len() / columns.max(1);
            let row = |r: usize| old[r * columns..(r + 1) * columns].iter().copied().chain([0.0; 9]);
            self.pose_directions = Some((0..rows).flat_map(row).collect());
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::asset::Pose;
    use crate::asset::skeleton::joint_names;
    use crate::generate::mannequin;

    #[test]
    fn joints_that_are_added_follow_their_ancestors_and_move_nothing() {
        let body = mannequin();
        let mut full = body.clone().with_joints(&joint_names(55)).unwrap();
        assert_eq!(full.joint_count(), 55);
        full.pose_directions = None;
        let mut pose = Pose::t_pose(22);
        for (j, rotation) in pose.rotations.iter_mut().enumerate() {
            *rotation = [0.02 * j as f64, -0.3, 0.1];
        }
        let beta = vec![0.5; body.shape_count];
        let (before, after) = (body.posed(&beta, &pose).unwrap(), full.posed(&beta, &pose).unwrap());
        assert_eq!(before.positions, after.positions);
        let at = |name: &str| full.joint_names.iter().position(|n| n == name).unwrap();
        for (joint, ancestor) in
            [("left_thumb2", "left_wrist"), ("jaw", "head"), ("right_index3", "right_wrist")]
        {
            let distance = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).sum::<f64>();
            assert!(distance(after.joints[at(joint)], after.joints[at(ancestor)]) < 1e-12, "{joint}");
        }
    }

    #[test]
    fn pose_correctives_of_added_joints_are_zero() {
        let mut body = mannequin();
        let columns = 9 * (body.joint_count() - 1);
        body.pose_directions =
            Some((0..body.vertex_count() * 3 * columns).map(|i| (i % 7) as f32 * 1e-4).collect());
        let full = body.clone().with_joints(&["left_thumb1".into(), "pelvis".into()]).unwrap();
        assert_eq!(full.joint_count(), body.joint_count() + 1);
        let mut pose = Pose::t_pose(body.joint_count() + 1);
        pose.rotations[4] = [0.7, 0.0, 0.0];
        pose.rotations[body.joint_count()] = [0.0, 1.0, 0.0];
        let without = Pose { rotations: pose.rotations[..body.joint_count()].to_vec() };
        assert_eq!(body.posed(&[], &without).unwrap().positions, full.posed(&[], &pose).unwrap().positions);
    }

    #[test]
    fn joints_of_no_known_family_are_told() {
        let names = ["tail".to_owned(), "left_hip".to_owned(), "joint_60".to_owned()];
        assert_eq!(mannequin().with_joints(&names).unwrap_err(), ["tail", "joint_60"]);
    }
}
