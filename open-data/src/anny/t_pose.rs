//! From the rig's A-pose to a T-pose: arms along ±x with palms down, legs straight and nearly vertical, toes forward.

use super::rig::Rig;
use clothcombo_data::asset::body::skin;
use clothcombo_data::asset::rotation::{IDENTITY, Matrix3, apply, between, matrix_from_axis_angle, product};
use clothcombo_physics::transform;
use clothcombo_physics::vec3::{add, sub};
use rayon::prelude::*;

/// Clavicles rise with the arms.
const CLAVICLE_LIFT: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// Joints of one side of SMPL-X: collar, shoulder, elbow, wrist, first index joint, hip, knee, ankle, foot.
struct Side {
    sign: f64,
    collar: usize,
    shoulder: usize,
    elbow: usize,
    wrist: usize,
    hand: usize,
    hip: usize,
    knee: usize,
    ankle: usize,
    foot: usize,
}

const SIDES: [Side; 2] = [
    Side {
        sign: 1.0,
        collar: 13,
        shoulder: 16,
        elbow: 18,
        wrist: 20,
        hand: 25,
        hip: 1,
        knee: 4,
        ankle: 7,
        foot: 10,
    },
    Side {
        sign: -1.0,
        collar: 14,
        shoulder: 17,
        elbow: 19,
        wrist: 21,
        hand: 40,
        hip: 2,
        knee: 5,
        ankle: 8,
        foot: 11,
    },
];

/// Vertices and joints of a person in T-pose, pelvis at the origin.
pub struct Posed {
    pub positions: Vec<[f64; 3]>,
    pub joints: Vec<[f64; 3]>,
}

/// Re-poses one person's base mesh by linear blend skinning.
pub fn t_pose(rig: &Rig, positions: &[[f64; 3]]) -> Posed {
    let joints = rig.joints(positions);
    let world = world_rotations(&joints);
    let mut places = vec![[0.0; 3]; joints.len()];
    let mut bones = Vec::with_capacity(joints.len());
    for (j, joint) in joints.iter().enumerate() {
        if let Some(p) = rig.parents[j] {
            places[j] = add(places[p], apply(&world[p], sub(*joint, joints[p])));
        }
        let moved = apply(&world[j], *joint);
        let bone: [[f64; 4]; 3] = std::array::from_fn(|a| {
            let r = world[j][a];
            [r[0], r[1], r[2], places[j][a] - moved[a]]
        });
        bones.push(bone);
    }
    let positions = positions
        .par_iter()
        .with_min_len(2048)
        .enumerate()
        .map(|(v, p)| skin(*p, rig.skin_weights.of_vertex(v).map(|(j, w)| (&bones[j], f64::from(w)))))
        .collect();
    let joints = joints.iter().zip(&bones).map(|(p, b)| transform::apply(b, *p)).collect();
    Posed { positions, joints }
}

/// World rotation of each joint that takes the person's rest pose to the T-pose.
fn world_rotations(joints: &[[f64; 3]]) -> Vec<Matrix3> {
    let mut world = vec![IDENTITY; joints.len()];
    let bone = |from: usize, to: usize| sub(joints[to], joints[from]);
    for side in &SIDES {
        let s = side.sign;
        let along = [s, 0.0, 0.0];
        // Fingers follow index, middle, pinky, ring, thumb with three joints each.
        let (index, middle, pinky) = (side.hand, side.hand + 3, side.hand + 6);
        let collar = matrix_from_axis_angle([0.0, 0.0, s * CLAVICLE_LIFT]);
        let aligned = |parent: &Matrix3, direction: [f64; 3], to: [f64; 3]| {
            product(&between(apply(parent, direction), to), parent)
        };
        let shoulder = aligned(&collar, bone(side.shoulder, side.elbow), along);
        let elbow = aligned(&shoulder, bone(side.elbow, side.wrist), along);
        let wrist = aligned(&elbow, bone(side.wrist, middle), along);
        // A small roll about the arm levels the knuckles (index → pinky points backwards), spread over the arm. Its sense is
        // that of the published preparation script, so that both give the same body; at about 1° it hardly shows.
        let knuckles = apply(&wrist, bone(index, pinky));
        let turn = std::f64::consts::TAU;
        let roll = 0.5 * turn - knuckles[1].atan2(knuckles[2]);
        let roll = (roll + 0.5 * turn).rem_euclid(turn) - 0.5 * turn;
        let rolled = |share: f64, m: &Matrix3| product(&matrix_from_axis_angle([share * roll, 0.0, 0.0]), m);
        world[side.collar] = collar;
        world[side.shoulder] = rolled(0.3, &shoulder);
        world[side.elbow] = rolled(0.65, &elbow);
        world[side.wrist] = rolled(1.0, &wrist);
        for j in side.hand..side.hand + 15 {
            world[j] = world[side.wrist];
        }
        let hip = between(bone(side.hip, side.knee), [s * 0.035, -1.0, 0.0]);
        world[side.hip] = hip;
        world[side.knee] = aligned(&hip, bone(side.knee, side.ankle), [s * 0.035, -1.0, -0.03]);
        let toes = bone(side.ankle, side.foot);
        let length = toes[0].hypot(toes[2]);
        world[side.ankle] = between(toes, [s * 0.12 * length, toes[1], length]);
        world[side.foot] = world[side.ankle];
    }
    world
}
