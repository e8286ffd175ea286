//! Candidates whose arms hang or whose legs stand apart: judged on bodies posed like them.

use super::{Search, distinct, sort};
use crate::fit::climb::{ClimbSteps, Moves, climbed};
use crate::fit::cloth::Cloth;
use crate::fit::judge::{Candidate, Judge};
use crate::fit::limb_pose::LimbPose;
use crate::fit::placement::{FileOrigin, Placement};
use crate::fit::settings::FitSettings;
use rayon::prelude::*;

/// Candidates in A-pose worth a body of their own.
const POSED: usize = 2;
/// Angles of each leg tried first (degrees), and for how many candidates.
const LEG_ANGLES: [f64; 7] = [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0];
const SPREAD: usize = 4;
/// Angles of each leg (degrees) at which garments are looked for that are worn nowhere else.
const STANCES: [f64; 2] = [5.0, 10.0];
/// Openings of a garment for legs.
const WAIST_AND_LEGS: usize = 3;

impl Search<'_> {
    /// The best whose legs stand apart, each by an angle that is found out.
    pub fn candidates_apart(&self, cloth: &Cloth, settings: &FitSettings) -> Vec<Candidate> {
        if settings.legs_degrees.is_some() || cloth.borders.len() < WAIST_AND_LEGS {
            return Vec::new();
        }
        let judge = self.judge(cloth, settings);
        let from = |degrees: f64| {
            let known = FitSettings { legs_degrees: Some(degrees), ..settings.clone() };
            let mut found = self.quick_candidates(cloth, &known);
            found.truncate(SPREAD);
            found.into_par_iter().map(|c| self.climbed_posed(&judge, &c)).collect::<Vec<_>>()
        };
        let mut all: Vec<Candidate> = STANCES.into_iter().flat_map(from).collect();
        sort(&mut all);
        distinct(all)
    }

    /// The best in A-pose, on a body posed like that: the shoulders of the search's body are rigid.
    pub(super) fn judge_again_posed(&self, judge: &Judge, ranked: &mut [Candidate]) {
        for candidate in ranked.iter_mut().filter(|c| c.placement.arm_angle_degrees != 0.0).take(POSED) {
            *candidate = self.climbed_posed(judge, candidate);
        }
        sort(ranked);
    }

    /// Adds the best with their legs apart, where a garment with leg openings lies better so: only those tell.
    pub(super) fn spread_legs(&self, judge: &Judge, ranked: &mut Vec<Candidate>) {
        if judge.settings.legs_degrees.is_some() || judge.cloth.borders.len() < WAIST_AND_LEGS {
            return;
        }
        let at = |c: &Candidate, degrees: f64| Placement { leg_angle_degrees: degrees, ..c.placement };
        let apart = Judge { field: self.measured.apart.clone(), ..judge.clone() };
        let has_legs = |c: &&Candidate| LEG_ANGLES.iter().any(|degrees| apart.limbs(&at(c, *degrees)).legs);
        let spread = |candidate: &Candidate| {
            let turned = apart.turned(&candidate.placement, None, true);
            let scored = |degrees: &f64| apart.scored(Candidate::at(at(candidate, *degrees)), &turned, true);
            let best = LEG_ANGLES.iter().map(scored).max_by(|a, b| a.score.total_cmp(&b.score));
            let start = apart.with_openings(best?);
            let near = if start.placement.arm_angle_degrees == 0.0 { &apart } else { judge };
            let found = self.climbed_posed(near, &start);
            // Its weights are those of its own pose.
            (found.score > candidate.score).then(|| self.climbed_posed(judge, &found))
        };
        let together: Vec<&Candidate> = ranked.iter().filter(has_legs).take(SPREAD).collect();
        let found: Vec<Candidate> = together.into_par_iter().filter_map(spread).collect();
        ranked.extend(found);
        sort(ranked);
    }

    /// The best near a candidate on a body in its pose.
    fn climbed_posed(&self, judge: &Judge, candidate: &Candidate) -> Candidate {
        let judge = self.posed_judge(judge, &candidate.placement);
        let moves =
            if candidate.placement.origin == FileOrigin::Elsewhere { Moves::All } else { Moves::Limbs };
        let steps = ClimbSteps { from: 0.02, to: 0.0005, is_sharp: true, is_fine: true, moves };
        judge.judged(climbed(&judge, candidate, &steps).placement)
    }

    /// The same judge on a body whose limbs are held as a garment's.
    pub(super) fn posed_judge<'b>(&self, judge: &Judge<'b>, placement: &Placement) -> Judge<'b> {
        if placement.has_limbs_at_rest() || judge.field.is_posed(placement) {
            return judge.clone();
        }
        let field = self.measured.field.posed(&LimbPose::of(self.body, placement), self.body);
        Judge { field, ..judge.clone() }
    }
}
