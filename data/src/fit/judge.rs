//! What speaks for a placement: a log-posterior.
//!
//! It sums how likely the gaps between cloth and body are for clothes that are worn
//! ([`likelihood`](super::likelihood)), how usual such a file is ([`Placement::log_prior`]), how its upper rim lies,
//! and whether limbs pass through openings instead of cloth ([`anatomy`](super::anatomy)).

use super::anatomy::{Opening, Skeleton};
use super::body_field::{ArmTurn, BodyField};
use super::cloth::Cloth;
use super::likelihood::{log_likelihood, rough_log_likelihood};
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
const CROSSING: f64 = 8.0;
/// Clothes are as wide on the left as on the right within this (m), or at least at no more than this cost.
const SYMMETRY: f64 = 0.02;
const ASYMMETRY_COST: f64 = 8.0;
/// A border deeper inside the body than this (m), for a larger share of its length, goes around nothing.
const DEPTH: f64 = 0.012;
const SHARE: f64 = 0.25;

/// A placement and what speaks for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub placement: Placement,
    /// Log-likelihood of the gaps.
    pub fit: f64,
    /// Log-posterior up to a constant.
    pub score: f64,
    /// Bones that pass through cloth.
    pub crossings: usize,
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
}

/// A border of a placed garment.
struct Border {
    /// What it goes around; one that runs through the body goes around nothing.
    opening: Opening,
    /// What is linked with it, also if it runs through the body.
    linked: Opening,
    /// Mean height (m).
    height: f64,
}

/// Which limbs pass through openings of their own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Limbs {
    pub neck: bool,
    /// Both.
    pub arms: bool,
    /// Both.
    pub legs: bool,
}

impl Limbs {
    fn new(openings: &[Border]) -> Self {
        let has = |wanted: Opening| openings.iter().any(|b| b.opening == wanted);
        Self {
            neck: has(Opening::Neck),
            arms: has(Opening::LeftArm) && has(Opening::RightArm),
            legs: has(Opening::LeftLeg) && has(Opening::RightLeg),
        }
    }
}

/// Judges placements of one garment on one body.
#[derive(Clone, Copy)]
pub(super) struct Judge<'a> {
    pub field: &'a BodyField,
    pub skeleton: &'a Skeleton,
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
        let points = untranslated.apply(&samples.0);
        let rim = rim.map_or(Vec::new(), |border| untranslated.apply(&self.cloth.border_points(border)));
        let end = |pick: fn(f64, f64) -> f64, start| points.iter().map(|p| p[0]).fold(start, pick);
        let middle = 0.5 * (end(f64::min, f64::MAX) + end(f64::max, f64::MIN));
        Turned { points, rim, middle }
    }

    /// By the blunt likelihood, in which a garment some centimetres from its place still counts, or by the sharp one. Openings
    /// are taken from `like`.
    pub fn scored(
        &self,
        placement: Placement,
        turned: &Turned,
        is_sharp: bool,
        like: Option<&Candidate>,
    ) -> Candidate {
        let (arms, t) = (ArmTurn::new(placement.arm_angle_degrees), placement.translation);
        let gaps = turned.points.iter().map(|p| self.field.gap(add(*p, t), arms));
        let fit = match is_sharp {
            true => log_likelihood(gaps, EVIDENCE),
            false => rough_log_likelihood(gaps, EVIDENCE),
        };
        let aside = (turned.middle + t[0]) / SYMMETRY;
        let symmetry = if is_sharp { (0.5 * aside * aside).min(ASYMMETRY_COST) } else { 0.0 };
        let score =
            fit + placement.log_prior(self.settings) - symmetry + self.rim_score(&turned.rim, &placement);
        let unknown = Candidate {
            placement,
            fit,
            score,
            crossings: 0,
            rim: None,
            is_worn: true,
            worn_pieces: 1,
            neck_over_hem: 0.0,
            is_tube: false,
            rim_distance: 0.0,
        };
        Candidate { placement, fit, score, ..like.copied().unwrap_or(unknown) }
    }

    /// What speaks for the upper rim: it lies on the body, all around, at the waist or above the chest.
    fn rim_score(&self, rim: &[[f64; 3]], placement: &Placement) -> f64 {
        if rim.is_empty() {
            return 0.0;
        }
        let (arms, t) = (ArmTurn::new(placement.arm_angle_degrees), placement.translation);
        let height = rim.iter().map(|p| p[1]).sum::<f64>() / rim.len() as f64 + t[1];
        let gaps = rim.iter().map(|p| (self.field.gap(add(*p, t), arms).0, 0));
        log_likelihood(gaps, RIM_EVIDENCE) + self.rim_prior(height)
    }

    /// Logarithm of the density of an upper rim's height over that of a height anywhere on hips or chest.
    fn rim_prior(&self, height: f64) -> f64 {
        /// Shares of rims at the waist and above the chest.
        const USUAL: [f64; 2] = [0.6, 0.35];
        /// Density anywhere else, and anywhere on hips or chest (1/m).
        const ELSEWHERE: f64 = 0.02;
        const UNIFORM: f64 = 5.0;
        let normal = |middle: f64, spread: f64| {
            (-0.5 * ((height - middle) / spread).powi(2)).exp() / (spread * std::f64::consts::TAU.sqrt())
        };
        let shares = match self.settings.category {
            None => USUAL,
            Some(Category::Skirt | Category::Trousers) => [1.0, 0.0],
            Some(_) => [0.0, 1.0],
        };
        let levels = self.field.levels;
        let density =
            shares[0] * normal(levels.waist - 0.03, 0.035) + shares[1] * normal(levels.armpit - 0.035, 0.03);
        (density + ELSEWHERE).ln() - UNIFORM.ln()
    }

    /// The borders of a placed garment.
    fn openings(&self, placement: &Placement) -> Vec<Border> {
        let arms = ArmTurn::new(placement.arm_angle_degrees);
        let of_border = |border: usize| {
            let points = placement.apply(&self.cloth.border(border));
            let count = points.len().max(1) as f64;
            let inside = points.iter().filter(|p| self.field.is_inside(**p, arms, DEPTH)).count();
            let linked = self.skeleton.opening(&points, arms);
            Border {
                opening: if inside as f64 > SHARE * count { Opening::Nothing } else { linked },
                linked,
                height: points.iter().map(|p| p[1]).sum::<f64>() / count,
            }
        };
        (0..self.cloth.borders.len()).map(of_border).collect()
    }

    /// Which limbs pass through openings of their own.
    pub fn limbs(&self, placement: &Placement) -> Limbs {
        Limbs::new(&self.openings(placement))
    }

    /// Whether limbs pass through its openings, and which rim it hangs from; the candidate's score does not count that yet.
    pub fn with_openings(&self, mut candidate: Candidate) -> Candidate {
        let openings = self.openings(&candidate.placement);
        let count = |wanted: Opening| openings.iter().filter(|b| b.opening == wanted).count();
        let has = |wanted: Opening| count(wanted) > 0;
        let limbs = [
            Opening::Neck,
            Opening::LeftArm,
            Opening::RightArm,
            Opening::LeftLeg,
            Opening::RightLeg,
            Opening::Several,
        ];
        // Two sleeves that are not one piece are socks, and a tube with no other opening has no room for head and legs.
        let piece =
            |wanted: Opening| openings.iter().position(|b| b.opening == wanted).map(|b| self.cloth.piece(b));
        let arms = openings.len() > 2
            && has(Opening::LeftArm)
            && piece(Opening::LeftArm) == piece(Opening::RightArm);
        let goes_around = |trunk: usize, has: &dyn Fn(Opening) -> bool| {
            trunk >= 2 || (trunk > 0 && limbs.into_iter().any(has))
        };
        let is_around = goes_around(count(Opening::Trunk), &has) || arms;
        // Only sleeves and armholes tell how arms hang.
        let is_worn = is_around && (arms || candidate.placement.arm_angle_degrees == 0.0);
        if !is_worn {
            candidate.score -= UNWORN;
        }
        candidate.is_worn = is_worn;
        let mut pieces: Vec<u32> = (0..openings.len()).map(|border| self.cloth.piece(border)).collect();
        pieces.sort_unstable();
        pieces.dedup();
        let is_worn_alone = |piece: &u32| {
            let own = openings.iter().enumerate().filter(|(b, _)| self.cloth.piece(*b) == *piece);
            let own: Vec<Opening> = own.map(|(_, border)| border.opening).collect();
            let trunk = own.iter().filter(|o| **o == Opening::Trunk).count();
            goes_around(trunk, &|wanted| own.contains(&wanted))
        };
        candidate.worn_pieces = pieces.iter().filter(|p| is_worn_alone(p)).count();
        let longest = |wanted: Opening| {
            let of = openings.iter().zip(&self.cloth.border_lengths).filter(|(b, _)| b.linked == wanted);
            of.map(|(_, length)| *length).fold(0.0, f64::max)
        };
        let hem = longest(Opening::Trunk);
        candidate.neck_over_hem = if hem > 0.0 { longest(Opening::Neck) / hem } else { 0.0 };
        candidate.is_tube = count(Opening::Trunk) == 2 && !limbs.into_iter().any(has);
        candidate.rim = None;
        if !has(Opening::Neck) && !arms {
            let trunk = openings.iter().enumerate().filter(|(_, b)| b.opening == Opening::Trunk);
            candidate.rim = trunk.max_by(|a, b| a.1.height.total_cmp(&b.1.height)).map(|(border, _)| border);
        }
        candidate
    }

    /// Whether bones pass through its cloth.
    pub fn with_crossings(&self, mut candidate: Candidate) -> Candidate {
        let arms = ArmTurn::new(candidate.placement.arm_angle_degrees);
        let placed = candidate.placement.apply(self.cloth.positions);
        candidate.crossings = self.skeleton.crossings(&placed, self.cloth.faces, arms);
        candidate.score -= CROSSING * candidate.crossings as f64;
        candidate
    }

    /// A placement as it stands, by everything.
    pub fn judged(&self, placement: Placement) -> Candidate {
        let openings =
            self.with_openings(self.scored(placement, &self.turned(&placement, None, true), true, None));
        let turned = self.turned(&placement, openings.rim, true);
        let scored = self.scored(placement, &turned, true, Some(&openings));
        let score = scored.score - if openings.is_worn { 0.0 } else { UNWORN };
        let (arms, t) = (ArmTurn::new(placement.arm_angle_degrees), placement.translation);
        let distances = turned.rim.iter().map(|p| self.field.gap(add(*p, t), arms).0.abs());
        let rim_distance = distances.sum::<f64>() / turned.rim.len().max(1) as f64;
        self.with_crossings(Candidate { score, rim_distance, ..scored })
    }
}
