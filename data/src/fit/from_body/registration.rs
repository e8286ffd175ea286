//! Any mesh of a person, in any unit, with any axis up, facing anywhere, its arms level or lowered, its legs closed or
//! spread, registered to the target's model: unit and stance, then a similarity, the angles of the limbs, and the shape.

use super::icp::{Similarity, registered};
use super::model::Model;
use super::registered::Registered;
use super::same_model::SameModel;
use super::source::SourceMesh;
use super::stance::{HEIGHTS, Stance, stances};
use super::{gaps_to, median};
use crate::asset::Body;
use crate::asset::rotation;
use crate::fit::placement::Placement;
use crate::fit::samples::Samples;
use crate::fit::settings::FitSettings;
use crate::mesh::bounds;
use clothcombo_physics::vec3::{scale, sub};
use clothcombo_physics::{Surface, TriMesh};

/// Points that are registered.
const POINTS: usize = 2500;
/// Rounds in which stances are compared, and then the best one is refined.
const ROUNDS: [usize; 2] = [8, 24];
/// Steps by which the angles of arms and legs are refined (degrees).
const STEPS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Most steps of one length.
const MOST_STEPS: usize = 4;
/// How far arms hang down and legs are spread (degrees).
const RANGES: [[f64; 2]; 2] = [[0.0, 85.0], [-5.0, 30.0]];
/// Rounds in which the shape is found.
const SHAPE_ROUNDS: usize = 8;
/// Surfaces farther apart than this (median, mm) are no two bodies in one pose.
const FARTHEST_MM: f64 = 25.0;
/// Mean distance (m) from which on no refinement helps, and no stance is better than another.
const HOPELESS: f64 = 0.08;
/// A stance whose distance is within this factor of the best one's is a near-tie.
const NEAR_TIE: f64 = 1.15;

/// A stance after registration.
#[derive(Clone)]
struct Trial {
    stance: Stance,
    model: Model,
    motion: Similarity,
    /// Mean distance in both directions, of the nearer nine tenths (m).
    distance: f64,
}

impl Trial {
    /// With its scale in the unit alone, about the origin, where the pelvis is.
    fn unscaled(&self) -> Self {
        let motion = &self.motion;
        let translation = scale(motion.translation, 1.0 / motion.scale);
        Self { motion: Similarity { scale: 1.0, translation, ..*motion }, ..self.clone() }
    }
}

/// Registers a mesh: where it is put before, and the rest.
///
/// # Errors
/// What is no person, which way it stands where that is not plain, or how far it stays away.
pub(super) fn register(
    mesh: &SourceMesh,
    body: &Body,
    settings: &FitSettings,
) -> Result<(Placement, Registered), String> {
    let surface = &mesh.surface;
    let source = Source {
        points: Samples::new(surface.positions(), surface.faces(), POINTS).0,
        surface: Surface::from_mesh(surface),
    };
    let stances = stances(&source.points, body, settings).into_iter();
    let mut trials =
        stances.map(|stance| source.tried(stance, body)).collect::<Result<Vec<Trial>, String>>()?;
    if trials.is_empty() {
        let [low, high] = bounds(surface.positions());
        let [x, y, z] = sub(high, low);
        return Err(format!(
            "it is no standing person: {x:.3} × {y:.3} × {z:.3} in its unit is in no unit {} to {} m high and wider than deep; the \
             body file is a whole body, standing; --unit and --up say more",
            HEIGHTS[0], HEIGHTS[1]
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
    let best = chosen(trials)?;
    let mut best = source.refined(best, body, &STEPS)?;
    // People differ in size by their shape: only what no shape explains is scaled.
    let unscaled = source.refined(source.reshaped(best.unscaled(), body, surface)?, body, &STEPS[2..])?;
    let scaled = source.reshaped(best.clone(), body, surface)?;
    best = if unscaled.distance < NEAR_TIE * scaled.distance { unscaled } else { scaled };
    if !best.model.shape.is_empty() {
        best = source.reshaped(best, body, surface)?;
    }
    best = source.refined(best, body, &STEPS[2..])?;
    let placement = best.stance.placement;
    let moved: Vec<[f64; 3]> =
        placement.apply(&source.points).iter().map(|p| best.motion.apply(*p)).collect();
    let mut distances: Vec<f64> =
        gaps_to(&moved, &best.model.surface(body)).into_iter().map(f64::abs).collect();
    let alignment_mm = 1e3 * median(&mut distances);
    if alignment_mm.is_nan() || alignment_mm > FARTHEST_MM {
        return Err(unlike(alignment_mm));
    }
    let shaped = body.shaped(&best.model.shape).map_err(|e| e.to_string())?.positions;
    let Trial { model, motion, .. } = best;
    let [arm_angle_degrees, leg_angle_degrees] = model.angles;
    let placement = Placement { arm_angle_degrees, leg_angle_degrees, ..placement };
    let registered = Registered {
        positions: placement.apply(surface.positions()),
        faces: surface.faces().into(),
        motion,
        shape: model.shape,
        model: SameModel::posed(shaped, model.positions, model.bones),
        alignment_mm,
    };
    Ok((placement, registered))
}

/// The best of sorted trials; where the distances nearly tie, the feet decide.
fn chosen(mut trials: Vec<Trial>) -> Result<Trial, String> {
    let limit = NEAR_TIE * trials[0].distance;
    let near = trials.iter().take_while(|trial| trial.distance <= limit).count();
    let index = match near {
        1 => 0,
        _ => {
            let fronts: Vec<usize> = (0..near).filter(|i| trials[*i].stance.says_front()).collect();
            match fronts[..] {
                [only] => only,
                _ => {
                    let texts = trials[..near].iter().map(|trial| {
                        let p = trial.stance.placement;
                        format!("--up {} --turn {} ({:.1} mm)", p.up, p.turn_degrees, 1e3 * trial.distance)
                    });
                    return Err(format!(
                        "which way it stands is not plain: {} fit alike; say which",
                        texts.collect::<Vec<_>>().join(", ")
                    ));
                }
            }
        }
    };
    let best = trials.swap_remove(index);
    // With a hint there is but one stance.
    if best.stance.says_back() && !trials.is_empty() {
        let p = best.stance.placement;
        return Err(format!(
            "which way it faces is not plain: with --up {} --turn {} it fits best, but its feet point backwards; say which",
            p.up, p.turn_degrees
        ));
    }
    Ok(best)
}

/// The mesh in the unit and axes of its file.
struct Source {
    points: Vec<[f64; 3]>,
    surface: Surface<f64>,
}

impl Source {
    fn tried(&self, stance: Stance, body: &Body) -> Result<Trial, String> {
        let model = Model::new(body, &[], [stance.arms, 0.0])?;
        let [low, high] = bounds(&model.positions);
        let factor = (high[1] - low[1]) / stance.height;
        let start = Similarity::scaling(factor, sub([0.0, low[1], 0.0], scale(stance.foot, factor)));
        Ok(self.trial(stance, model, start, ROUNDS[0], body))
    }

    fn trial(&self, stance: Stance, model: Model, start: Similarity, rounds: usize, body: &Body) -> Trial {
        let placed = stance.placement.apply(&self.points);
        let surface = model.surface(body);
        // What the scale is decided by is left to the shape once there is one.
        let motion = registered(&placed, &surface, start, rounds, !model.shape.is_empty());
        let distance = self.distance(&placed, &stance.placement, &motion, &surface);
        Trial { stance, model, motion, distance }
    }

    /// Tries other angles of arms and legs, in ever smaller steps.
    fn refined(&self, mut best: Trial, body: &Body, steps: &[f64]) -> Result<Trial, String> {
        let at = |best: &Trial, angles: [f64; 2], rounds: usize| {
            let model = Model::new(body, &best.model.shape, angles)?;
            Ok::<_, String>(self.trial(best.stance.clone(), model, best.motion, rounds, body))
        };
        for step in steps {
            for (limb, [least, most]) in RANGES.into_iter().enumerate() {
                for sign in [-1.0, 1.0] {
                    for _ in 0..MOST_STEPS {
                        let mut angles = best.model.angles;
                        angles[limb] = (angles[limb] + sign * step).clamp(least, most);
                        let trial = at(&best, angles, ROUNDS[0])?;
                        if trial.distance >= best.distance {
                            break;
                        }
                        best = trial;
                    }
                }
            }
        }
        let last = at(&best, best.model.angles, ROUNDS[1])?;
        Ok(if last.distance <= best.distance { last } else { best })
    }

    /// With the shape that lies closest, and the rigid motion that goes with it.
    fn reshaped(&self, mut trial: Trial, body: &Body, mesh: &TriMesh) -> Result<Trial, String> {
        let placed = Surface::new(trial.stance.placement.apply(mesh.positions()), mesh.faces().into());
        for _ in 0..SHAPE_ROUNDS {
            let Some((shape, motion)) = trial.model.closer_shape(body, &placed, &trial.motion)? else {
                break;
            };
            let model = Model::new(body, &shape, trial.model.angles)?;
            trial = Trial { model, motion, ..trial };
        }
        let (model, motion) = (trial.model.clone(), trial.motion);
        Ok(self.trial(trial.stance, model, motion, 0, body))
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
        let mut there: Vec<f64> = gaps_to(&moved, target).into_iter().map(f64::abs).collect();
        let step = (target.positions.len() / POINTS).max(1);
        let back = rotation::transpose(&placement.turn());
        let metres = placement.unit.metres();
        let in_file: Vec<[f64; 3]> = (target.positions.iter().step_by(step))
            .map(|q| rotation::apply(&back, scale(motion.inverse(*q), 1.0 / metres)))
            .collect();
        let factor = metres * motion.scale;
        let mut back: Vec<f64> =
            gaps_to(&in_file, &self.surface).into_iter().map(|g| factor * g.abs()).collect();
        0.5 * (mean_of_best(&mut there) + mean_of_best(&mut back))
    }
}

/// Mean of the smaller nine tenths.
fn mean_of_best(distances: &mut Vec<f64>) -> f64 {
    distances.sort_by(f64::total_cmp);
    distances.truncate((9 * distances.len()).div_ceil(10));
    distances.iter().sum::<f64>() / distances.len().max(1) as f64
}
