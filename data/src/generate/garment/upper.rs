//! Cutting what hangs from the shoulders or the chest.

use super::super::field::{smooth_min, smooth_step};
use super::design::{Front, Neckline, SleeveDesign, UpperDesign};
use super::pattern::{Column, Cut, Pattern, Pleats, column_bounds, flared, gathered, height, level};
use super::tube::Tube;
use crate::asset::Category;

pub(super) fn cut(pattern: &mut Pattern, design: &UpperDesign, edge_length: f64, sag: f64) {
    let fit = pattern.fit;
    let mark = fit.landmarks;
    let is_dress = design.category == Category::Dress;
    let hem = match is_dress {
        true => height(&mark, design.length).min(mark.crotch - 0.07),
        false => height(&mark, design.length),
    };
    let loose = design.looseness;
    let ease = 0.007 + 0.022 * loose + sag;
    let hang_above = if is_dress { 0.7 * loose } else { loose };
    let from = if is_dress { mark.waist } else { mark.waist + 0.5 * (mark.armpit - mark.hip) };
    let tube = (fit.column.clone())
        .hang(mark.armpit - 0.02, |y| {
            hang_above + (design.hang - hang_above) * smooth_step(mark.waist + 0.04, mark.waist - 0.06, y)
        })
        .map(|y, _, r| {
            let ease = ease * smooth_step(mark.armpit + 0.06, mark.armpit - 0.04, y).max(0.3);
            r + ease + flared(design.skirt.flare, from, y)
        });
    pattern.clearance += 0.001 + 0.008 * loose;

    let shoulder_x = mark.shoulder[0];
    let mut reach = shoulder_x + 0.04;
    let (top, throat) = match design.neckline {
        Neckline::Strapless { drop, tilt } => {
            let edge = mark.armpit - drop;
            pattern.cuts.push(level(edge, -1.0, tilt));
            pattern.openings = 2;
            (edge + 0.06, edge)
        }
        Neckline::Neck { armhole, armhole_drop, .. } => {
            let armhole = shoulder_x * armhole;
            let (top, throat) = cut_neck(pattern, &design.neckline, armhole, edge_length);
            pattern.openings = 4;
            match &design.sleeves {
                Some(sleeves) => reach = cut_sleeves(pattern, sleeves, loose, sag) + 0.06,
                None => cut_armholes(pattern, armhole, armhole_drop, ease),
            }
            (top, throat)
        }
    };
    let middle = fit.column.centre(mark.waist)[0] - 0.02;
    match design.front {
        Front::Closed => {}
        Front::Placket { length, half_width } => {
            pattern.cuts.push(placket(throat, length, half_width, hem, middle, edge_length));
        }
        Front::Open { gap, widening } => {
            let height = mark.neck[1];
            pattern.cuts.push(Box::new(move |p| {
                let open = gap + widening * (height - p[1]).max(0.0);
                (p[0].abs() - open).max(middle - p[2])
            }));
            pattern.openings -= 1;
        }
    }
    pattern.bounds = column_bounds(&tube, hem - 0.05, top);
    pattern.bounds[0][0] = pattern.bounds[0][0].min(-reach);
    pattern.bounds[1][0] = pattern.bounds[1][0].max(reach);
    pattern.bounds[0][2] = pattern.bounds[0][2].min(-0.16 + mark.shoulder[2]);
    pattern.bounds[1][2] = pattern.bounds[1][2].max(0.10 + mark.shoulder[2]);
    let pleats = Pleats::new(&design.skirt, &tube, from, hem, edge_length);
    pattern.column = Some(Column { tube, pleats, top: mark.armpit + 0.03, bottom: f64::MIN });
    pattern.cuts.push(level(hem, 1.0, design.hem_tilt));
}

/// The neckline. Returns the top of the garment and the height of the neckline's lowest point in front (m).
fn cut_neck(pattern: &mut Pattern, neckline: &Neckline, armhole: f64, edge_length: f64) -> (f64, f64) {
    let Neckline::Neck { width, depth, depth_back, power, .. } = *neckline else {
        return (0.0, 0.0);
    };
    let fit = pattern.fit;
    let mark = fit.landmarks;
    // A strap needs three edges of width.
    let strap = (3.0 * edge_length).max(0.035);
    let half_width = (mark.neck_width + width).min(armhole - strap).max(mark.neck_width + 0.015);
    // Bodies put the neck joint at different heights: the slope of the shoulders tells where the neck begins.
    let base = fit.shoulder_height(0.42 * mark.shoulder[0]).min(mark.neck[1] + 0.02);
    let side = fit.shoulder_height(half_width).min(base) + pattern.clearance;
    let front = base - 0.03 - depth;
    let back = base + 0.012 - depth_back;
    let middle = mark.neck[2];
    pattern.cuts.push(Box::new(move |p| {
        let bottom = back + (front - back) * smooth_step(middle - 0.05, middle + 0.06, p[2]);
        let across = (p[0] * p[0] + 1e-4).sqrt() / half_width;
        let rise = across.powf(power) * (side - bottom) + bottom - p[1];
        // Nothing climbs the neck above the side of the neckline.
        let rise = rise.min(side + 0.004 - p[1]);
        // Scaled towards a distance where the curve is steep.
        rise / (1.0 + power * across.min(2.0).powf(power - 1.0) * (side - bottom).max(0.0) / half_width)
    }));
    (side + 0.06, front)
}

/// Sleeves and their ends. Returns the distance of the ends from the middle (m).
fn cut_sleeves(pattern: &mut Pattern, design: &SleeveDesign, loose: f64, sag: f64) -> f64 {
    let fit = pattern.fit;
    let mark = fit.landmarks;
    let shoulder_x = mark.shoulder[0];
    let end = shoulder_x + design.length * (mark.wrist - shoulder_x);
    let ease = 0.006 + 0.016 * loose + design.ease + sag;
    for (side, arm) in [1.0, -1.0].into_iter().zip(&fit.arms) {
        // Widest so far along the arm, the same for every direction: sleeves are round.
        let mut widest = f64::MIN;
        let tube: Tube = arm.clone().map(|s, a, r| {
            if a == 0.0 {
                widest = widest.max(if s > shoulder_x + 0.03 { r * 0.8 } else { 0.0 });
            }
            let along = ((s - shoulder_x) / (end - shoulder_x).max(0.05)).clamp(0.0, 1.0);
            // Fades out over the shoulder, which would otherwise carry a puff.
            let out = smooth_step(shoulder_x - 0.03, shoulder_x + 0.09, s);
            let round = r + out * design.hang * (widest - r).max(0.0);
            let armhole = design.armhole * smooth_step(shoulder_x + 0.10, shoulder_x, s);
            round + (1.4 * out - 0.4) * ease + design.flare * along + out * armhole
        });
        let tube = tube.map_with(arm, |s, r, limb| gathered(r, limb, design.cuff, end - s, sag));
        pattern.sleeves.push((tube, side));
        let (height, tilt) = (mark.shoulder[1], design.tilt);
        pattern.cuts.push(Box::new(move |p| end + tilt * (p[1] - height) - side * p[0]));
    }
    end
}

/// Armholes without sleeves: from the shoulder down and out to the armpit.
fn cut_armholes(pattern: &mut Pattern, armhole: f64, drop: f64, ease: f64) {
    let fit = pattern.fit;
    let bottom = fit.landmarks.armpit - pattern.clearance - drop;
    let out = fit.column.radius(bottom, 0.0, 1.0).max(armhole) + ease - 0.02;
    let height = fit.shoulder_height(armhole) - bottom;
    for side in [1.0, -1.0] {
        pattern.cuts.push(Box::new(move |p| {
            let down = ((bottom + height - p[1]) / height).max(0.0);
            let along = armhole + (out - armhole) * down.powi(2) - side * p[0];
            // Kept: inside of the line, or below the armhole; the corner between them is rounded.
            -smooth_min(-along, p[1] - bottom, 0.05)
        }));
    }
}

/// A slit down from the throat, round at its lower end.
fn placket(throat: f64, length: f64, half_width: f64, hem: f64, middle: f64, edge_length: f64) -> Cut {
    // The lattice must see the slit, and some cloth must be left below it.
    let half_width = half_width.max(0.45 * edge_length);
    let bottom = (throat - length.max(3.0 * edge_length)).max(hem + 0.05 + 2.0 * edge_length);
    Box::new(move |p| {
        // Negative inside the slit; the corner at its lower end is rounded.
        let slit = -smooth_min(half_width - p[0].abs(), p[1] - bottom, 2.0 * half_width);
        slit.max(middle - p[2])
    })
}
