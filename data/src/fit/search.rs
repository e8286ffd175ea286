//! Finds where a garment belongs on the body: unit, axes, origin, turn and arm pose are scored together.
//!
//! A hypothesis is scored by the log-posterior: how likely the gaps between cloth and body are for worn clothes
//! ([`likelihood`](super::likelihood)), how usual such a file is, and whether limbs pass through openings instead of
//! cloth ([`anatomy`](super::anatomy)).

use super::anatomy::{Opening, Skeleton};
use super::body_field::{ArmTurn, BodyField};
use super::likelihood::{log_likelihood, rough_log_likelihood};
use super::placement::{Origin, Placement, Unit, UpAxis};
use super::samples::Samples;
use super::settings::FitSettings;
use crate::asset::Body;
use crate::mesh::bounds;
use clothcombo_physics::vec3::add;
use rayon::prelude::*;

/// Independent samples a garment is worth: neighbouring cloth lies alike.
static RIM_EVIDENCE: std::sync::LazyLock<f64> = std::sync::LazyLock::new(|| super::likelihood::env("RIME", 8.0));
const EVIDENCE: f64 = 40.0;
/// Arm angles tried first (degrees).
const ARM_ANGLES: [f64; 6] = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
/// Heights tried first (m apart).
const HEIGHT_STEP: f64 = 0.04;
/// Log-prior against a garment through whose openings no limbs pass.
const UNWORN: f64 = 100.0;
/// Clothes are as wide on the left as on the right within this (m).
const SYMMETRY: f64 = 0.02;
/// Log-prior against a bone that passes through cloth.
const CROSSING: f64 = 8.0;

/// A garment in the file's coordinates.
pub(super) struct Cloth<'a> {
    pub positions: &'a [[f64; 3]],
    pub faces: &'a [[u32; 3]],
    pub borders: &'a [Vec<u32>],
}

/// A placement and what speaks for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub placement: Placement,
    /// Mean log-likelihood of the gaps.
    pub fit: f64,
    /// Log-posterior up to a constant.
    pub score: f64,
    pub crossings: usize,
    /// The border that is its upper rim, if the garment hangs from one.
    pub rim: Option<usize>,
    pub is_worn: bool,
}

/// The body as the search sees it.
pub(super) struct Search {
    field: BodyField,
    skeleton: Skeleton,
    /// Largest extent of the body (m).
    pub reach: f64,
}

impl Search {
    pub fn new(body: &Body) -> Self {
        Self { field: BodyField::new(body), skeleton: Skeleton::new(body), reach: body.zero_body().extent() }
    }

    /// Whether a garment of this largest extent (m) can fit this body at all.
    pub fn is_plausible_extent(&self, extent: f64) -> bool {
        extent >= 0.07 * self.reach && extent <= 1.2 * self.reach
    }

    /// Candidates, the best first; distinct ones only.
    pub fn candidates(&self, cloth: &Cloth, extent: f64, settings: &FitSettings) -> Vec<Candidate> {
        let coarse = Samples::new(cloth.positions, cloth.faces, 200);
        let fine = Samples::new(cloth.positions, cloth.faces, 1000);
        let units = Unit::ALL.into_iter().filter(|u| {
            settings.unit.is_none_or(|s| s == *u) && self.is_plausible_extent(extent * u.metres())
        });
        let ups: Vec<UpAxis> = settings.up.map_or(UpAxis::ALL.to_vec(), |up| vec![up]);
        let turns = settings.turn_degrees.map_or(vec![0.0, 90.0, 180.0, 270.0], |turn| vec![turn]);
        let arms: Vec<f64> = (ARM_ANGLES.into_iter())
            .filter(|a| settings.arms_lowered.is_none_or(|lowered| lowered == (*a != 0.0)))
            .collect();
        let mut turned = Vec::new();
        for unit in units {
            for &up in &ups {
                for &turn_degrees in &turns {
                    turned.push(Placement { unit, up, turn_degrees, ..Placement::AS_GIVEN });
                }
            }
        }
        let refined: Vec<Candidate> = turned
            .par_iter()
            .flat_map_iter(|base| {
                let mut started = self.started(base, &arms, &coarse, settings);
                started.sort_by(|a, b| b.score.total_cmp(&a.score));
                started.truncate(60);
                let mut from_rims = self.started_from_rims(base, &coarse, cloth, settings);
                from_rims.sort_by(|a, b| b.score.total_cmp(&a.score));
                from_rims.truncate(6);
                from_rims.extend(started);
                let mut worn: Vec<Candidate> =
                    from_rims.into_iter().map(|c| self.with_openings(c, cloth)).filter(|c| c.is_worn).collect();
                worn = self.distinct(worn);
                worn.truncate(10);
                worn.into_iter().map(|c| {
                    let c = self.with_openings(self.refined(&c, &coarse, settings, cloth, 0.04, 0.01), cloth);
                    self.with_openings(self.refined(&c, &coarse, settings, cloth, 0.019, 0.004), cloth)
                })
            })
            .collect();
        let mut refined = refined;
        refined.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut distinct = self.distinct(refined);
        distinct.truncate(12);
        distinct.extend(self.given(&turned, &fine, settings));
        let mut last: Vec<Candidate> = distinct
            .par_iter()
            .map(|c| {
                let c = match c.placement.origin {
                    Origin::Elsewhere => self.refined(c, &fine, settings, cloth, 0.01, 0.0005),
                    _ => {
                        let c = self.with_openings(self.scored(c.placement, &fine, settings), cloth);
                        self.with_rim(c, cloth)
                    }
                };
                self.with_anatomy(c, cloth)
            })
            .collect();
        last.sort_by(|a, b| b.score.total_cmp(&a.score));
        last
    }

    /// Files as they stand: their origin at one of the usual points.
    fn given(&self, turned: &[Placement], fine: &Samples, settings: &FitSettings) -> Vec<Candidate> {
        if settings.offset.is_some() || settings.arms_lowered == Some(true) {
            return Vec::new();
        }
        let mut given: Vec<Candidate> = turned
            .par_iter()
            .flat_map_iter(|base| {
                [Origin::Pelvis, Origin::Floor].map(|origin| {
                    let y = if origin == Origin::Floor { self.field.low[1] } else { 0.0 };
                    self.scored(Placement { origin, translation: [0.0, y, 0.0], ..*base }, fine, settings)
                })
            })
            .collect();
        given.sort_by(|a, b| b.score.total_cmp(&a.score));
        given.truncate(4);
        given
    }

    /// The best height for every arm angle.
    fn started(&self, base: &Placement, arms: &[f64], coarse: &Samples, settings: &FitSettings) -> Vec<Candidate> {
        let points = base.apply(&coarse.0);
        let [low, high] = bounds(&points);
        let [x, z] = [0, 2].map(|a| 0.5 * (low[a] + high[a]));
        let heights = ((self.field.high[1] - self.field.low[1]) / HEIGHT_STEP) as usize;
        let mut all = Vec::new();
        for &arm_angle_degrees in arms {
            let at = |h: usize| {
                let top = self.field.low[1] + 0.2 + (h / 3) as f64 * HEIGHT_STEP;
                let forward = [0.0, 0.05, -0.05][h % 3];
                let translation = settings.offset.unwrap_or([-x, top - high[1], self.field.spine_z - z + forward]);
                let p = Placement { translation, arm_angle_degrees, origin: Origin::Elsewhere, ..*base };
                self.roughly_scored(p, &points, settings)
            };
            let mut tried: Vec<Candidate> =
                (0..if settings.offset.is_some() { 1 } else { 3 * heights }).map(at).collect();
            tried.sort_by(|a, b| b.score.total_cmp(&a.score));
            all.extend(tried.into_iter().take(16));
        }
        all
    }

    /// Each of the longest borders around the trunk, at every height.
    fn started_from_rims(&self, base: &Placement, coarse: &Samples, cloth: &Cloth, settings: &FitSettings) -> Vec<Candidate> {
        if settings.offset.is_some() || settings.arms_lowered == Some(true) {
            return Vec::new();
        }
        let points = base.apply(&coarse.0);
        let mut borders: Vec<usize> = (0..cloth.borders.len()).collect();
        borders.sort_by_key(|b| std::cmp::Reverse(cloth.borders[*b].len()));
        let mut all = Vec::new();
        for &border in borders.iter().take(3) {
            let of = Candidate { placement: *base, fit: 0.0, score: 0.0, crossings: 0, rim: Some(border), is_worn: true };
            let rim = self.rim_points(&of, cloth);
            let sum = rim.iter().fold([0.0; 3], |sum, p| add(sum, *p));
            let centre = sum.map(|x| x / rim.len().max(1) as f64);
            for height in 0..20 {
                let y = self.field.rims[0] - 0.15 + 0.025 * f64::from(height);
                for forward in [0.0, 0.03] {
                    let translation = [-centre[0], y - centre[1], self.field.spine_z + forward - centre[2]];
                    let p = Placement { translation, origin: Origin::Elsewhere, ..*base };
                    let scored = self.roughly_scored(p, &points, settings);
                    let score = scored.score + self.rim_score(&rim, &p);
                    all.push(Candidate { rim: Some(border), score, ..scored });
                }
            }
        }
        all
    }

    fn scored(&self, placement: Placement, samples: &Samples, settings: &FitSettings) -> Candidate {
        let points = Placement { translation: [0.0; 3], ..placement }.apply(&samples.0);
        self.scored_at(placement, &points, settings)
    }

    /// By the blunt likelihood, in which a garment some centimetres from its place still counts.
    fn roughly_scored(&self, placement: Placement, points: &[[f64; 3]], settings: &FitSettings) -> Candidate {
        let arms = ArmTurn::new(placement.arm_angle_degrees);
        let gaps = points.iter().map(|p| self.field.gap(add(*p, placement.translation), arms));
        let fit = rough_log_likelihood(gaps, EVIDENCE);
        let score = fit + placement.log_prior(settings);
        Candidate { placement, fit, score, crossings: 0, rim: None, is_worn: true }
    }

    /// `points`: scaled and turned, not yet translated.
    fn scored_at(&self, placement: Placement, points: &[[f64; 3]], settings: &FitSettings) -> Candidate {
        let arms = ArmTurn::new(placement.arm_angle_degrees);
        let gaps = points.iter().map(|p| self.field.gap(add(*p, placement.translation), arms));
        let fit = log_likelihood(gaps, EVIDENCE);
        let middle = points.iter().map(|p| p[0]).fold(f64::MIN, f64::max) + points.iter().map(|p| p[0]).fold(f64::MAX, f64::min);
        let aside = (0.5 * middle + placement.translation[0]) / SYMMETRY;
        let score = fit + placement.log_prior(settings) - (0.5 * aside * aside).min(8.0);
        Candidate { placement, fit, score, crossings: 0, rim: None, is_worn: true }
    }

    /// Slid along the three axes, and the arms turned, as long as that helps.
    fn refined(&self, start: &Candidate, samples: &Samples, settings: &FitSettings, cloth: &Cloth, from: f64, to: f64) -> Candidate {
        let points = Placement { translation: [0.0; 3], ..start.placement }.apply(&samples.0);
        let rough = from > 0.02;
        let rim = self.rim_points(start, cloth);
        let scored = |placement: Placement| {
            let mut c = if rough { self.roughly_scored(placement, &points, settings) } else { self.scored_at(placement, &points, settings) };
            c.rim = start.rim;
            c.score += self.rim_score(&rim, &placement);
            c
        };
        let mut best = scored(start.placement);
        let mut step = from;
        while step > to {
            let mut is_better = false;
            for axis in [1, 2, 0, 3] {
                for sign in [-1.0, 1.0] {
                    let mut trial = best.placement;
                    match axis {
                        3 if trial.arm_angle_degrees == 0.0 || settings.arms_lowered == Some(false) => continue,
                        // A sleeve is half a metre long.
                        3 => trial.arm_angle_degrees = (trial.arm_angle_degrees + sign * (2.0 * step).to_degrees()).clamp(3.0, 85.0),
                        _ if settings.offset.is_some() => continue,
                        _ => trial.translation[axis] += sign * step,
                    }
                    let trial = scored(trial);
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

    /// What each border goes around, `points` being its vertices on the body. A border that runs through the body goes around
    /// nothing.
    fn openings(&self, placement: &Placement, cloth: &Cloth) -> Vec<(Opening, f64)> {
        let arms = ArmTurn::new(placement.arm_angle_degrees);
        let of_border = |border: &Vec<u32>| {
            let points: Vec<[f64; 3]> = border.iter().map(|v| cloth.positions[*v as usize]).collect();
            let points = placement.apply(&points);
            let height = points.iter().map(|p| p[1]).sum::<f64>() / points.len().max(1) as f64;
            let inside = points.iter().filter(|p| self.field.gap(**p, arms).0 < -0.012).count();
            match 4 * inside > points.len() {
                true => (Opening::Nothing, height),
                false => (self.skeleton.opening(&points, arms), height),
            }
        };
        cloth.borders.iter().map(of_border).collect()
    }

    /// Whether limbs pass through its openings, and which height its upper rim has if it hangs from one.
    fn with_openings(&self, mut candidate: Candidate, cloth: &Cloth) -> Candidate {
        let openings = self.openings(&candidate.placement, cloth);
        let count = |wanted: Opening| openings.iter().filter(|(o, _)| *o == wanted).count();
        let has = |wanted: Opening| count(wanted) > 0;
        let others = [Opening::Neck, Opening::LeftArm, Opening::RightArm, Opening::LeftLeg, Opening::RightLeg, Opening::Several];
        let arms = has(Opening::LeftArm) && has(Opening::RightArm);
        let is_around = count(Opening::Trunk) >= 2 || (has(Opening::Trunk) && others.into_iter().any(has)) || arms;
        // Only sleeves and armholes tell how arms hang.
        let is_worn = is_around && (arms || has(Opening::Several) || candidate.placement.arm_angle_degrees == 0.0);
        if candidate.is_worn && !is_worn {
            candidate.score -= UNWORN;
        }
        candidate.is_worn = is_worn;
        candidate.rim = None;
        if !has(Opening::Neck) && !arms {
            let trunk = openings.iter().enumerate().filter(|(_, (o, _))| *o == Opening::Trunk);
            candidate.rim = trunk.max_by(|a, b| a.1.1.total_cmp(&b.1.1)).map(|(border, _)| border);
        }
        candidate
    }

    /// What speaks for the upper rim: it lies on the body, all around, at the waist or above the chest.
    fn rim_score(&self, rim: &[[f64; 3]], placement: &Placement) -> f64 {
        if rim.is_empty() {
            return 0.0;
        }
        let arms = ArmTurn::new(placement.arm_angle_degrees);
        let height = rim.iter().map(|p| p[1]).sum::<f64>() / rim.len() as f64 + placement.translation[1];
        let gaps = rim.iter().map(|p| (self.field.gap(add(*p, placement.translation), arms).0, 0));
        log_likelihood(gaps, *RIM_EVIDENCE) + self.rim_prior(height)
    }

    /// At most 60 points of the rim, scaled and turned, not translated.
    fn rim_points(&self, candidate: &Candidate, cloth: &Cloth) -> Vec<[f64; 3]> {
        let Some(border) = candidate.rim.map(|i| &cloth.borders[i]) else { return Vec::new() };
        let stride = border.len().div_ceil(60);
        let points: Vec<[f64; 3]> = border.iter().step_by(stride).map(|v| cloth.positions[*v as usize]).collect();
        Placement { translation: [0.0; 3], ..candidate.placement }.apply(&points)
    }

    fn with_rim(&self, candidate: Candidate, cloth: &Cloth) -> Candidate {
        let rim = self.rim_points(&candidate, cloth);
        Candidate { score: candidate.score + self.rim_score(&rim, &candidate.placement), ..candidate }
    }

    /// Log-density of the height of an upper rim (m): at the waist, or above the chest.
    fn rim_prior(&self, height: f64) -> f64 {
        let normal = |middle: f64, spread: f64| (-0.5 * ((height - middle) / spread).powi(2)).exp() / (spread * 2.5066);
        let [waist, chest] = self.field.rims;
        (0.6 * normal(waist, 0.035) + 0.35 * normal(chest, 0.03) + 0.02).ln() - 5.0f64.ln()
    }

    fn with_anatomy(&self, candidate: Candidate, cloth: &Cloth) -> Candidate {
        let mut candidate = self.with_openings(candidate, cloth);
        let arms = ArmTurn::new(candidate.placement.arm_angle_degrees);
        let placed = candidate.placement.apply(cloth.positions);
        candidate.crossings = self.skeleton.crossings(&placed, cloth.faces, arms);
        candidate.score -= CROSSING * candidate.crossings as f64;
        candidate
    }

    pub fn judge(&self, p: Placement, cloth: &Cloth, settings: &FitSettings) -> Candidate {
        let fine = Samples::new(cloth.positions, cloth.faces, 1000);
        let c = self.with_openings(self.scored(p, &fine, settings), cloth);
        self.with_anatomy(self.with_rim(c, cloth), cloth)
    }

    pub fn debug(&self, p: &Placement, cloth: &Cloth) {
        for (b, (o, y)) in cloth.borders.iter().zip(self.openings(p, cloth)) {
            eprintln!("border {} {o:?} {y:.3}", b.len());
        }
        let fine = Samples::new(cloth.positions, cloth.faces, 2000);
        let arms = ArmTurn::new(p.arm_angle_degrees);
        let mut bins = [0; 20];
        let mut all: Vec<f64> = p.apply(&fine.0).into_iter().map(|q| self.field.gap(q, arms).0).collect();
        all.sort_by(f64::total_cmp);
        let q: Vec<f64> = [20, 40, 100, 200, 400, 1000].map(|i| (all[i] * 1e4).round() / 10.0).to_vec();
        eprintln!("Q {q:?}");
        for q in p.apply(&fine.0) {
            let g = self.field.gap(q, arms).0;
            bins[(((g + 0.01) / 0.003).max(0.0) as usize).min(19)] += 1;
        }
        eprintln!("      {:?} {:?}", p.translation, bins);
    }

    /// Without those close to a better one.
    fn distinct(&self, ranked: Vec<Candidate>) -> Vec<Candidate> {
        let mut kept: Vec<Candidate> = Vec::new();
        for c in ranked {
            let is_new = |kept: &Candidate| {
                let (a, b) = (&kept.placement, &c.placement);
                (a.unit, a.up, a.turn_degrees) != (b.unit, b.up, b.turn_degrees)
                    || ((a.arm_angle_degrees - b.arm_angle_degrees).abs() > 8.0 && (kept.fit - c.fit).abs() > 0.5)
                    || (0..3).any(|k| (a.translation[k] - b.translation[k]).abs() > 0.02)
            };
            if kept.iter().all(is_new) {
                kept.push(c);
            }
        }
        kept
    }
}
