//! Climbs from a placement to the best one near it.

use super::judge::{Candidate, Judge};

/// Lowered arms of a garment hang between these angles (degrees): nearer to the horizontal they are level, and cloth hangs from
/// shoulders, not straight down.
const LOWERED_ARMS: [f64; 2] = [3.0, 85.0];
/// How far a leg is turned outwards in a garment's rest pose (degrees), if it is.
const LEGS_APART_RANGE: [f64; 2] = [0.5, 25.0];

/// How steps shrink (m), and what counts on the way.
pub(super) struct ClimbSteps {
    pub from: f64,
    pub to: f64,
    pub is_sharp: bool,
    pub is_fine: bool,
    pub moves: Moves,
}

/// What may change of a placement.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Moves {
    All,
    /// All but the height.
    Level,
    /// Arms and legs only.
    Limbs,
}

/// Slid along the three axes, and arms and legs turned, as long as that helps; what settings fix stays.
pub(super) fn climbed(judge: &Judge, start: &Candidate, steps: &ClimbSteps) -> Candidate {
    let turned = judge.turned(&start.placement, start.rim, steps.is_fine);
    let mut best = judge.scored(*start, &turned, steps.is_sharp);
    let slides = judge.settings.offset.is_none() && steps.moves != Moves::Limbs;
    let raises = best.placement.arm_angle_degrees != 0.0;
    let spreads = best.placement.leg_angle_degrees != 0.0 && judge.settings.legs_degrees.is_none();
    let mut step = steps.from;
    while step > steps.to {
        let mut is_better = false;
        for axis in 0..5 {
            for sign in [-1.0, 1.0] {
                let mut candidate = best;
                let trial = &mut candidate.placement;
                match axis {
                    0..3 if slides && (axis != 0 || steps.moves == Moves::All) => {
                        trial.translation[[1, 2, 0][axis]] += sign * step
                    }
                    3 if raises => {
                        // A sleeve is half a metre long.
                        let degrees = trial.arm_angle_degrees + sign * (2.0 * step).to_degrees();
                        trial.arm_angle_degrees = degrees.clamp(LOWERED_ARMS[0], LOWERED_ARMS[1]);
                    }
                    4 if spreads => {
                        // A leg is twice as long.
                        let degrees = trial.leg_angle_degrees + sign * step.to_degrees();
                        trial.leg_angle_degrees = degrees.clamp(LEGS_APART_RANGE[0], LEGS_APART_RANGE[1]);
                    }
                    _ => continue,
                }
                let trial = judge.scored(candidate, &turned, steps.is_sharp);
                if trial.score > best.score {
                    (best, is_better) = (trial, true);
                }
            }
        }
        if !is_better {
            step *= 0.5;
        }
    }
    best
}
