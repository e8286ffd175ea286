//! From the rig's A-pose to a T-pose: arms along ±x with palms down, legs straight and nearly vertical, toes forward.

use super::rig::BaseRig;
use clothcombo_data::asset::body::skin;
use clothcombo_data::asset::rotation::{
    IDENTITY, Matrix3, apply, between, matrix_from_axis_angle, product, rigid_motion,
};
use clothcombo_physics::transform;
use clothcombo_physics::vec3::{add, sub};
use rayon::prelude::*;

/// Clavicles rise with the arms.
const CLAVICLE_LIFT: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Vertices and joints of a person in T-pose, pelvis at the origin.
pub struct TPosed {
    pub positions: Vec<[f64; 3]>,
    pub joints: Vec<[f64; 3]>,
}

/// Re-poses one person's base mesh by linear blend skinning.
pub fn t_pose(rig: &BaseRig, positions: &[[f64; 3]]) -> TPosed {
    let joints = rig.joints(positions);
    let world = world_rotations(&joints);
    let mut places = vec![[0.0; 3]; joints.len()];
    let mut bones = Vec::with_capacity(joints.len());
    for (j, joint) in joints.iter().enumerate() {
        if let Some(p) = rig.parents[j] {
            places[j] = add(places[p], apply(&world[p], sub(*joint, joints[p])));
        }
        bones.push(rigid_motion(&world[j], *joint, places[j]));
    }
    let positions = positions
        .par_iter()
        .with_min_len(2048)
        .enumerate()
        .map(|(v, p)| skin(*p, rig.skin_weights.of_vertex(v).map(|(j, w)| (&bones[j], f64::from(w)))))
        .collect();
    let joints = joints.iter().zip(&bones).map(|(p, b)| transform::apply(b, *p)).collect();
    TPosed { positions, joints }
}

/// World rotation of each joint that takes the person's rest pose to the T-pose.
fn world_rotations(joints: &[[f64; 3]]) -> Vec<Matrix3> {
    let mut world = vec![IDENTITY; joints.len()];
    let bone = |from: usize, to: usize| sub(joints[to], joints[from]);
    for (side, s) in [(0, 1.0), (1, -1.0)] {
        // Of SMPL-X: the joints of the right side come after those of the left one, its fingers 15 later.
        let [hip, knee, ankle, foot] = [1, 4, 7, 10].map(|left| left + side);
        let [collar, shoulder, elbow, wrist] = [13, 16, 18, 20].map(|left| left + side);
        let hand = 25 + 15 * side;
        let along = [s, 0.0, 0.0];
        // Fingers follow index, middle, pinky, ring, thumb with three joints each.
        let (index, middle, pinky) = (hand, hand + 3, hand + 6);
        world[collar] = matrix_from_axis_angle([0.0, 0.0, s * CLAVICLE_LIFT]);
        let aligned = |parent: &Matrix3, direction: [f64; 3], to: [f64; 3]| {
            product(&between(apply(parent, direction), to), parent)
        };
        let upper_arm = aligned(&world[collar], bone(shoulder, elbow), along);
        let forearm = aligned(&upper_arm, bone(elbow, wrist), along);
        let palm = aligned(&forearm, bone(wrist, middle), along);
        // A small roll about the arm levels the knuckles (index → pinky points backwards), spread over the arm. Its sense is
        // that of the published preparation script, so that both give the same body; at about 1° it hardly shows.
        let knuckles = apply(&palm, bone(index, pinky));
        let turn = std::f64::consts::TAU;
        let roll = 0.5 * turn - knuckles[1].atan2(knuckles[2]);
        let roll = (roll + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
        let rolled = |share: f64, m: &Matrix3| product(&matrix_from_axis_angle([share * roll, 0.0, 0.0]), m);
        world[shoulder] = rolled(0.3, &upper_arm);
        world[elbow] = rolled(0.65, &forearm);
        world[wrist] = rolled(1.0, &palm);
        let whole_hand = world[wrist];
        world[hand..hand + 15].fill(whole_hand);
        world[hip] = between(bone(hip, knee), [s * 0.035, -1.0, 0.0]);
        world[knee] = aligned(&world[hip], bone(knee, ankle), [s * 0.035, -1.0, -0.03]);
        let toes = bone(ankle, foot);
        let length = toes[0].hypot(toes[2]);
        world[ankle] = between(toes, [s * 0.12 * length, toes[1], length]);
        world[foot] = world[ankle];
    }
    world
}
