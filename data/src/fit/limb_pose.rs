//! Bodies with lowered arms and legs apart, and garments back from there to the T-pose.

use super::placement::Placement;
use crate::asset::body::unskin;
use crate::asset::{Binding, BindingSettings, Body, Category, Garment, Pose};
use clothcombo_physics::TriMesh;
use clothcombo_physics::query::Surface;

/// The zero body with its arms this far below the horizontal, and each leg this far outwards (degrees).
#[derive(Debug)]
pub(super) struct LimbPose {
    pub angles: [f64; 2],
    pub pose: Pose,
    pub positions: Vec<[f64; 3]>,
    pub surface: Surface<f64>,
}

/// Joints of arms and of legs that are turned, left and right.
pub(super) const LIMBS: [[&str; 2]; 2] = [["left_shoulder", "right_shoulder"], ["left_hip", "right_hip"]];

/// The pose in which arms hang down and legs are apart by these angles (degrees); joints that a body lacks stay as they are.
pub(super) fn limb_pose(body: &Body, angles: [f64; 2]) -> Pose {
    let mut pose = Pose::t_pose(body.joint_count());
    for (names, inwards) in LIMBS.iter().zip([angles[0], -angles[1]]) {
        for (name, sign) in names.iter().zip([-1.0, 1.0]) {
            if let Some(j) = body.joint(name) {
                pose.rotations[j] = [0.0, 0.0, sign * inwards.to_radians()];
            }
        }
    }
    pose
}

impl LimbPose {
    /// In a garment's pose.
    pub fn of(body: &Body, placement: &Placement) -> Self {
        let angles = [placement.arm_angle_degrees, placement.leg_angle_degrees];
        let pose = limb_pose(body, angles);
        let mut positions = body.template.clone();
        // The pose has exactly the body's joints and no shape numbers: nothing to refuse.
        if angles != [0.0; 2]
            && let Ok(posed) = body.posed(&[], &pose)
        {
            positions = posed.positions;
        }
        let surface = Surface::new(positions.clone(), body.faces.clone());
        Self { angles, pose, positions, surface }
    }

    /// Carries a garment on this body to the zero body: inverts the linear blend skinning of its binding. The binding depends
    /// on where the garment ends up, so it is first taken on the posed body and then twice on the result.
    pub fn to_t_pose(
        &self,
        positions: &[[f64; 3]],
        faces: &[[u32; 3]],
        category: Option<Category>,
        body: &Body,
    ) -> Result<Vec<[f64; 3]>, String> {
        if self.angles == [0.0; 2] {
            return Ok(positions.to_vec());
        }
        // Shapes are not needed here, and copying them would cost more than everything else.
        let mut bare = body.clone();
        (bare.shape_directions, bare.shape_count, bare.pose_directions) = (Vec::new(), 0, None);
        let mut posed = bare.clone();
        posed.template = self.positions.clone();
        let bones = body.bone_transforms(&body.joint_template, &self.pose);
        let settings = BindingSettings { shape_transfer: false, ..BindingSettings::default() };
        let mut rest = positions.to_vec();
        for round in 0..3 {
            let mesh = TriMesh::new(rest, faces.to_vec()).map_err(|e| e.to_string())?;
            let category = category.unwrap_or_else(|| Category::guess(&mesh, body));
            let garment = Garment::new(category, mesh);
            let binding = Binding::new(&garment, if round == 0 { &posed } else { &bare }, &settings);
            rest = positions
                .iter()
                .zip(binding.skin_weights.chunks_exact(body.joint_count()))
                .map(|(p, row)| unskin(*p, bones.iter().zip(row).map(|(bone, w)| (bone, f64::from(*w)))))
                .collect::<Option<_>>()
                .ok_or(
                    "arms and legs cannot be brought to the T-pose: a blended bone transform has no inverse",
                )?;
        }
        Ok(rest)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
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
        let back = arms.to_t_pose(&posed, shirt.rest.faces(), Some(shirt.category), &body).unwrap();
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
