//! Finds the placement under which a garment wraps the body best.
//!
//! Every unit, up axis, facing, arm angle and origin is a hypothesis. Its cost is the mean distance of sample points of the
//! garment to the body, four times as much inside as outside, plus a share for the directions around the trunk in which there is
//! no cloth. A file made for this body (its origin at the pelvis or on the floor) is taken as it stands; otherwise the garment is
//! also moved to where it fits best.

use super::arm_pose::ArmPose;
use super::coverage::off_trunk;
use super::error::FitError;
use super::placement::{Origin, Placement, Unit, UpAxis};
use super::settings::FitSettings;
use super::sitting::Sitting;
use crate::asset::{Body, skeleton};
use crate::mesh::bounds;
use clothcombo_physics::query::Distance;
use clothcombo_physics::vec3::{add, cross, norm, scale, sub};
use rayon::prelude::*;

/// Arm angles tried first (degrees).
const ARM_ANGLES: [f64; 7] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0];

/// Costs in favour of the usual (m): a worse fit by this much is still preferred.
const FACING_PRIOR: f64 = 0.003;
const ARMS_PRIOR: f64 = 0.0008;

/// Arms are taken for level as long as lowered ones are not better by this factor.
const LEVEL_ARMS_PRIOR: f64 = 1.3;

/// Number of directions around the trunk.
const SECTORS: usize = 8;

/// Sample points of a garment in the file's coordinates, evenly over its area.
pub(super) struct Samples(Vec<[f64; 3]>);

impl Samples {
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]], count: usize) -> Self {
        let corners = |f: &[u32; 3]| f.map(|v| positions[v as usize]);
        let mut sum = 0.0;
        let cumulative: Vec<f64> = faces
            .iter()
            .map(|f| {
                let [a, b, c] = corners(f);
                sum += norm(cross(sub(b, a), sub(c, a)));
                sum
            })
            .collect();
        let points = (0..count)
            .map(|k| {
                let wanted = (k as f64 + 0.5) / count as f64 * sum;
                let face = cumulative.partition_point(|s| *s < wanted).min(faces.len() - 1);
                let [a, b, c] = corners(&faces[face]);
                // A low-discrepancy sequence folded into the triangle.
                let (u, v) = ((k as f64 * 0.754_877_666).fract(), (k as f64 * 0.569_840_291).fract());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                add(a, add(scale(sub(b, a), u), scale(sub(c, a), v)))
            })
            .collect();
        Self(points)
    }
}

/// The body as the search sees it.
pub(super) struct Search<'a> {
    body: &'a Body,
    pub arms: Vec<ArmPose>,
    trunk: Vec<[f64; 3]>,
    floor: f64,
    top: f64,
    /// Largest extent of the body (m).
    pub reach: f64,
}

impl<'a> Search<'a> {
    pub fn new(body: &'a Body, settings: &FitSettings) -> Self {
        let arms = ARM_ANGLES
            .into_par_iter()
            .filter(|degrees| match settings.arms_lowered {
                None => true,
                Some(lowered) => lowered == (*degrees != 0.0),
            })
            .map(|degrees| {
                let arm = ArmPose::new(body, degrees);
                arm.surface.closest_point();
                arm
            })
            .collect();
        let trunk = ["pelvis", "spine1", "spine2", "spine3"]
            .iter()
            .filter_map(|name| {
                let named = body.joint_names.iter().position(|n| n == name);
                named.or(skeleton::joint_index(name)).and_then(|j| body.joint_template.get(j)).copied()
            })
            .collect();
        let (low, high) = body.zero_body().bounds();
        let reach = body.zero_body().extent();
        Self { body, arms, trunk, floor: low[1], top: high[1], reach }
    }

    /// Whether a garment of this largest extent (m) can fit this body at all.
    pub fn is_plausible_extent(&self, extent: f64) -> bool {
        extent >= 0.07 * self.reach && extent <= 1.2 * self.reach
    }

    /// The best placement, and how the garment sits then. `extent`: largest extent of the file in its unit, plausible in at
    /// least one of the units allowed.
    pub fn best(
        &self,
        positions: &[[f64; 3]],
        faces: &[[u32; 3]],
        extent: f64,
        settings: &FitSettings,
    ) -> Result<(Placement, Sitting), FitError> {
        let coarse = Samples::new(positions, faces, 250);
        let fine = Samples::new(positions, faces, 1200);
        let units: Vec<Unit> = Unit::ALL
            .into_iter()
            .filter(|u| {
                settings.unit.is_none_or(|s| s == *u) && self.is_plausible_extent(extent * u.metres())
            })
            .collect();
        let ups: Vec<UpAxis> = settings.up.map_or(UpAxis::ALL.to_vec(), |up| vec![up]);
        let mut hypotheses = Vec::new();
        for &unit in &units {
            for &up in &ups {
                for facing_degrees in [0, 90, 180, 270] {
                    for arm in 0..self.arms.len() {
                        for origin in [Origin::Pelvis, Origin::Floor] {
                            let y = if origin == Origin::Floor { self.floor } else { 0.0 };
                            let placement = Placement {
                                unit,
                                up,
                                facing_degrees,
                                origin,
                                translation: [0.0, y, 0.0],
                                arm_angle_degrees: self.arms[arm].degrees,
                            };
                            hypotheses.push((placement, arm));
                        }
                    }
                }
            }
        }
        let (mut placement, mut arm, mut sitting) = self.pick(&hypotheses, &coarse, &fine);
        if !sitting.is_good() {
            if !sitting.is_around_trunk() {
                self.refuse_hats_and_shoes(&hypotheses, &coarse)?;
            }
            let (moved, moved_arm, moved_sitting) = self.moved(&hypotheses, &coarse, &fine);
            // The file's own origin is right more often than not; a garment that then sits well is better evidence.
            let clearly = if moved_sitting.is_good() { 0.8 } else { 0.7 };
            if moved_sitting.cost < clearly * sitting.cost - 0.005 {
                (placement, arm, sitting) = (moved, moved_arm, moved_sitting);
            }
        }
        if let Some(degrees) = self.arm_angle(&placement, &fine) {
            placement.arm_angle_degrees = degrees;
        }
        if placement.arm_angle_degrees != self.arms[arm].degrees {
            let arm = ArmPose::new(self.body, placement.arm_angle_degrees);
            sitting = self.judged(&placement, &arm, &fine).1;
        }
        Ok((placement, sitting))
    }

    /// What lies close to the body as it stands, but on head, feet or arms, must not be blown up until it goes around the trunk.
    fn refuse_hats_and_shoes(
        &self,
        hypotheses: &[(Placement, usize)],
        samples: &Samples,
    ) -> Result<(), FitError> {
        let snug = hypotheses
            .par_iter()
            .filter_map(|(placement, arm)| {
                let points = placement.apply(&samples.0);
                let place = off_trunk(&points, self.body)?;
                let sitting = self.sitting(&points, &self.arms[*arm]);
                (sitting.mean_distance < 0.04 && sitting.inside < 0.25).then_some(place)
            })
            .find_first(|_| true);
        snug.map_or(Ok(()), |place| Err(FitError::OffTrunk { place }))
    }

    /// Costs and numbers of the hypotheses, the best first.
    fn ranked(&self, hypotheses: &[(Placement, usize)], samples: &Samples) -> Vec<(f64, usize)> {
        let mut ranked: Vec<(f64, usize)> = hypotheses
            .par_iter()
            .enumerate()
            .map(|(i, (placement, arm))| (self.judged(placement, &self.arms[*arm], samples).0, i))
            .collect();
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ranked
    }

    /// Cheap costs first, careful ones for the best few.
    fn pick(
        &self,
        hypotheses: &[(Placement, usize)],
        coarse: &Samples,
        fine: &Samples,
    ) -> (Placement, usize, Sitting) {
        let ranked = self.ranked(hypotheses, coarse);
        let mut best: Option<(f64, usize, Sitting)> = None;
        for (_, i) in ranked.iter().take(6) {
            let (placement, arm) = &hypotheses[*i];
            let (judged, sitting) = self.judged(placement, &self.arms[*arm], fine);
            if best.is_none_or(|(b, ..)| judged < b) {
                best = Some((judged, *i, sitting));
            }
        }
        let (_, i, sitting) = best.unwrap_or((f64::MAX, 0, Sitting::default()));
        (hypotheses[i].0, hypotheses[i].1, sitting)
    }

    /// The best placement whose translation is free: the garment is centred and tried at several heights, then slid along the
    /// three axes as long as that helps.
    fn moved(
        &self,
        hypotheses: &[(Placement, usize)],
        coarse: &Samples,
        fine: &Samples,
    ) -> (Placement, usize, Sitting) {
        let heights = 16;
        let started: Vec<(Placement, usize)> = hypotheses
            .iter()
            .filter(|(p, _)| p.origin == Origin::Pelvis)
            .flat_map(|(placement, arm)| {
                let untranslated =
                    Placement { translation: [0.0; 3], origin: Origin::Elsewhere, ..*placement };
                let points = untranslated.apply(&coarse.0);
                let [low, high] = bounds(&points);
                let middle = |a: usize| 0.5 * (low[a] + high[a]);
                let (x, y, z) = (middle(0), high[1], middle(2));
                let trunk_z = self.trunk.iter().map(|p| p[2]).sum::<f64>() / self.trunk.len().max(1) as f64;
                (1..=heights).map(move |h| {
                    let top = self.floor + (self.top - self.floor) * f64::from(h) / f64::from(heights);
                    (Placement { translation: [-x, top - y, trunk_z - z], ..untranslated }, *arm)
                })
            })
            .collect();
        let mut ranked = self.ranked(&started, coarse);
        ranked.truncate(12);
        let slid: Vec<(Placement, usize)> = ranked
            .par_iter()
            .map(|(judged, i)| {
                let (mut placement, arm) = started[*i];
                let (mut best, mut step) = (*judged, 0.04);
                while step > 0.0008 {
                    let mut better = false;
                    for axis in [1, 2, 0] {
                        for sign in [-1.0, 1.0] {
                            let mut trial = placement;
                            trial.translation[axis] += sign * step;
                            let (judged, _) = self.judged(&trial, &self.arms[arm], coarse);
                            if judged < best {
                                (placement, best, better) = (trial, judged, true);
                            }
                        }
                    }
                    if !better {
                        step *= 0.5;
                    }
                }
                (placement, arm)
            })
            .collect();
        self.pick(&slid, fine, fine)
    }

    /// How far the arms hang, from the sleeves alone: the angle at which they lie around the arms most evenly, in the sense of the
    /// mean squared distance. Level arms if lowered ones are not clearly better, or if there are no sleeves; `None` if level arms
    /// are excluded and there are no sleeves to tell.
    fn arm_angle(&self, placement: &Placement, fine: &Samples) -> Option<f64> {
        let shoulder = self.body.joint_template.get(skeleton::joint_index("left_shoulder")?)?;
        let sleeves: Vec<[f64; 3]> = placement
            .apply(&fine.0)
            .into_iter()
            .filter(|p| p[0].abs() > shoulder[0].abs() + 0.03 && (p[1] - shoulder[1]).abs() < 0.35)
            .collect();
        let level = self.arms.iter().find(|a| a.degrees == 0.0);
        if sleeves.len() < fine.0.len() / 30 {
            return level.map(|_| 0.0);
        }
        let unevenness = |arm: &ArmPose| {
            let squared = |p: &[f64; 3]| {
                let gap = arm.surface.gap(*p, Distance::ClosestPoint).gap;
                if gap < 0.0 { 16.0 * gap * gap } else { gap * gap }
            };
            sleeves.iter().map(squared).sum::<f64>()
        };
        let costs: Vec<(f64, f64)> = self.arms.par_iter().map(|a| (unevenness(a), a.degrees)).collect();
        let (least, coarse) = costs.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        if coarse == 0.0 || level.is_some_and(|a| unevenness(a) < LEVEL_ARMS_PRIOR * least) {
            return Some(0.0);
        }
        // Golden-section search around it.
        let ratio = 0.618_034;
        let at = |degrees: f64| (unevenness(&ArmPose::new(self.body, degrees)), degrees);
        let (mut low, mut high) = (coarse - 9.0, coarse + 9.0);
        let (mut a, mut b) = (at(high - ratio * (high - low)), at(low + ratio * (high - low)));
        for _ in 0..6 {
            if a.0 < b.0 {
                high = b.1;
                b = a;
                a = at(high - ratio * (high - low));
            } else {
                low = a.1;
                a = b;
                b = at(low + ratio * (high - low));
            }
        }
        Some([a, b, (least, coarse)].into_iter().min_by(|x, y| x.0.total_cmp(&y.0))?.1)
    }

    /// Cost with the preferences for the usual, and what it was made of.
    fn judged(&self, placement: &Placement, arm: &ArmPose, samples: &Samples) -> (f64, Sitting) {
        let sitting = self.sitting(&placement.apply(&samples.0), arm);
        let facing = if placement.facing_degrees == 0 { 0.0 } else { FACING_PRIOR };
        let arms = if arm.degrees == 0.0 { 0.0 } else { ARMS_PRIOR };
        (sitting.cost + facing + arms, sitting)
    }

    /// Whether a garment sits well as it stands, on the body with the first of the arm angles.
    pub(super) fn sits_well(&self, samples: &Samples) -> bool {
        self.arms.first().is_some_and(|arm| self.sitting(&samples.0, arm).is_good())
    }

    fn sitting(&self, points: &[[f64; 3]], arm: &ArmPose) -> Sitting {
        let n = points.len().max(1) as f64;
        let mut sitting = Sitting::default();
        for p in points {
            let gap = arm.surface.gap(*p, Distance::ClosestPoint).gap;
            sitting.mean_distance += gap.abs() / n;
            sitting.inside += f64::from(u8::from(gap < 0.0)) / n;
            sitting.cost += if gap < 0.0 { (-4.0 * gap).min(0.6) } else { gap.min(0.4) } / n;
        }
        for centre in &self.trunk {
            let mut sectors = [false; SECTORS];
            for p in points.iter().filter(|p| (p[1] - centre[1]).abs() < 0.08) {
                let turn = (p[0] - centre[0]).atan2(p[2] - centre[2]) / std::f64::consts::TAU;
                sectors[((turn.rem_euclid(1.0) * SECTORS as f64) as usize).min(SECTORS - 1)] = true;
            }
            let share = sectors.iter().filter(|s| **s).count() as f64 / SECTORS as f64;
            sitting.wrap = sitting.wrap.max(share);
        }
        sitting.cost += 0.2 * (1.0 - sitting.wrap);
        sitting
    }
}
