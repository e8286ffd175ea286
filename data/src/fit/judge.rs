//! What speaks for a placement: a log-posterior.
//!
//! It sums how likely the gaps between cloth and body are for clothes that are worn
//! ([`likelihood`](super::likelihood)), how usual such a file is ([`FitSettings::log_prior`]), how its upper rim lies,
//! and whether limbs pass through openings instead of cloth ([`anatomy`](super::anatomy)).

use super::anatomy::{BodySkeleton, PiercingBones};
use super::body_field::{BodyField, LimbTurn};
use super::cloth::Cloth;
use super::likelihood::{log_likelihood, normal_density, rough_log_likelihood};
use super::placement::Placement;
use super::settings::FitSettings;
use crate::asset::Category;
use clothcombo_physics::vec3::add;

/// Independent samples a garment is worth, and its upper rim: neighbouring cloth lies alike.
const EVIDENCE: f64 = 40.0;
const RIM_EVIDENCE: f64 = 8.0;
/// Log-prior against a garment through whose openings no limbs pass: it decides against any that fits otherwise.
pub(super) const UNWORN: f64 = 150.0;
/// Log-prior against a bone that passes through cloth.
const PIERCED: f64 = 8.0;
/// Log-prior against an opening through which nothing passes.
const IDLE: f64 = 8.0;
/// A neckline lower by this (m) in front than behind, or the other way round, shows where the front is; log-odds of that.
const NECK_DROP: f64 = 0.01;
const NECKLINE: f64 = 3.0;
/// Log-prior against half a turn of a garment whose neckline does not show that: files have their front in front.
const BACK_TO_FRONT: f64 = 25.0;
/// Clothes are as wide on the left as on the right within this (m), or at least at no more than this cost.
const SYMMETRY: f64 = 0.02;
const ASYMMETRY_COST: f64 = 8.0;

/// A placement and what speaks for it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Candidate {
    pub placement: Placement,
    /// Log-likelihood of the gaps.
    pub fit: f64,
    /// Log-posterior up to a constant.
    pub score: f64,
    /// Bones that pass through cloth.
    pub piercing: PiercingBones,
    /// The border that is its upper rim, if the garment hangs from one.
    pub rim: Option<usize>,
    /// Whether limbs pass through its openings as through those of clothes.
    pub is_worn: bool,
    /// Connected pieces that would be worn without the others.
    pub worn_pieces: usize,
    /// Length of the longest border around the neck over that of the longest around the trunk; 0 if there are not both.
    pub neck_over_hem: f64,
    /// Whether it is a tube around the trunk with no other opening: a skirt or a strapless top.
    pub is_tube: bool,
    /// Mean distance of the upper rim to the body (m), 0 without one.
    pub rim_distance: f64,
    /// Openings wide enough for a limb through which none passes.
    pub idle_openings: usize,
    /// How much lower the cloth ends in front of the neck than behind it (m); none of a garment without neck or armholes.
    pub neck_drop: Option<f64>,
    /// Whether it is turned by 180° though its neckline does not show that.
    pub is_unfounded_turn: bool,
}

impl Candidate {
    /// One of which nothing else is known.
    pub fn at(placement: Placement) -> Self {
        Self { placement, ..Self::default() }
    }
}

/// Judges placements of one garment on one body.
#[derive(Clone)]
pub(super) struct Judge<'a> {
    pub field: BodyField,
    pub skeleton: &'a BodySkeleton,
    pub cloth: &'a Cloth<'a>,
    pub settings: &'a FitSettings,
}

/// Points scaled and turned, but not translated.
pub(super) struct Turned {
    pub points: Vec<[f64; 3]>,
    pub rim: Vec<[f64; 3]>,
    /// Middle between left and right (m).
    middle: f64,
}

impl Judge<'_> {
    /// The sample points under a placement's scale and turn, with the rim of its border.
    pub fn turned(&self, placement: &Placement, rim: Option<usize>, is_fine: bool) -> Turned {
        let untranslated = Placement { translation: [0.0; 3], ..*placement };
        let samples = if is_fine { &self.cloth.fine } else { &self.cloth.coarse };
        let points = untranslated.apply(samples);
        let rim = rim.map_or(Vec::new(), |border| untranslated.apply(&self.cloth.border_points(border)));
        let end = |pick: fn(f64, f64) -> f64, start| points.iter().map(|p| p[0]).fold(start, pick);
        let middle = 0.5 * (end(f64::min, f64::MAX) + end(f64::max, f64::MIN));
        Turned { points, rim, middle }
    }

    /// A candidate scored anew: by the blunt likelihood, in which a garment some centimetres from its place still counts, or by the
    /// sharp one.
    pub fn scored(&self, candidate: Candidate, turned: &Turned, is_sharp: bool) -> Candidate {
        let placement = candidate.placement;
        let (turn, t) = (LimbTurn::of(&placement), placement.translation);
        let gaps = turned.points.iter().map(|p| self.field.gap(add(*p, t), turn));
        let fit = match is_sharp {
            true => log_likelihood(gaps, EVIDENCE),
            false => rough_log_likelihood(gaps, EVIDENCE),
        };
        let aside = (turned.middle + t[0]) / SYMMETRY;
        let symmetry = if is_sharp { (0.5 * aside * aside).min(ASYMMETRY_COST) } else { 0.0 };
        let score =
            fit + self.settings.log_prior(&placement) - symmetry + self.rim_score(&turned.rim, &placement);
        Candidate { fit, score, ..candidate }
    }

    /// What speaks for the upper rim: it lies on the body, all around, at the waist or above the chest.
    fn rim_score(&self, rim: &[[f64; 3]], placement: &Placement) -> f64 {
        if rim.is_empty() {
            return 0.0;
        }
        let (turn, t) = (LimbTurn::of(placement), placement.translation);
        let height = rim.iter().map(|p| p[1]).sum::<f64>() / rim.len() as f64 + t[1];
        let gaps = rim.iter().map(|p| (self.field.gap(add(*p, t), turn).0, 0));
        log_likelihood(gaps, RIM_EVIDENCE) + self.rim_prior(height)
    }

    /// Logarithm of the density of an upper rim's height over that of a height anywhere on hips or chest.
    fn rim_prior(&self, height: f64) -> f64 {
        /// Shares of rims at the waist and above the chest.
        const RIM_SHARES: [f64; 2] = [0.6, 0.35];
        /// Density anywhere else, and anywhere on hips or chest (1/m).
        const ELSEWHERE: f64 = 0.02;
        const UNIFORM: f64 = 5.0;
        let shares = match self.settings.category {
            None => RIM_SHARES,
            Some(Category::Skirt | Category::Trousers) => [1.0, 0.0],
            Some(_) => [0.0, 1.0],
        };
        let levels = self.field.levels;
        // Waistbands sit 3 cm below the waist, strapless tops 3.5 cm below the armpits, give or take as much.
        let waistband = normal_density(height, levels.waist - 0.03, 0.035);
        let strapless = normal_density(height, levels.armpit - 0.035, 0.03);
        let density = shares[0] * waistband + shares[1] * strapless;
        (density + ELSEWHERE).ln() - UNIFORM.ln()
    }

    /// A placement as it stands, by everything.
    pub fn judged(&self, placement: Placement) -> Candidate {
        let turned = self.turned(&placement, None, true);
        let openings = self.with_openings(self.scored(Candidate::at(placement), &turned, true));
        let turned = self.turned(&placement, openings.rim, true);
        let scored = self.scored(openings, &turned, true);
        let (turn, t) = (LimbTurn::of(&placement), placement.translation);
        let distances = turned.rim.iter().map(|p| self.field.gap(add(*p, t), turn).0.abs());
        let rim_distance = distances.sum::<f64>() / turned.rim.len().max(1) as f64;
        let placed = placement.apply(self.cloth.positions);
        let piercing = self.skeleton.piercing(&placed, self.cloth.faces, turn);
        let shown = self.shown_front(&scored);
        let is_turned = self.settings.turn_degrees.is_none() && placement.turn_degrees == 180.0;
        let is_unfounded_turn = is_turned && scored.neck_drop.is_some() && shown < 1.0;
        let against = if scored.is_worn { 0.0 } else { UNWORN }
            + PIERCED * (piercing.arms + piercing.others) as f64
            + IDLE * scored.idle_openings as f64
            + if is_unfounded_turn { BACK_TO_FRONT } else { 0.0 }
            - NECKLINE * shown;
        let score = scored.score - against;
        Candidate { score, rim_distance, piercing, is_unfounded_turn, ..scored }
    }

    /// Whether the neckline shows the front where it is, from -1 to 1.
    fn shown_front(&self, candidate: &Candidate) -> f64 {
        candidate.neck_drop.map_or(0.0, |drop| (drop / NECK_DROP).clamp(-1.0, 1.0))
    }
}
