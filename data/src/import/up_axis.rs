//! Which axis of a motion file's world is up.

use crate::asset::Pose;
use crate::asset::motion::mean_up;
use crate::asset::rotation::{
    IDENTITY, Matrix3, apply, axis_angle_from_matrix, matrix_from_axis_angle, product,
};

/// The axis that points up in the world of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorldUp {
    /// y, as in AIST++ and here.
    Y,
    /// z, as in AMASS and CLOTH3D.
    Z,
    /// −y, as in the coordinates of a camera (4D-Humans).
    YDown,
}

const WORLD_UPS: [WorldUp; 3] = [WorldUp::Y, WorldUp::Z, WorldUp::YDown];
/// The mean direction of a standing body is this long along the axis that is up …
const LEAST: f64 = 0.5;
/// … and this much longer than along any other one.
const LEAD: f64 = 0.25;

impl WorldUp {
    /// The axis along which the bodies stand on average, if it is plain.
    pub fn of(mean_up: [f64; 3]) -> Option<Self> {
        let mut along = WORLD_UPS.map(|axis| (axis.component(mean_up), axis));
        along.sort_by(|a, b| b.0.total_cmp(&a.0));
        let [(first, axis), (second, _), _] = along;
        (first > LEAST && first - second.max(mean_up[0].abs()) > LEAD).then_some(axis)
    }

    fn component(self, direction: [f64; 3]) -> f64 {
        apply(&self.to_y_up(), direction)[1]
    }

    /// Mean of the world's vertical component of the body's own vertical axis: 1 upright, 0 lying, −1 upside down.
    pub fn uprightness(self, poses: &[Pose]) -> f64 {
        self.component(mean_up(poses))
    }

    /// Turns a world with this axis up into one with y up.
    pub(super) fn to_y_up(self) -> Matrix3 {
        match self {
            Self::Y => IDENTITY,
            // (x, y, z) becomes (x, z, −y).
            Self::Z => [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
            Self::YDown => [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        }
    }

    /// Turns the root of a pose from a world with this axis up into one with y up.
    pub fn turn_root_to_y_up(self, pose: &mut Pose) {
        if let (true, Some(root)) = (self != Self::Y, pose.rotations.first_mut()) {
            *root = axis_angle_from_matrix(&product(&self.to_y_up(), &matrix_from_axis_angle(*root)));
        }
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
            Self::YDown => "−y",
        }
    }
}

/// Why the axis is not taken from the data.
pub(super) fn undecided(mean_up: [f64; 3]) -> String {
    let [x, y, z] = mean_up;
    format!(
        "which axis is up is not plain: the body's long axis points along ({x:.2}, {y:.2}, {z:.2}) on average; say it with --up \
         y, z or y-down"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn standing(axis: WorldUp) -> Pose {
        let mut pose = Pose::t_pose(22);
        pose.rotations[0] = match axis {
            WorldUp::Y => [0.0, 0.3, 0.0],
            WorldUp::Z => [FRAC_PI_2, 0.0, 0.0],
            WorldUp::YDown => [std::f64::consts::PI, 0.0, 0.0],
        };
        pose
    }

    #[test]
    fn a_standing_body_tells_the_axis_and_stands_after_the_turn() {
        for axis in WORLD_UPS {
            let mut pose = standing(axis);
            assert_eq!(WorldUp::of(mean_up(&[pose.clone()])), Some(axis));
            assert!(axis.uprightness(&[pose.clone()]) > 0.999);
            axis.turn_root_to_y_up(&mut pose);
            assert!(WorldUp::Y.uprightness(&[pose]) > 0.999);
        }
    }

    #[test]
    fn near_ties_are_not_decided() {
        // Half of the frames lie, bodies lean half-way, or turn over all the time; along x is no axis at all.
        let mean = |poses: &[Pose]| WorldUp::of(mean_up(poses));
        assert_eq!(mean(&[standing(WorldUp::Y), standing(WorldUp::Z)]), None);
        assert_eq!(mean(&[standing(WorldUp::Y), standing(WorldUp::YDown)]), None);
        for direction in [[0.0, 0.6, 0.5], [1.0, 0.0, 0.0], [0.7, 0.7, 0.0], [0.0; 3]] {
            assert_eq!(WorldUp::of(direction), None, "{direction:?}");
        }
        assert!(undecided([0.0, 0.6, 0.5]).contains("--up"));
    }

    #[test]
    fn a_body_standing_in_a_z_up_world_keeps_its_heading() {
        // Turned by 1 rad about the world's vertical.
        let about_z = matrix_from_axis_angle([0.0, 0.0, 1.0]);
        let turned = product(&about_z, &matrix_from_axis_angle([FRAC_PI_2, 0.0, 0.0]));
        let mut pose = Pose::t_pose(22);
        pose.rotations[0] = axis_angle_from_matrix(&turned);
        WorldUp::Z.turn_root_to_y_up(&mut pose);
        let expected = [0.0, 1.0, 0.0];
        assert!(pose.rotations[0].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
