//! Any mesh of a person, in any unit, with any axis up, facing anywhere, its arms level or lowered, its legs closed or
//! spread, registered to the target's model: unit and stance, then a similarity, the angles of the limbs, and the shape.

use super::gaps::apart_mm;
use super::icp::{Similarity, registered};
use super::stance::{PERSON_HEIGHTS, Stance, stances};
use crate::asset::Body;
use crate::asset::rotation;
use crate::fit::cloth::spread_over;
use crate::fit::limb_pose::LimbPose;
use crate::fit::placement::Placement;
use crate::fit::settings::FitSettings;
use crate::mesh::{bounds, gaps_to};
use clothcombo_physics::vec3::{scale, sub};
use clothcombo_physics::{Surface, TriMesh};

/// Points that are registered.
const REGISTERED_POINTS: usize = 2500;
/// Rounds in which stances are compared, and then the best one is refined.
const ICP_ROUNDS: [usize; 2] = [8, 24];
/// Steps by which the angles of arms and legs are refined (degrees).
const LIMB_STEPS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Most steps of one length.
const MOST_LIMB_STEPS: usize = 4;
/// How far arms hang down and legs are spread (degrees).
const LIMB_RANGES: [[f64; 2]; 2] = [[0.0, 85.0], [-5.0, 30.0]];
/// Rounds in which the shape is found.
const CLOSEST_SHAPE_ROUNDS: usize = 8;
/// Surfaces farther apart than this (median, mm) are no two bodies in one pose.
const FARTHEST_MM: f64 = 25.0;
/// Mean distance (m) from which on no refinement helps, and no stance is better than another.
const HOPELESS: f64 = 0.08;
/// A stance whose distance is within this factor of the best one's is a near-tie.
const NEAR_TIE_FACTOR: f64 = 1.15;

/// A stance after registration.
#[derive(Clone)]
struct Trial {
    stance: Stance,
    /// The target's model in the shape and pose that looks most like the mesh.
    model: LimbPose,
    motion: Similarity,
    /// Mean distance in both directions, of the nearer nine tenths (m).
    distance: f64,
}

/// A mesh of a person, registered.
pub(super) struct RegisteredMesh {
    /// Its unit and axes.
    pub placement: Placement,
    /// From there to the model.
    pub motion: Similarity,
    /// The target's model in the mesh's shape and pose.
    pub model: LimbPose,
    /// Median distance of the surfaces (mm).
    pub alignment_mm: f64,
}

/// Registers a mesh.
///
/// # Errors
/// What is no person, which way it stands where that is not plain, or how far it stays away.
pub(super) fn register(
    mesh: &TriMesh,
    body: &Body,
    settings: &FitSettings,
) -> Result<RegisteredMesh, String> {
    let points = spread_over(mesh.positions(), mesh.faces(), REGISTERED_POINTS);
    let registration = Registration { mesh, points, surface: Surface::from_mesh(mesh), body };
    let stances = stances(&registration.points, body, settings).into_iter();
    let mut trials =
        stances.map(|stance| registration.tried(stance)).collect::<Result<Vec<Trial>, String>>()?;
    if trials.is_empty() {
        let [low, high] = bounds(mesh.positions());
        let [x, y, z] = sub(high, low);
        return Err(format!(
            "it is no standing person: {x:.3} × {y:.3} × {z:.3} in its unit is in no unit {} to {} m high and wider than deep; the \
             body file is a whole body, standing; --unit and --up say more",
            PERSON_HEIGHTS[0], PERSON_HEIGHTS[1]
        ));
    }
    trials.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    let unlike = |millimetres: f64| {
        format!(
            "it does not look like body '{}': after the alignment the surfaces are {millimetres:.0} mm apart (at most {FARTHEST_MM} mm). \
             It must be a whole person, standing, legs straight, arms level or lowered; --unit, --up and --turn say how it stands",
            body.name
        )
    };
    if trials[0].distance > HOPELESS {
        return Err(unlike(1e3 * trials[0].distance));
    }
    let best = registration.refined(chosen(trials)?, &LIMB_STEPS)?;
    // People differ in size by their shape: only what no shape explains is scaled.
    let Similarity { scale: factor, rotation, translation } = best.motion;
    let in_unit = Similarity { scale: 1.0, rotation, translation: scale(translation, 1.0 / factor) };
    let unscaled = registration.reshaped(Trial { motion: in_unit, ..best.clone() })?;
    let unscaled = registration.refined(unscaled, &LIMB_STEPS[2..])?;
    let scaled = registration.reshaped(best)?;
    let mut best = if unscaled.distance < NEAR_TIE_FACTOR * scaled.distance { unscaled } else { scaled };
    if !best.model.shape.is_empty() {
        best = registration.reshaped(best)?;
    }
    let Trial { stance, model, motion, .. } = registration.refined(best, &LIMB_STEPS[2..])?;
    let placed = stance.placement.apply(&registration.points);
    let moved: Vec<[f64; 3]> = placed.iter().map(|p| motion.apply(*p)).collect();
    let alignment_mm = apart_mm(&moved, &model.surface(body));
    if alignment_mm.is_nan() || alignment_mm > FARTHEST_MM {
        return Err(unlike(alignment_mm));
    }
    let [arm_angle_degrees, leg_angle_degrees] = model.angles;
    let placement = Placement { arm_angle_degrees, leg_angle_degrees, ..stance.placement };
    Ok(RegisteredMesh { placement, motion, model, alignment_mm })
}

/// The best of sorted trials; where the distances nearly tie, the feet decide.
fn chosen(mut trials: Vec<Trial>) -> Result<Trial, String> {
    let flags = |trial: &Trial| {
        let Placement { up, turn_degrees, .. } = trial.stance.placement;
        format!("--up {up} --turn {turn_degrees}")
    };
    let limit = NEAR_TIE_FACTOR * trials[0].distance;
    let near = trials.iter().take_while(|trial| trial.distance <= limit).count();
    let fronts: Vec<usize> = (0..near).filter(|i| trials[*i].stance.says_front()).collect();
    let index = match (near, &fronts[..]) {
        (1, _) => 0,
        (_, [only]) => *only,
        _ => {
            let texts = trials[..near].iter().map(|t| format!("{} ({:.1} mm)", flags(t), 1e3 * t.distance));
            return Err(format!(
                "which way it stands is not plain: {} fit alike; say which",
                texts.collect::<Vec<_>>().join(", ")
            ));
        }
    };
    let best = trials.swap_remove(index);
    // With a hint there is but one stance.
    if best.stance.says_back() && !trials.is_empty() {
        return Err(format!(
            "which way it faces is not plain: with {} it fits best, but its feet point backwards; say which",
            flags(&best)
        ));
    }
    Ok(best)
}

/// A mesh in the unit and axes of its file, and the body whose model is registered to it.
struct Registration<'a> {
    mesh: &'a TriMesh,
    points: Vec<[f64; 3]>,
    surface: Surface<f64>,
    body: &'a Body,
}

impl Registration<'_> {
    fn tried(&self, stance: Stance) -> Result<Trial, String> {
        let model = LimbPose::new(self.body, &[], [stance.arms, 0.0])?;
        let [low, high] = bounds(&model.positions);
        let factor = (high[1] - low[1]) / stance.height;
        let start = Similarity::scaling(factor, sub([0.0, low[1], 0.0], scale(stance.foot, factor)));
        Ok(self.trial(stance, model, start, ICP_ROUNDS[0]))
    }

    fn trial(&self, stance: Stance, model: LimbPose, start: Similarity, rounds: usize) -> Trial {
        let placed = stance.placement.apply(&self.points);
        let surface = model.surface(self.body);
        // What the scale is decided by is left to the shape once there is one.
        let motion = registered(&placed, &surface, start, rounds, !model.shape.is_empty());
        let distance = self.distance(&placed, &stance.placement, &motion, &surface);
        Trial { stance, model, motion, distance }
    }

    /// Tries other angles of arms and legs, in ever smaller steps.
    fn refined(&self, mut best: Trial, steps: &[f64]) -> Result<Trial, String> {
        let at = |best: &Trial, angles: [f64; 2], rounds: usize| {
            let model = LimbPose::new(self.body, &best.model.shape, angles)?;
            Ok::<_, String>(self.trial(best.stance.clone(), model, best.motion, rounds))
        };
        for step in steps {
            for (limb, [least, most]) in LIMB_RANGES.into_iter().enumerate() {
                for sign in [-1.0, 1.0] {
                    for _ in 0..MOST_LIMB_STEPS {
                        let mut angles = best.model.angles;
                        angles[limb] = (angles[limb] + sign * step).clamp(least, most);
                        let trial = at(&best, angles, ICP_ROUNDS[0])?;
                        if trial.distance >= best.distance {
                            break;
                        }
                        best = trial;
                    }
                }
            }
        }
        let last = at(&best, best.model.angles, ICP_ROUNDS[1])?;
        Ok(if last.distance <= best.distance { last } else { best })
    }

    /// With the shape that lies closest, and the rigid motion that goes with it.
    fn reshaped(&self, trial: Trial) -> Result<Trial, String> {
        let Trial { stance, mut model, mut motion, .. } = trial;
        let placed = Surface::new(stance.placement.apply(self.mesh.positions()), self.mesh.faces().into());
        for _ in 0..CLOSEST_SHAPE_ROUNDS {
            let Some((shape, moved)) = model.closer_shape(self.body, &placed, &motion)? else { break };
            (model, motion) = (LimbPose::new(self.body, &shape, model.angles)?, moved);
        }
        Ok(self.trial(stance, model, motion, 0))
    }

    /// Mean distance from the points to the target and back (m), of the nearer nine tenths: medians do not see the arms.
    fn distance(
        &self,
        placed: &[[f64; 3]],
        placement: &Placement,
        motion: &Similarity,
        target: &Surface<f64>,
    ) -> f64 {
        let moved: Vec<[f64; 3]> = placed.iter().map(|p| motion.apply(*p)).collect();
        let step = (target.positions.len() / REGISTERED_POINTS).max(1);
        let back = rotation::transpose(&placement.turn());
        let metres = placement.unit.metres();
        let in_file: Vec<[f64; 3]> = (target.positions.iter().step_by(step))
            .map(|q| rotation::apply(&back, scale(motion.inverse(*q), 1.0 / metres)))
            .collect();
        let there = mean_of_best(gaps_to(&moved, target), 1.0);
        0.5 * (there + mean_of_best(gaps_to(&in_file, &self.surface), metres * motion.scale))
    }
}

/// Mean of the smaller nine tenths of the distances, in a unit of this `factor`.
fn mean_of_best(gaps: Vec<f64>, factor: f64) -> f64 {
    let mut distances: Vec<f64> = gaps.into_iter().map(|gap| factor * gap.abs()).collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate((9 * distances.len()).div_ceil(10));
    distances.iter().sum::<f64>() / distances.len().max(1) as f64
}
