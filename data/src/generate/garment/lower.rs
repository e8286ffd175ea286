//! Cutting what hangs from the waist: skirts and trousers.

use super::design::{SkirtDesign, TrousersDesign};
use super::pattern::{Column, Pattern, Pleats, column_bounds, flared, gathered, height, level};

pub(super) fn cut_skirt(pattern: &mut Pattern, design: &SkirtDesign, edge_length: f64, sag: f64) {
    let mark = &pattern.fit.landmarks;
    let low = mark.waist - 0.35 * (mark.waist - mark.hip);
    let waist = low + (mark.waist + 0.01 - low) * design.rise;
    let hem = height(mark, design.length).min(mark.crotch - 0.06);
    let from = mark.waist - 0.03;
    let flare = design.skirt.flare;
    let tube = (pattern.fit.column.clone())
        .hang(mark.waist, |_| design.hang)
        .map(|y, _, r| r + design.ease + sag + flared(flare, from, y));
    let pleats = Pleats::new(&design.skirt, &tube, waist.min(from), hem, edge_length);
    pattern.bounds = column_bounds(&tube, hem - 0.05, waist + 0.05);
    pattern.column = Some(Column { tube, pleats, top: waist + 0.10, bottom: f64::MIN });
    pattern.cuts = vec![level(waist, -1.0, design.rim_tilt), level(hem, 1.0, design.hem_tilt)];
    pattern.openings = 2;
}

pub(super) fn cut_trousers(pattern: &mut Pattern, design: &TrousersDesign, sag: f64) {
    let mark = pattern.fit.landmarks;
    let low = mark.waist - 0.5 * (mark.waist - mark.hip);
    let waist = low + (mark.waist + 0.01 - low) * design.rise;
    let hem = height(&mark, design.length).min(mark.crotch - design.drop - 0.055);
    let tube = pattern.fit.column.clone().hang(mark.waist, |_| 0.5).map(|_, _, r| r + design.ease + sag);
    pattern.bounds = column_bounds(&tube, hem - 0.05, waist + 0.05);
    pattern.bounds[0][0] -= 0.06;
    pattern.bounds[1][0] += 0.06;
    pattern.column =
        Some(Column { tube, pleats: None, top: waist + 0.10, bottom: mark.crotch - design.drop });
    pattern.leg_top = mark.crotch + 0.05;
    let run = mark.knee - mark.ankle;
    pattern.trouser_legs = Some(std::array::from_fn(|side| {
        let limb = &pattern.fit.legs[side];
        let leg = limb.clone().hang(mark.crotch, |_| design.hang).map(|y, _, r| {
            r + design.leg_ease + sag + (design.flare * (mark.knee - y) / run).clamp(-0.004, 0.08)
        });
        leg.map_with(limb, |y, r, limb| gathered(r, limb, design.cuff, y - hem, sag))
    }));
    pattern.cuts = vec![level(waist, -1.0, design.rim_tilt), level(hem, 1.0, 0.0)];
    pattern.openings = 3;
}
