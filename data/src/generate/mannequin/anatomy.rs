//! The solid the mannequin is the surface of: tapered segments, ellipsoids and a lofted torso, smoothly united.
//!
//! Measures follow a neutral adult of 1.70 m (segment lengths near those of the SMPL mean body); pelvis joint at the origin,
//! soles at y = −0.93.

use super::super::field::smooth_min;
use clothcombo_physics::vec3::{add, dot, norm, scale, sub};

/// Rest joints in SMPL order (m).
pub(super) const REST_JOINTS: [[f64; 3]; 22] = [
    [0.0, 0.0, 0.0],
    [0.082, -0.085, -0.005],
    [-0.082, -0.085, -0.005],
    [0.0, 0.105, -0.018],
    [0.108, -0.470, 0.0],
    [-0.108, -0.470, 0.0],
    [0.0, 0.225, -0.012],
    [0.120, -0.858, -0.022],
    [-0.120, -0.858, -0.022],
    [0.0, 0.300, -0.010],
    [0.132, -0.905, 0.100],
    [-0.132, -0.905, 0.100],
    [0.0, 0.495, -0.030],
    [0.075, 0.425, -0.022],
    [-0.075, 0.425, -0.022],
    [0.0, 0.575, -0.005],
    [0.172, 0.437, -0.028],
    [-0.172, 0.437, -0.028],
    [0.432, 0.434, -0.034],
    [-0.432, 0.434, -0.034],
    [0.680, 0.438, -0.028],
    [-0.680, 0.438, -0.028],
];

/// Height of the soles.
pub(super) const FLOOR: f64 = -0.930;

/// Torso sections: height, half width, half depth, centre in z.
const TORSO: [[f64; 4]; 12] = [
    [-0.150, 0.095, 0.080, -0.015],
    [-0.110, 0.150, 0.106, -0.014],
    [-0.060, 0.168, 0.112, -0.014],
    [0.000, 0.163, 0.108, -0.010],
    [0.070, 0.144, 0.099, -0.002],
    [0.140, 0.131, 0.093, 0.002],
    [0.210, 0.138, 0.099, 0.002],
    [0.290, 0.152, 0.109, 0.000],
    [0.360, 0.160, 0.108, -0.008],
    [0.420, 0.150, 0.092, -0.018],
    [0.465, 0.110, 0.070, -0.026],
    [0.500, 0.062, 0.056, -0.028],
];

/// Distance-like value to a cone with spherical ends: exact outside (after Quilez, "Rounded cone SDF").
fn rounded_cone(p: [f64; 3], a: [f64; 3], b: [f64; 3], ra: f64, rb: f64) -> f64 {
    let axis = sub(b, a);
    let length_squared = dot(axis, axis);
    let difference = ra - rb;
    let a2 = length_squared - difference * difference;
    let inverse = 1.0 / length_squared;
    let pa = sub(p, a);
    let y = dot(pa, axis);
    let z = y - length_squared;
    let across = sub(scale(pa, length_squared), scale(axis, y));
    let x2 = dot(across, across);
    let y2 = y * y * length_squared;
    let z2 = z * z * length_squared;
    let k = difference.signum() * difference * difference * x2;
    if z.signum() * a2 * z2 > k {
        return (x2 + z2).sqrt() * inverse - rb;
    }
    if y.signum() * a2 * y2 < k {
        return (x2 + y2).sqrt() * inverse - ra;
    }
    ((x2 * a2 * inverse).sqrt() + y * difference) * inverse - ra
}

fn ellipsoid(p: [f64; 3], centre: [f64; 3], radii: [f64; 3]) -> f64 {
    let q = sub(p, centre);
    let k0 = norm([q[0] / radii[0], q[1] / radii[1], q[2] / radii[2]]);
    let k1 = norm([q[0] / radii[0].powi(2), q[1] / radii[1].powi(2), q[2] / radii[2].powi(2)]);
    if k1 < 1e-12 { -radii[0].min(radii[1]).min(radii[2]) } else { k0 * (k0 - 1.0) / k1 }
}

/// Catmull–Rom interpolation of the torso sections.
fn torso_section(y: f64) -> [f64; 3] {
    let last = TORSO.len() - 1;
    let upper = TORSO.partition_point(|s| s[0] < y).clamp(1, last);
    let (s0, s1) = (&TORSO[upper - 1], &TORSO[upper]);
    let (before, after) = (&TORSO[upper.saturating_sub(2)], &TORSO[(upper + 1).min(last)]);
    let span = s1[0] - s0[0];
    let t = ((y - s0[0]) / span).clamp(0.0, 1.0);
    std::array::from_fn(|i| {
        let c = i + 1;
        let m0 = (s1[c] - before[c]) / (s1[0] - before[0]) * span;
        let m1 = (after[c] - s0[c]) / (after[0] - s0[0]) * span;
        let (t2, t3) = (t * t, t * t * t);
        (2.0 * t3 - 3.0 * t2 + 1.0) * s0[c]
            + (t3 - 2.0 * t2 + t) * m0
            + (3.0 * t2 - 2.0 * t3) * s1[c]
            + (t3 - t2) * m1
    })
}

fn torso(p: [f64; 3]) -> f64 {
    // Far from the trunk a rough value does: nothing there can meet its surface.
    if p[0].abs() > 0.30 || p[1] < -0.35 || p[1] > 0.68 {
        return (p[0].abs() - 0.18).max(-0.15 - p[1]).max(p[1] - 0.50);
    }
    let [width, depth, centre] = torso_section(p[1]);
    let (x, z) = (p[0] / width, (p[2] - centre) / depth);
    // Exponent 2.3: slightly boxier than an ellipse, as a rib cage is.
    let rounded = (x.abs().powf(2.3) + z.abs().powf(2.3)).powf(1.0 / 2.3);
    let side = (rounded - 1.0) * width.min(depth);
    let (low, high) = (TORSO[0][0], TORSO[TORSO.len() - 1][0]);
    let beyond = (low - p[1]).max(p[1] - high);
    -smooth_min(-side, -beyond, 0.03)
}

/// One side's leg with the foot; `p` already mirrored to x ≥ 0.
fn leg(p: [f64; 3]) -> f64 {
    let k = 0.008;
    let mut f = rounded_cone(p, [0.099, -0.130, -0.012], [0.106, -0.300, -0.004], 0.083, 0.069);
    f = smooth_min(f, rounded_cone(p, [0.106, -0.300, -0.004], [0.109, -0.465, 0.0], 0.069, 0.051), k);
    f = smooth_min(f, rounded_cone(p, [0.109, -0.465, 0.002], [0.113, -0.580, -0.018], 0.049, 0.052), k);
    f = smooth_min(f, rounded_cone(p, [0.113, -0.580, -0.018], [0.119, -0.840, -0.022], 0.052, 0.034), k);
    // Foot: heel, instep and toes, flattened at the sole.
    let mut foot = rounded_cone(p, [0.119, -0.885, -0.035], [0.128, -0.885, 0.060], 0.036, 0.038);
    foot = smooth_min(foot, ellipsoid(p, [0.133, -0.905, 0.095], [0.043, 0.028, 0.075]), 0.03);
    foot = smooth_min(
        foot,
        rounded_cone(p, [0.119, -0.850, -0.020], [0.126, -0.885, 0.040], 0.034, 0.034),
        0.03,
    );
    f = smooth_min(f, foot, 0.02);
    -smooth_min(-f, p[1] - FLOOR, 0.012)
}

/// One side's arm with a mitten hand; `p` mirrored to x ≥ 0.
fn arm(p: [f64; 3]) -> f64 {
    let k = 0.008;
    let mut f = rounded_cone(p, [0.165, 0.434, -0.028], [0.270, 0.434, -0.030], 0.056, 0.047);
    f = smooth_min(f, rounded_cone(p, [0.270, 0.434, -0.030], [0.430, 0.434, -0.034], 0.047, 0.037), k);
    f = smooth_min(f, rounded_cone(p, [0.430, 0.434, -0.034], [0.510, 0.436, -0.030], 0.037, 0.0385), k);
    f = smooth_min(f, rounded_cone(p, [0.510, 0.436, -0.030], [0.675, 0.438, -0.028], 0.0385, 0.026), k);
    let mut hand = ellipsoid(p, [0.740, 0.438, -0.026], [0.062, 0.019, 0.041]);
    hand = smooth_min(hand, ellipsoid(p, [0.800, 0.437, -0.024], [0.066, 0.016, 0.035]), 0.02);
    hand =
        smooth_min(hand, rounded_cone(p, [0.715, 0.437, 0.000], [0.765, 0.434, 0.035], 0.015, 0.011), 0.015);
    smooth_min(f, hand, 0.02)
}

fn head(p: [f64; 3]) -> f64 {
    let skull = ellipsoid(p, [0.0, 0.680, -0.006], [0.075, 0.096, 0.094]);
    let jaw = ellipsoid(p, [0.0, 0.612, 0.034], [0.052, 0.062, 0.056]);
    let nose = rounded_cone(p, [0.0, 0.665, 0.086], [0.0, 0.635, 0.100], 0.007, 0.011);
    let face = smooth_min(skull, jaw, 0.05);
    smooth_min(face, nose, 0.025)
}

/// Field of the whole mannequin (m), negative inside. The surface is smooth; the value is a distance only near it.
pub(super) fn field(p: [f64; 3]) -> f64 {
    let q = [p[0].abs(), p[1], p[2]];
    let mut f = torso(p);
    if p[1] > 0.15 {
        // Chest, shoulder girdle, neck and head.
        f = smooth_min(f, ellipsoid(q, [0.068, 0.315, 0.068], [0.066, 0.062, 0.044]), 0.045);
        f = smooth_min(
            f,
            rounded_cone(q, [0.030, 0.440, -0.030], [0.165, 0.436, -0.028], 0.060, 0.055),
            0.045,
        );
        f = smooth_min(
            f,
            rounded_cone(q, [0.010, 0.500, -0.034], [0.140, 0.452, -0.032], 0.040, 0.036),
            0.05,
        );
        f = smooth_min(f, rounded_cone(p, [0.0, 0.470, -0.034], [0.0, 0.590, -0.006], 0.058, 0.051), 0.035);
        // The bounds only save time: beyond them the part is farther away than any blend reaches.
        if p[1] > 0.42 {
            f = smooth_min(f, head(p), 0.025);
        }
        if (p[1] - 0.436).abs() < 0.18 {
            f = smooth_min(f, arm(q), 0.035);
        }
    }
    if p[1] < 0.12 {
        f = smooth_min(f, ellipsoid(q, [0.072, -0.075, -0.066], [0.078, 0.082, 0.062]), 0.05);
        // The legs stay apart: they are united with the torso, not with each other.
        if q[0] < 0.35 {
            f = smooth_min(f, leg(q), 0.04);
        }
    }
    f
}

/// Where the bones end that have no further joint: (joint, tip).
pub(super) fn tips() -> [(usize, [f64; 3]); 5] {
    let beyond = |joint: usize, offset: [f64; 3]| (joint, add(REST_JOINTS[joint], offset));
    [
        beyond(15, [0.0, 0.170, 0.0]),
        beyond(20, [0.150, 0.0, 0.0]),
        beyond(21, [-0.150, 0.0, 0.0]),
        beyond(10, [0.004, 0.0, 0.060]),
        beyond(11, [-0.004, 0.0, 0.060]),
    ]
}
