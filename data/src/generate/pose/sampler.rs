//! Random poses that look like people: a few activities, each a few correlated factors, with noise on every joint.

use super::figure::{LEFT_SIDE, PoseFigure};
use super::limits::limited;
use crate::asset::Pose;
use rand::{Rng, RngExt};
use std::f64::consts::PI;

/// Samples poses within [`super::JOINT_LIMITS`]: standing, walking, sitting, reaching, arms raised and bending.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSampler;

/// Standard deviation of the independent noise per joint component (degrees); knees and toes get half of it.
const JOINT_NOISE: f64 = 4.0;

fn normal<R: Rng + ?Sized>(rng: &mut R, mean: f64, deviation: f64) -> f64 {
    // Box–Muller; two uniform numbers per value keep the stream simple and reproducible.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    mean + deviation * radius * (2.0 * PI * rng.random::<f64>()).cos()
}

fn between<R: Rng + ?Sized>(rng: &mut R, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

impl PoseSampler {
    /// One pose of the 22 body joints, within the joint limits.
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R) -> Pose {
        let mut figure = standing(rng);
        let activity = rng.random::<f64>();
        if activity < 0.30 {
            walk(&mut figure, rng);
        } else if activity < 0.45 {
            sit(&mut figure, rng);
        } else if activity < 0.55 {
            bend(&mut figure, rng);
        }
        let arms = rng.random::<f64>();
        if arms < 0.15 {
            raise_arms(&mut figure, rng);
        } else if arms < 0.40 {
            reach(&mut figure, rng);
        } else if arms < 0.50 {
            hands_together(&mut figure, rng);
        }
        let mut pose = figure.pose();
        for (joint, rotation) in pose.rotations.iter_mut().enumerate().skip(1) {
            let deviation =
                JOINT_NOISE.to_radians() * if matches!(joint, 4 | 5 | 10 | 11) { 0.5 } else { 1.0 };
            for component in rotation {
                *component += normal(rng, 0.0, deviation).clamp(-2.5 * deviation, 2.5 * deviation);
            }
        }
        limited(pose)
    }
}

/// At ease: arms mostly down, weight on either leg.
fn standing<R: Rng + ?Sized>(rng: &mut R) -> PoseFigure {
    let mut figure = PoseFigure::default();
    let lowered = normal(rng, 66.0, 9.0);
    let twist = normal(rng, 0.0, 7.0);
    figure.trunk = [normal(rng, 3.0, 6.0), normal(rng, 0.0, 11.0), normal(rng, 0.0, 6.0)];
    figure.head = [normal(rng, 0.0, 9.0), normal(rng, -0.5 * figure.trunk[1], 16.0), normal(rng, 0.0, 6.0)];
    figure.pelvis = [normal(rng, 0.0, 3.0), 0.0, normal(rng, 0.0, 2.5)];
    let stance = normal(rng, 2.0, 4.0);
    for side in &mut figure.sides {
        side.arm_lowered = normal(rng, lowered, 6.0);
        side.arm_forward = normal(rng, 4.0, 10.0);
        side.arm_twist = normal(rng, twist, 12.0);
        side.elbow = between(rng, 2.0, 40.0);
        side.hip_abduction = stance + normal(rng, 0.0, 2.0);
        side.hip_turn = normal(rng, 4.0, 7.0);
        side.knee = normal(rng, 6.0, 5.0).abs();
        side.hip_flexion = 0.5 * side.knee + normal(rng, 0.0, 4.0);
        side.shrug = normal(rng, 0.0, 3.0);
    }
    figure
}

/// One moment of a gait: legs in opposite phase, arms against legs, the trunk turning with the arms.
fn walk<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    let phase = between(rng, 0.0, 2.0 * PI);
    let stride = between(rng, 12.0, 38.0);
    let speed = (stride - 12.0) / 26.0;
    for (i, side) in figure.sides.iter_mut().enumerate() {
        let own = phase + if i == LEFT_SIDE { 0.0 } else { PI };
        side.hip_flexion = stride * own.sin() + 0.25 * stride;
        // The knee bends most while the leg swings forward.
        let swing = (own + 0.9).cos().max(0.0);
        side.knee = 6.0 + (35.0 + 35.0 * speed) * swing * swing;
        side.toes_down = 14.0 * (own + PI).sin().max(0.0) - 5.0;
        side.arm_forward = -0.8 * stride * own.sin() + 6.0;
        side.elbow = 12.0 + 45.0 * speed + 12.0 * (own + PI).sin();
        side.hip_abduction = normal(rng, 0.0, 2.0);
        side.hip_turn = normal(rng, 2.0, 3.0);
    }
    figure.trunk[0] += 6.0 * speed;
    figure.trunk[1] = 0.25 * stride * phase.sin() + normal(rng, 0.0, 3.0);
}

/// On a seat or crouching, the knees together or apart.
fn sit<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    let depth = between(rng, 45.0, 95.0);
    let apart = between(rng, 2.0, 20.0);
    for side in &mut figure.sides {
        side.hip_flexion = depth + normal(rng, 0.0, 5.0);
        side.knee = depth + normal(rng, 5.0, 8.0);
        side.hip_abduction = apart + normal(rng, 0.0, 2.0);
        side.hip_turn = 0.4 * apart;
        side.toes_down = normal(rng, 0.0, 6.0);
        side.arm_forward = between(rng, 5.0, 45.0);
        side.elbow = between(rng, 10.0, 80.0);
    }
    figure.trunk[0] = normal(rng, 14.0, 10.0);
    figure.pelvis[0] = normal(rng, 0.0, 6.0);
}

/// Leaning forward or to the side.
fn bend<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    figure.trunk = [between(rng, -15.0, 60.0), normal(rng, 0.0, 18.0), normal(rng, 0.0, 14.0)];
    let hinge = between(rng, 0.0, 30.0);
    figure.pelvis[0] = hinge;
    for side in &mut figure.sides {
        side.hip_flexion += hinge;
        side.knee += between(rng, 0.0, 20.0);
        side.arm_forward += 0.5 * figure.trunk[0].max(0.0);
    }
}

/// One or both arms sideways or up.
fn raise_arms<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    let both = rng.random::<f64>() < 0.6;
    let lowered = between(rng, -70.0, 30.0);
    let only = usize::from(rng.random::<f64>() < 0.5);
    for (i, side) in figure.sides.iter_mut().enumerate() {
        if both || i == only {
            side.arm_lowered = lowered + normal(rng, 0.0, 6.0);
            side.arm_forward = between(rng, -10.0, 30.0);
            side.shrug = (0.25 * (30.0 - lowered)).clamp(0.0, 20.0);
            side.elbow = between(rng, 0.0, 70.0);
        }
    }
}

/// One or both hands forward.
fn reach<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    let both = rng.random::<f64>() < 0.5;
    let only = usize::from(rng.random::<f64>() < 0.5);
    let forward = between(rng, 25.0, 85.0);
    for (i, side) in figure.sides.iter_mut().enumerate() {
        if both || i == only {
            side.arm_forward = forward + normal(rng, 0.0, 7.0);
            side.elbow = between(rng, 5.0, 100.0);
            side.arm_twist = normal(rng, 0.0, 15.0);
        }
    }
}

/// Hands in front of the belly or chest.
fn hands_together<R: Rng + ?Sized>(figure: &mut PoseFigure, rng: &mut R) {
    let elbow = between(rng, 50.0, 110.0);
    let forward = between(rng, 15.0, 45.0);
    for side in &mut figure.sides {
        side.arm_forward = forward + normal(rng, 0.0, 4.0);
        side.elbow = elbow + normal(rng, 0.0, 6.0);
        side.arm_twist = between(rng, -10.0, 25.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::limits::{JOINT_LIMITS, is_within_limits};
    use super::*;
    use crate::generate::mannequin;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn poses_are_within_limits_deterministic_and_varied() {
        let sample = |seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            (0..500).map(|_| PoseSampler.sample(&mut rng)).collect::<Vec<_>>()
        };
        let poses = sample(7);
        assert_eq!(poses, sample(7));
        assert_ne!(poses, sample(8));
        assert!(poses.iter().all(|p| p.rotations.len() == 22 && is_within_limits(p)));
        // Every major joint uses a good part of its range.
        for joint in [1, 2, 4, 5, 16, 17, 18, 19] {
            let used = (0..3)
                .map(|axis| {
                    let values = poses.iter().map(|p| p.rotations[joint][axis].to_degrees());
                    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
                    (high - low) / (JOINT_LIMITS[joint].high[axis] - JOINT_LIMITS[joint].low[axis])
                })
                .fold(0.0, f64::max);
            assert!(used > 0.7, "joint {joint} uses {used} of its range");
        }
    }

    #[test]
    fn hands_hang_below_the_shoulders_and_feet_stay_below_the_hips() {
        let body = mannequin();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let count = 300;
        let mut low_hands = 0;
        for _ in 0..count {
            let posed = body.posed(&[], &PoseSampler.sample(&mut rng)).unwrap();
            let joints = posed.joints;
            low_hands += [(20, 16), (21, 17)].iter().filter(|(w, s)| joints[*w][1] < joints[*s][1]).count();
            assert!(joints[7][1] < joints[1][1] + 0.1 && joints[8][1] < joints[2][1] + 0.1);
        }
        assert!(low_hands > count * 2 * 7 / 10, "{low_hands} of {}", 2 * count);
    }
}
