//! Similarities that carry the bones of one body to those of another, by SMPL's names of the joints.
//!
//! Trunks stand upright in every T-pose, and where a rig has its spine joints is a matter of taste: the trunk is one
//! part, scaled by the height from the hips to the shoulders. Limbs turn with their bones and are scaled by their
//! lengths.

use crate::asset::Body;
use crate::asset::rotation::{IDENTITY, Matrix3, apply, matrix_from_axis_angle};
use clothcombo_physics::vec3::{add, cross, dot, norm, scale, sub};

/// Limbs from the trunk outwards.
const LIMB_JOINTS: [[&str; 4]; 4] = [
    ["left_hip", "left_knee", "left_ankle", "left_foot"],
    ["right_hip", "right_knee", "right_ankle", "right_foot"],
    ["left_shoulder", "left_elbow", "left_wrist", ""],
    ["right_shoulder", "right_elbow", "right_wrist", ""],
];

/// The joint of exactly this name.
fn joint(body: &Body, name: &str) -> Option<usize> {
    body.joint_names.iter().position(|n| n == name)
}

/// The middle between the joints of both sides (m).
fn middle(body: &Body, part: &str) -> Result<[f64; 3], String> {
    let side = |side: &str| {
        let name = format!("{side}_{part}");
        let place = joint(body, &name).map(|j| body.joint_template[j]);
        place.ok_or(format!("it has no joint '{name}'; joints are matched by SMPL's names"))
    };
    Ok(scale(add(side("left")?, side("right")?), 0.5))
}

/// For every joint of `source` the affine map (a similarity) of its part to `target`.
///
/// # Errors
/// When hips or shoulders are missing, or lie on each other.
pub(super) fn similarities(source: &Body, target: &Body) -> Result<Vec<[[f64; 4]; 3]>, String> {
    let [low, to_low] = [middle(source, "hip")?, middle(target, "hip")?];
    let [high, to_high] = [middle(source, "shoulder")?, middle(target, "shoulder")?];
    let factor = (to_high[1] - to_low[1]) / (high[1] - low[1]);
    if !(0.2..=5.0).contains(&factor) {
        return Err(format!(
            "its hips and shoulders are {:.2} m apart, which is no upright person",
            high[1] - low[1]
        ));
    }
    let between = |a, b| scale(add(a, b), 0.5);
    let trunk = similarity(&IDENTITY, factor, between(low, high), between(to_low, to_high));
    let mut maps = vec![trunk; source.joint_count()];
    // The joint, and where it is on either body.
    let both = |name: &str| {
        let (j, k) = (joint(source, name)?, joint(target, name)?);
        Some((j, source.joint_template[j], target.joint_template[k]))
    };
    let mut is_limb = vec![false; maps.len()];
    for limb in LIMB_JOINTS {
        let (mut turn, mut length) = (IDENTITY, factor);
        for (k, name) in limb.iter().enumerate() {
            let Some((j, from, to)) = both(name) else { continue };
            // Hands and feet go on as what they hang on.
            if let Some((_, a, b)) = limb.get(k + 1).and_then(|next| both(next)) {
                let (a, b) = (sub(a, from), sub(b, to));
                if norm(a) > 1e-3 && norm(b) > 1e-3 && k < 2 {
                    turn = shortest_turn(a, b);
                    length = (norm(b) / norm(a)).clamp(0.5, 2.0);
                }
            }
            maps[j] = similarity(&turn, length, from, to);
            is_limb[j] = true;
        }
    }
    // Fingers, and joints of other rigs: as their parents. Collars and the head are trunk.
    for j in 0..maps.len() {
        if let Some(parent) = source.parents.get(j).copied().flatten().filter(|_| !is_limb[j]) {
            maps[j] = maps[parent];
            is_limb[j] = is_limb[parent];
        }
    }
    Ok(maps)
}

/// `p ↦ factor · R · (p − from) + to`.
fn similarity(turn: &Matrix3, factor: f64, from: [f64; 3], to: [f64; 3]) -> [[f64; 4]; 3] {
    let shift = sub(to, scale(apply(turn, from), factor));
    std::array::from_fn(|a| {
        let [x, y, z] = turn[a].map(|x| factor * x);
        [x, y, z, shift[a]]
    })
}

/// The smallest rotation from one direction to another.
fn shortest_turn(from: [f64; 3], to: [f64; 3]) -> Matrix3 {
    let axis = cross(from, to);
    let length = norm(axis);
    if length < 1e-12 {
        return IDENTITY;
    }
    matrix_from_axis_angle(scale(axis, length.atan2(dot(from, to)) / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::transform::apply as transform;

    #[test]
    fn joints_of_limbs_go_to_joints_and_a_body_to_itself() {
        let body = mannequin();
        let other: Vec<[f64; 3]> =
            body.joint_template.iter().map(|[x, y, z]| [1.1 * x, 0.9 * y - 0.05 * x.abs(), *z]).collect();
        let mut source = body.clone();
        source.joint_template.clone_from(&other);
        let maps = similarities(&source, &body).unwrap();
        for name in LIMB_JOINTS.iter().flatten().filter(|n| !n.is_empty()) {
            let j = body.joint_names.iter().position(|n| n == name).unwrap();
            let error = norm(sub(transform(&maps[j], other[j]), body.joint_template[j]));
            assert!(error < 1e-9, "{name}: {error}");
        }
        let own = similarities(&body, &body).unwrap();
        for (map, p) in own.iter().zip(&body.joint_template) {
            assert!(norm(sub(transform(map, *p), *p)) < 1e-12);
        }
    }

    #[test]
    fn a_rig_of_other_names_is_refused() {
        let body = mannequin();
        let mut other = body.clone();
        other.joint_names.iter_mut().for_each(|n| *n = format!("rig:{n}"));
        assert!(similarities(&other, &body).unwrap_err().contains("left_hip"));
    }
}
