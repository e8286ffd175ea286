//! Shape components of the mannequin: smooth displacement fields of space, which move skin and joints together, and
//! thickness fields along the surface normal, which move the skin alone.

use super::super::field::smooth_step;
use super::anatomy;
use crate::asset::SparseSkinWeights;
use clothcombo_physics::mesh::vertex_normals;

/// What each shape component changes; one unit is about one standard deviation, coefficients belong in `[−2, 2]`.
pub const SHAPE_COMPONENT_NAMES: [&str; 8] =
    ["height", "girth", "shoulder_width", "hip_width", "leg_length", "arm_length", "torso_length", "belly"];

const SHAPE_COUNT: usize = SHAPE_COMPONENT_NAMES.len();

/// A ramp through zero that saturates at ±1 over `|x| ≥ width`.
fn soft_sign(x: f64, width: f64) -> f64 {
    let t = (x / width).clamp(-1.0, 1.0);
    t * (1.5 - 0.5 * t * t)
}

/// Displacement (m) of a point of space per unit of each component.
fn space(p: [f64; 3]) -> [[f64; 3]; SHAPE_COUNT] {
    let side = |width| soft_sign(p[0], width);
    let upper = smooth_step(0.16, 0.40, p[1]);
    let lower = smooth_step(0.16, -0.06, p[1]);
    let down_leg = ((-0.06 - p[1]) / 0.80).clamp(0.0, 1.0);
    let along_arm = ((p[0].abs() - 0.17) / 0.51).clamp(0.0, 1.0) * p[0].signum();
    let up_torso = smooth_step(0.02, 0.42, p[1]);
    // The neck and head stay where they are when the shoulders widen.
    let below_neck = smooth_step(0.60, 0.50, p[1]);
    [
        [0.030 * p[0], 0.034 * p[1], 0.030 * p[2]],
        // Thicker thighs need hips further apart.
        [0.011 * side(0.10) * lower, 0.0, 0.0],
        [0.012 * side(0.17) * upper * below_neck, 0.0, 0.0],
        [0.009 * side(0.12) * lower, 0.0, 0.0],
        [0.0, -0.028 * down_leg, 0.0],
        [0.018 * along_arm * upper, 0.0, 0.0],
        [0.0, 0.017 * up_torso, 0.0],
        [0.0; 3],
    ]
}

/// Displacement (m) along the normal per unit of each component, by the joint a vertex follows.
fn thickness(p: [f64; 3], n: [f64; 3], joint: usize) -> [f64; SHAPE_COUNT] {
    let girth = match joint {
        0 | 3 | 6 => 0.0135,
        9 => 0.0115,
        1 | 2 => 0.0095,
        4 | 5 => 0.0055,
        7 | 8 | 10 | 11 => 0.0015,
        12 => 0.004,
        13 | 14 => 0.007,
        15 => 0.002,
        16 | 17 => 0.006,
        18 | 19 => 0.0035,
        _ => 0.001,
    };
    let bump = |x: f64, width: f64| (-(x / width).powi(2)).exp();
    let front = smooth_step(-0.2, 0.7, n[2]);
    let belly = 0.014 * bump(p[1] - 0.055, 0.10) * bump(p[0], 0.15) * front;
    let hips = 0.004 * bump(p[1] + 0.07, 0.07) * smooth_step(-0.1, 0.6, n[0] * p[0].signum());
    [0.0, girth, 0.0, hips, 0.0, 0.0, 0.0, belly]
}

/// `[V × 3 × K]` row-major.
pub(super) fn vertex_directions(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    skin_weights: &SparseSkinWeights,
) -> Vec<f32> {
    let normals = vertex_normals(positions, faces);
    let mut directions = Vec::with_capacity(positions.len() * 3 * SHAPE_COUNT);
    for (v, (p, n)) in positions.iter().zip(&normals).enumerate() {
        let mut along = [0.0; SHAPE_COUNT];
        for (j, w) in skin_weights.of_vertex(v) {
            let part = thickness(*p, *n, j);
            (0..SHAPE_COUNT).for_each(|k| along[k] += f64::from(w) * part[k]);
        }
        let moved = space(*p);
        for axis in 0..3 {
            directions.extend((0..SHAPE_COUNT).map(|k| (moved[k][axis] + along[k] * n[axis]) as f32));
        }
    }
    directions
}

/// `[J × 3 × K]` row-major: the joints follow the displacement of space.
pub(super) fn joint_directions() -> Vec<f64> {
    let mut directions = Vec::with_capacity(anatomy::REST_JOINTS.len() * 3 * SHAPE_COUNT);
    for joint in anatomy::REST_JOINTS {
        let moved = space(joint);
        for axis in 0..3 {
            directions.extend((0..SHAPE_COUNT).map(|k| moved[k][axis]));
        }
    }
    directions
}
