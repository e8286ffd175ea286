//! Any mesh of a person, in any unit, with any axis up, facing anywhere, its arms level or lowered, registered to the zero body.

use super::icp::{Similarity, registered};
use super::registered::Registered;
use super::source::SourceMesh;
use super::stance::{HEIGHTS, Stance, stances};
use super::{gaps_to, median};
use crate::asset::Body;
use crate::asset::rotation;
use crate::fit::arm_pose::ArmPose;
use crate::fit::placement::Placement;
use crate::fit::samples::Samples;
use crate::fit::settings::FitSettings;
use crate::mesh::bounds;
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{scale, sub};

/// Points that are registered.
const POINTS: usize = 2500;
/// Rounds in which stances are compared, and then the best one is refined.
const ROUNDS: [usize; 2] = [8, 24];
/// Steps by which the angle of the arms is refined (degrees).
const ARM_STEPS: [f64; 4] = [8.0, 4.0, 2.0, 1.0];
/// Surfaces farther apart than this (median, mm) are no two bodies in one pose.
const FARTHEST_MM: f64 = 25.0;
/// A stance whose distance is within this factor of the best one's is a near-tie.
const NEAR_TIE: f64 = 1.15;

/// A stance after registration.
struct Trial {
    stance: Stance,
    arms: ArmPose,
    motion: Similarity,
    /// Mean distance in both directions, of the nearer nine tenths (m).
    distance: f64,
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
    let mut trials: Vec<Trial> = stances(&source.points, body, settings)
        .into_iter()
        .map(|stance| source.tried(stance, body))
        .collect();
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
    let best = chosen(trials)?;
    let best = source.refined(best, body);
    let placement = best.stance.placement;
    let placed = placement.apply(surface.positions());
    let moved: Vec<[f64; 3]> =
        placement.apply(&source.points).iter().map(|p| best.motion.apply(*p)).collect();
    let mut distances: Vec<f64> = gaps_to(&moved, &best.arms.surface).into_iter().map(f64::abs).collect();
    let alignment_mm = 1e3 * median(&mut distances);
    if !(alignment_mm <= FARTHEST_MM) {
        return Err(format!(
            "it does not look like body '{}': after the alignment the surfaces are {alignment_mm:.0} mm apart (median; at most \
             {FARTHEST_MM} mm). It must be a whole person, standing, legs straight, arms level or lowered; --unit, --up and --turn say \
             how it stands",
            body.name
        ));
    }
    let placement = Placement { arm_angle_degrees: best.arms.degrees, ..placement };
    let faces = surface.faces().into();
    Ok((
        placement,
        Registered { positions: placed, faces, motion: best.motion, arms: best.arms, alignment_mm },
    ))
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
    if best.stance.says_back() && near > 1 {
        return Err("its feet point backwards where the rest fits; say --up and --turn".into());
    }
    Ok(best)
}

/// The mesh in the unit and axes of its file.
struct Source {
    points: Vec<[f64; 3]>,
    surface: Surface<f64>,
}

impl Source {
    fn tried(&self, stance: Stance, body: &Body) -> Trial {
        let arms = ArmPose::new(body, stance.arms);
        let [low, high] = bounds(&arms.positions);
        let factor = (high[1] - low[1]) / stance.height;
        let start = Similarity::scaling(factor, sub([0.0, low[1], 0.0], scale(stance.foot, factor)));
        self.trial(stance, arms, start, ROUNDS[0])
    }

    fn trial(&self, stance: Stance, arms: ArmPose, start: Similarity, rounds: usize) -> Trial {
        let placed = stance.placement.apply(&self.points);
        let motion = registered(&placed, &arms.surface, start, rounds);
        let distance = self.distance(&placed, &stance.placement, &motion, &arms);
        Trial { stance, arms, motion, distance }
    }

    /// Tries other angles of the arms, in ever smaller steps.
    fn refined(&self, mut best: Trial, body: &Body) -> Trial {
        for step in ARM_STEPS {
            for sign in [-1.0, 1.0] {
                let degrees = (best.arms.degrees + sign * step).clamp(0.0, 85.0);
                let trial =
                    self.trial(best.stance.clone(), ArmPose::new(body, degrees), best.motion, ROUNDS[0]);
                if trial.distance < best.distance {
                    best = trial;
                }
            }
        }
        let last =
            self.trial(best.stance.clone(), ArmPose::new(body, best.arms.degrees), best.motion, ROUNDS[1]);
        if last.distance <= best.distance { last } else { best }
    }

    /// Mean distance from the points to the target and back (m), of the nearer nine tenths: medians do not see the arms.
    fn distance(
        &self,
        placed: &[[f64; 3]],
        placement: &Placement,
        motion: &Similarity,
        arms: &ArmPose,
    ) -> f64 {
        let moved: Vec<[f64; 3]> = placed.iter().map(|p| motion.apply(*p)).collect();
        let mut there: Vec<f64> = gaps_to(&moved, &arms.surface).into_iter().map(f64::abs).collect();
        let step = (arms.positions.len() / POINTS).max(1);
        let back = rotation::transpose(&placement.turn());
        let metres = placement.unit.metres();
        let in_file: Vec<[f64; 3]> = (arms.positions.iter().step_by(step))
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
