//! Bodies with lowered arms and legs apart.

use super::placement::Placement;
use crate::asset::{Body, Pose};
use clothcombo_physics::query::Surface;

/// A body with its arms this far below the horizontal, and each leg this far outwards.
#[derive(Clone, Debug)]
pub(super) struct LimbPose {
    /// Of arms and legs (degrees).
    pub angles: [f64; 2],
    pub shape: Vec<f64>,
    /// Posed vertices (m).
    pub positions: Vec<[f64; 3]>,
    pub bones: Vec<[[f64; 4]; 3]>,
}

/// Joints of arms and of legs that are turned, left and right.
pub(super) const LIMB_ROOTS: [[&str; 2]; 2] =
    [["left_shoulder", "right_shoulder"], ["left_hip", "right_hip"]];

/// The pose in which arms hang down and legs are apart by these angles (degrees); joints that a body lacks stay as they are.
pub(super) fn limb_pose(body: &Body, angles: [f64; 2]) -> Pose {
    let mut pose = Pose::t_pose(body.joint_count());
    for (names, inwards) in LIMB_ROOTS.iter().zip([angles[0], -angles[1]]) {
        for (name, sign) in names.iter().zip([-1.0, 1.0]) {
            if let Some(j) = body.joint(name) {
                pose.rotations[j] = [0.0, 0.0, sign * inwards.to_radians()];
            }
        }
    }
    pose
}

impl LimbPose {
    /// # Errors
    /// When the shape has more numbers than the body.
    pub fn new(body: &Body, shape: &[f64], angles: [f64; 2]) -> Result<Self, String> {
        let posed = body.posed(shape, &limb_pose(body, angles)).map_err(|e| e.to_string())?;
        Ok(Self { angles, shape: shape.to_vec(), positions: posed.positions, bones: posed.bones })
    }

    /// The zero body in a garment's pose.
    pub fn of(body: &Body, placement: &Placement) -> Self {
        let angles = [placement.arm_angle_degrees, placement.leg_angle_degrees];
        Self::new(body, &[], angles).expect("a pose of the body's own joints, and no shape")
    }

    /// Its surface (m).
    pub fn surface(&self, body: &Body) -> Surface<f64> {
        Surface::new(self.positions.clone(), body.faces.clone())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::asset::{Binding, BindingSettings, Category, Garment};
    use crate::fit::from_body::{POSE_BINDINGS, SameModel, SourceCloth};
    use crate::generate::garment::generated;
    use crate::generate::mannequin;

    /// A generated garment skinned to lowered arms and legs apart as draping does.
    pub(crate) fn posed(garment: &Garment, body: &Body, angles: [f64; 2]) -> Vec<[f64; 3]> {
        let pose = limb_pose(body, angles);
        let bones = body.bone_transforms(&body.joint_template, &pose);
        let binding = Binding::new(garment, body, &BindingSettings::default());
        binding.skinned(garment.rest.positions(), &bones)
    }

    #[test]
    fn sleeves_come_back_from_an_a_pose() {
        let body = mannequin();
        let shirt = generated(&body, Category::TShirt, 3, 700);
        let arms = LimbPose::of(&body, &Placement { arm_angle_degrees: 40.0, ..Placement::AS_GIVEN });
        let posed = posed(&shirt, &body, [40.0, 0.0]);
        let cloth =
            SourceCloth { positions: &posed, faces: shirt.rest.faces(), category: Some(shirt.category) };
        let back = SameModel::posed(&body, arms).unwrap().carry(&cloth, &body, POSE_BINDINGS).unwrap();
        let mut errors: Vec<f64> = back
            .iter()
            .zip(shirt.rest.positions())
            .map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt())
            .collect();
        errors.sort_by(f64::total_cmp);
        let moved =
            posed.iter().zip(shirt.rest.positions()).filter(|(a, b)| (a[1] - b[1]).abs() > 0.02).count();
        assert!(moved > 50, "{moved}");
        assert!(errors[errors.len() / 2] < 5e-4, "median {}", errors[errors.len() / 2]);
        assert!(errors[errors.len() * 95 / 100] < 5e-3, "p95 {}", errors[errors.len() * 95 / 100]);
    }
}
