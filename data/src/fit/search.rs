//! Finds where a garment belongs on the body: unit, axes, origin, turn and arm pose are hypotheses, scored together by a
//! [`Judge`], from coarse to fine.

mod limbs;

use super::anatomy::BodySkeleton;
use super::body_field::{BodyField, LimbTurn};
use super::climb::{ClimbSteps, Moves, climbed};
use super::cloth::Cloth;
use super::coverage::off_trunk;
use super::error::FitError;
use super::judge::{Candidate, Judge};
use super::limb_pose::LimbPose;
use super::placement::{FileOrigin, Placement, Unit};
use super::settings::FitSettings;
use super::sitting::Sitting;
use crate::asset::Body;
use crate::mesh::bounds;
use clothcombo_physics::query::Surface;
use clothcombo_physics::vec3::add;
use rayon::prelude::*;

/// Arm angles tried first (degrees).
pub(super) const ARM_ANGLES: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
/// Heights tried first (m apart), and places in front of and behind the middle (m).
const HEIGHT_STEP: f64 = 0.04;
const FORWARD_STEPS: [f64; 3] = [0.0, 0.05, -0.05];
/// Heights of rims tried first: how many, how far apart and from how far below the waist (m).
const RIM_HEIGHTS: usize = 20;
const RIM_STEP: f64 = 0.025;
const BELOW_WAIST: f64 = 0.18;
/// Largest extent of a garment, in those of the body: from a belt to a train.
const PLAUSIBLE_EXTENT: [f64; 2] = [0.1, 1.2];
/// Starts of one scale and turn that are kept by the blunt likelihood, from rims, and of them for the climb.
const ROUGH_STARTS: usize = 60;
const FROM_RIMS: usize = 6;
const MOST_CLIMBED: usize = 10;
/// Candidates that are judged by everything.
const MOST_JUDGED: usize = 12;
/// Angle of each leg (degrees) for whose weights a body is made.
const SPREAD_LEGS: f64 = 6.0;
/// How far up and down the height of a placement is doubted (m): a garment is back within 2 cm.
const PROBE_HEIGHT: f64 = 0.025;

/// What is measured on a body once, for all garments.
pub(super) struct SearchBody {
    pub(super) field: BodyField,
    skeleton: BodySkeleton,
    surface: Surface<f64>,
    /// The field of the body with its legs apart; made here, since the body is shared by threads afterwards.
    apart: BodyField,
    /// Largest extent of the body (m).
    pub(super) reach: f64,
}

impl SearchBody {
    /// Measures the zero body.
    ///
    /// # Errors
    /// [`FitError::ImplausibleBody`] if it is no standing person.
    pub fn new(body: &Body) -> Result<Self, FitError> {
        if let Some(reason) = body.implausibility() {
            return Err(FitError::ImplausibleBody(reason));
        }
        let surface = Surface::new(body.template.clone(), body.faces.clone());
        let reach = body.zero_body().extent();
        let (field, skeleton) = (BodyField::new(body), BodySkeleton::new(body));
        let placement = Placement { leg_angle_degrees: SPREAD_LEGS, ..Placement::AS_GIVEN };
        let apart = field.posed(&LimbPose::of(body, &placement), body);
        Ok(Self { field, skeleton, surface, apart, reach })
    }
}

/// A search on one body.
pub(super) struct Search<'a> {
    pub(super) body: &'a Body,
    /// Of the same body.
    pub(super) measured: &'a SearchBody,
}

impl<'a> Search<'a> {
    /// Units in which a garment can fit this body at all, of those that `settings` allow.
    pub fn plausible_units(&self, cloth: &Cloth, settings: &FitSettings) -> Vec<Unit> {
        let (extent, [least, most]) =
            (cloth.extent(), PLAUSIBLE_EXTENT.map(|share| share * self.measured.reach));
        let units = settings.unit.map_or(Unit::ALL.to_vec(), |unit| vec![unit]);
        let is_plausible = |unit: &Unit| (least..=most).contains(&(extent * unit.metres()));
        units.into_iter().filter(is_plausible).collect()
    }

    /// How a garment sits in its own arm pose, and its height (m).
    pub fn measured(&self, cloth: &Cloth, placement: &Placement) -> (Sitting, f64) {
        let points = placement.apply(&cloth.fine);
        let [low, high] = bounds(&points);
        let sitting = match placement.has_limbs_at_rest() {
            true => Sitting::new(&points, self.body, &self.measured.surface),
            false => Sitting::new(&points, self.body, &LimbPose::of(self.body, placement).surface(self.body)),
        };
        (sitting, high[1] - low[1])
    }

    /// Sample points with the arms raised to the T-pose (m).
    pub fn level(&self, cloth: &Cloth, placement: &Placement) -> Vec<[f64; 3]> {
        let turn = LimbTurn::of(placement);
        placement.apply(&cloth.fine).into_iter().map(|p| self.measured.field.level(p, turn.arms)).collect()
    }

    /// Where a garment lies that covers neither trunk nor hips.
    pub fn off_trunk(&self, cloth: &Cloth, placement: &Placement) -> Option<&'static str> {
        off_trunk(&placement.apply(&cloth.fine), self.body)
    }

    /// The surface of the zero body in T-pose.
    pub fn surface(&self) -> &'a Surface<f64> {
        &self.measured.surface
    }

    /// The judge of a garment.
    pub fn judge<'b>(&'b self, cloth: &'b Cloth, settings: &'b FitSettings) -> Judge<'b> {
        Judge { field: self.measured.field.clone(), skeleton: &self.measured.skeleton, cloth, settings }
    }

    /// Distinct candidates, the best first.
    pub fn candidates(&self, cloth: &Cloth, settings: &FitSettings) -> Vec<Candidate> {
        self.found(cloth, settings, true)
    }

    /// The same without bodies made for their limbs, to compare sizes by.
    pub fn quick_candidates(&self, cloth: &Cloth, settings: &FitSettings) -> Vec<Candidate> {
        self.found(cloth, settings, false)
    }

    fn found(&self, cloth: &Cloth, settings: &FitSettings, is_posed: bool) -> Vec<Candidate> {
        let leg_angle_degrees = settings.legs_degrees.unwrap_or(0.0);
        let straight = Placement { leg_angle_degrees, ..Placement::AS_GIVEN };
        let judge = self.posed_judge(&self.judge(cloth, settings), &straight);
        let mut bases = Vec::new();
        for unit in self.plausible_units(cloth, settings) {
            for up in settings.ups() {
                let turns = settings.turns().into_iter();
                bases.extend(turns.map(|turn_degrees| Placement { unit, up, turn_degrees, ..straight }));
            }
        }
        let mut found: Vec<Candidate> =
            bases.par_iter().flat_map_iter(|base| self.climbed_from(base, &judge)).collect();
        sort(&mut found);
        let mut best = distinct(found);
        best.truncate(MOST_JUDGED);
        let steps = ClimbSteps { from: 0.01, to: 0.0005, is_sharp: true, is_fine: true, moves: Moves::All };
        let mut last: Vec<Candidate> = best
            .par_iter()
            .map(|c| judge.judged(climbed(&judge, c, &steps).placement))
            .chain(self.usual(&bases, &judge).into_par_iter().map(|p| self.judged_as_given(&judge, p)))
            .collect();
        sort(&mut last);
        if is_posed {
            self.judge_again_posed(&judge, &mut last);
            self.spread_legs(&judge, &mut last);
        }
        distinct(last)
    }

    /// The best of one scale and turn.
    fn climbed_from(&self, base: &Placement, judge: &Judge) -> Vec<Candidate> {
        let rims = best_of(self.starts_by_rim(base, judge), FROM_RIMS);
        let heights = best_of(self.starts_by_height(base, judge), ROUGH_STARTS);
        let starts = rims.into_iter().chain(heights).map(|c| judge.with_openings(c));
        let roughly = ClimbSteps { from: 0.04, to: 0.01, is_sharp: false, is_fine: false, moves: Moves::All };
        let sharply =
            ClimbSteps { from: 0.019, to: 0.004, is_sharp: true, is_fine: false, moves: Moves::All };
        let climb = |c: Candidate| {
            let rough = judge.with_openings(climbed(judge, &c, &roughly));
            judge.with_openings(climbed(judge, &rough, &sharply))
        };
        distinct(starts.filter(|c| c.is_worn).collect()).into_iter().take(MOST_CLIMBED).map(climb).collect()
    }

    /// The middle of the garment in front of, at and behind the middle of the trunk, its top at every height, with every angle of
    /// the arms.
    fn starts_by_height(&self, base: &Placement, judge: &Judge) -> Vec<Candidate> {
        let BodyField { low: floor, high: crown, spine_z, .. } = self.measured.field;
        let turned = judge.turned(base, None, false);
        let [low, high] = bounds(&turned.points);
        let [x, z] = [0, 2].map(|a| 0.5 * (low[a] + high[a]));
        let heights = ((crown[1] - floor[1]) / HEIGHT_STEP) as usize;
        let at = |height: usize, forward: f64| {
            let top = floor[1] + 0.2 + height as f64 * HEIGHT_STEP;
            [-x, top - high[1], spine_z - z + forward]
        };
        let all = || (0..heights).flat_map(|height| FORWARD_STEPS.map(|forward| at(height, forward)));
        let places = judge.settings.offset.map_or_else(|| all().collect(), |offset| vec![offset]);
        let allowed = |a: &f64| judge.settings.arms_lowered.is_none_or(|lowered| lowered == (*a != 0.0));
        let with_arms = |arm_angle_degrees: f64| {
            let base = Placement { arm_angle_degrees, origin: FileOrigin::Elsewhere, ..*base };
            places.iter().map(move |translation| Placement { translation: *translation, ..base })
        };
        let placements = ARM_ANGLES.into_iter().filter(allowed).flat_map(with_arms);
        placements.map(|p| judge.scored(Candidate::at(p), &turned, false)).collect()
    }

    /// Each of the longest borders around the trunk, at every height.
    fn starts_by_rim(&self, base: &Placement, judge: &Judge) -> Vec<Candidate> {
        if judge.settings.offset.is_some() || judge.settings.arms_lowered == Some(true) {
            return Vec::new();
        }
        let BodyField { levels, spine_z, .. } = self.measured.field;
        let mut borders: Vec<usize> = (0..judge.cloth.borders.len()).collect();
        let length = |border: &usize| judge.cloth.border_lengths[*border];
        borders.sort_by(|a, b| length(b).total_cmp(&length(a)));
        let of_border = |border: usize| {
            let turned = judge.turned(base, Some(border), false);
            let sum = turned.rim.iter().fold([0.0; 3], |sum, p| add(sum, *p));
            let [x, y, z] = sum.map(|x| x / turned.rim.len().max(1) as f64);
            let heights =
                (0..RIM_HEIGHTS).map(|height| levels.waist - BELOW_WAIST + RIM_STEP * height as f64);
            let places =
                heights.flat_map(|height| [0.0, 0.03].map(|forward| [-x, height - y, spine_z + forward - z]));
            let scored = |translation| {
                let p = Placement { translation, origin: FileOrigin::Elsewhere, ..*base };
                judge.scored(Candidate::at(p), &turned, false)
            };
            places.map(scored).collect::<Vec<_>>()
        };
        borders.into_iter().take(3).flat_map(of_border).collect()
    }

    /// The best placement around a candidate, and how much worse (log-posterior) the better one of those a probe's height above
    /// and below it is, when everything but the height is found anew.
    pub fn probed(&self, cloth: &Cloth, settings: &FitSettings, candidate: Candidate) -> (Candidate, f64) {
        let judge = self.posed_judge(&self.judge(cloth, settings), &candidate.placement);
        let around = |best: &Candidate, moves: Moves| -> Candidate {
            let at = |dy: f64| {
                let mut moved = *best;
                moved.placement.translation[1] += dy;
                let steps = ClimbSteps { from: 0.02, to: 0.001, is_sharp: true, is_fine: true, moves };
                judge.judged(climbed(&judge, &moved, &steps).placement)
            };
            let (below, above) = rayon::join(|| at(-PROBE_HEIGHT), || at(PROBE_HEIGHT));
            if below.score > above.score { below } else { above }
        };
        let start = judge.judged(candidate.placement);
        let found = around(&start, Moves::All);
        let best = if found.score > start.score { found } else { start };
        (best, best.score - around(&best, Moves::Level).score)
    }
}

fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
}

/// So many of them, the best first.
fn best_of(mut candidates: Vec<Candidate>, count: usize) -> Vec<Candidate> {
    sort(&mut candidates);
    candidates.truncate(count);
    candidates
}

/// Without those close to a better one: the same turn, within 2 cm, with arms within 8° or that change nothing.
fn distinct(ranked: Vec<Candidate>) -> Vec<Candidate> {
    let mut kept: Vec<Candidate> = Vec::new();
    for c in ranked {
        let is_new = |better: &Candidate| {
            let (a, b) = (&better.placement, &c.placement);
            let turned = (a.unit, a.up, a.turn_degrees) != (b.unit, b.up, b.turn_degrees);
            let arms =
                (a.arm_angle_degrees - b.arm_angle_degrees).abs() > 8.0 && (better.fit - c.fit).abs() > 0.5;
            let legs = (a.leg_angle_degrees == 0.0) != (b.leg_angle_degrees == 0.0);
            turned || arms || legs || (0..3).any(|k| (a.translation[k] - b.translation[k]).abs() > 0.02)
        };
        if kept.iter().all(is_new) {
            kept.push(c);
        }
    }
    kept
}
