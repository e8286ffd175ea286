//! Random designs: a category and a seed become a solid around the body and the cuts that open it.

use super::super::field::{smooth_min, smooth_step};
use super::fit::BodyFit;
use super::tube::Tube;
use crate::asset::Category;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Keeps the part where the field is not negative [m, distance-like].
type Cut = Box<dyn Fn([f64; 3]) -> f64 + Send + Sync>;

/// A garment before it is meshed.
pub(super) struct Pattern<'a> {
    fit: &'a BodyFit,
    column: Option<Column>,
    sleeves: Vec<(Tube, f64)>,
    trouser_legs: Option<[Tube; 2]>,
    leg_top: f64,
    /// Distance the cloth keeps from the skin where no tube is wider [m].
    clearance: f64,
    /// The curves along which the solid is opened; cut `i` has the label bit `1 << i`.
    pub cuts: Vec<Cut>,
    /// Number of closed boundary curves the finished garment must have.
    pub openings: usize,
    /// A box around everything that the cuts keep.
    pub bounds: [[f64; 3]; 2],
}

struct Column {
    tube: Tube,
    top: f64,
    bottom: f64,
}

/// Half the width of the gap between trouser legs [m].
const LEG_GAP: f64 = 0.007;

impl Pattern<'_> {
    /// The solid whose surface is the cloth: negative inside [m].
    pub fn field(&self, p: [f64; 3]) -> f64 {
        let mut f = self.fit.distance.distance(p) - self.clearance;
        if let Some(column) = &self.column {
            let side = column.tube.value(p);
            let ends = (p[1] - column.top).max(column.bottom - p[1]);
            f = smooth_min(f, -smooth_min(-side, -ends, 0.04), 0.03);
        }
        for (tube, side) in &self.sleeves {
            let x = side * p[0];
            let inner = self.fit.landmarks.shoulder[0] - 0.02 - x;
            if inner < 0.08 {
                f = smooth_min(f, tube.value(p).max(inner), 0.04);
            }
        }
        if let Some(legs) = &self.trouser_legs
            && p[1] < self.leg_top + 0.08
        {
            let leg = &legs[usize::from(p[0] < 0.0)];
            // Walls on both sides of the middle keep the legs two tubes however wide they are.
            let f_leg = leg.value(p).max(LEG_GAP - p[0].abs()).max(p[1] - self.leg_top);
            f = smooth_min(f, f_leg, 0.03);
        }
        f
    }
}

fn choose(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    if high > low { rng.random_range(low..high) } else { low }
}

/// Below the trunk: how the outline leaves the body.
struct Hem {
    from: f64,
    to: f64,
    flare: f64,
    folds: f64,
    depth: f64,
    phase: f64,
}

impl Hem {
    fn random(rng: &mut ChaCha8Rng, from: f64, to: f64, most: f64) -> Self {
        let flare = choose(rng, 0.0, 1.0).powi(2) * most;
        let depth = if rng.random_bool(0.5) { choose(rng, 0.0, 0.05) * flare.min(0.4) } else { 0.0 };
        Self {
            from,
            to,
            flare,
            folds: f64::from(rng.random_range(5..11u32)),
            depth,
            phase: choose(rng, 0.0, TAU),
        }
    }

    /// Extra radius at height `y` and angle `a`.
    fn extra(&self, y: f64, a: f64) -> f64 {
        let below = (self.from - y).max(0.0);
        // Starts tangentially so that there is no crease at the waist.
        let run = below * below / (below + 0.06);
        let share = ((self.from - y) / (self.from - self.to).max(0.05)).clamp(0.0, 1.0);
        self.flare * run + self.depth * share * (self.folds * a + self.phase).cos()
    }
}

/// A design for `category`; `edge_length` [m] is what the mesh will have, which seams and straps have to respect.
pub(super) fn design<'a>(
    fit: &'a BodyFit,
    category: Category,
    rng: &mut ChaCha8Rng,
    edge_length: f64,
    clearance: f64,
) -> Pattern<'a> {
    let mark = fit.landmarks;
    let sag = edge_length * edge_length / (8.0 * 0.05);
    let mut pattern = Pattern {
        fit,
        column: None,
        sleeves: Vec::new(),
        trouser_legs: None,
        leg_top: 0.0,
        clearance: clearance + sag,
        cuts: Vec::new(),
        openings: 0,
        bounds: [[0.0; 3]; 2],
    };
    match category {
        Category::Trousers => trousers(&mut pattern, rng, sag),
        Category::Skirt => skirt(&mut pattern, rng, sag),
        Category::Dress | Category::Top | Category::TShirt | Category::OpenShirt => {
            upper(&mut pattern, category, rng, edge_length, sag);
        }
    }
    debug_assert!(mark.crotch < mark.waist);
    pattern
}

/// A nearly level cut that keeps what is above (`sign` 1) or below (−1).
fn level(rng: &mut ChaCha8Rng, height: f64, sign: f64, most_tilt: f64) -> Cut {
    let tilt = choose(rng, -most_tilt, most_tilt);
    Box::new(move |p| sign * (p[1] - height - tilt * p[2]))
}

fn column_bounds(tube: &Tube, low: f64, high: f64) -> [[f64; 3]; 2] {
    let mut bounds = [[-0.1, low, -0.1], [0.1, high, 0.1]];
    for (k, radii) in tube.radii.iter().enumerate() {
        let y = tube.position(k);
        if y < low - 0.03 || y > high + 0.03 {
            continue;
        }
        for (i, r) in radii.iter().enumerate() {
            let (sin, cos) = super::tube::angle(i).sin_cos();
            let (x, z) = (tube.centres[k][1] + r * sin, tube.centres[k][0] + r * cos);
            for (axis, value) in [(0, x), (2, z)] {
                bounds[0][axis] = bounds[0][axis].min(value - 0.04);
                bounds[1][axis] = bounds[1][axis].max(value + 0.04);
            }
        }
    }
    bounds
}

fn skirt(pattern: &mut Pattern, rng: &mut ChaCha8Rng, sag: f64) {
    let mark = pattern.fit.landmarks;
    let waist = choose(rng, mark.waist - 0.35 * (mark.waist - mark.hip), mark.waist + 0.01);
    let shortest = mark.crotch - 0.06;
    let hem_height = shortest + choose(rng, 0.0, 1.0).powf(1.3) * (mark.ankle + 0.07 - shortest);
    let ease = choose(rng, 0.006, 0.016) + sag;
    let hang = choose(rng, 0.6, 1.0);
    let hem = Hem::random(rng, mark.waist - 0.03, hem_height, 0.55);
    let tube =
        pattern.fit.column.clone().hang(mark.waist, |_| hang).map(|y, a, r| r + ease + hem.extra(y, a));
    pattern.bounds = column_bounds(&tube, hem_height - 0.05, waist + 0.05);
    pattern.column = Some(Column { tube, top: waist + 0.10, bottom: f64::MIN });
    pattern.cuts = vec![level(rng, waist, -1.0, 0.08), level(rng, hem_height, 1.0, 0.04)];
    pattern.openings = 2;
}

fn trousers(pattern: &mut Pattern, rng: &mut ChaCha8Rng, sag: f64) {
    let mark = pattern.fit.landmarks;
    let waist = choose(rng, mark.waist - 0.5 * (mark.waist - mark.hip), mark.waist + 0.01);
    let drop = choose(rng, 0.012, 0.035);
    let shortest = mark.crotch - drop - 0.055;
    let hem_height = match rng.random_range(0..3u32) {
        0 => choose(rng, shortest - 0.18, shortest),
        1 => choose(rng, mark.knee - 0.12, mark.knee + 0.05),
        _ => choose(rng, mark.ankle + 0.02, mark.ankle + 0.10),
    };
    let ease = choose(rng, 0.006, 0.018) + sag;
    let leg_ease = choose(rng, 0.007, 0.024) + sag;
    let hang = choose(rng, 0.0, 1.0);
    let flare = choose(rng, -0.01, 0.07);
    let tube = pattern.fit.column.clone().hang(mark.waist, |_| 0.5).map(|_, _, r| r + ease);
    pattern.bounds = column_bounds(&tube, hem_height - 0.05, waist + 0.05);
    pattern.bounds[0][0] -= 0.06;
    pattern.bounds[1][0] += 0.06;
    pattern.column = Some(Column { tube, top: waist + 0.10, bottom: mark.crotch - drop });
    pattern.leg_top = mark.crotch + 0.05;
    let knee = mark.knee;
    pattern.trouser_legs = Some(pattern.fit.legs.clone().map(|leg| {
        leg.hang(mark.crotch, |_| hang)
            .map(|y, _, r| r + leg_ease + (flare * (knee - y) / (knee - mark.ankle)).clamp(-0.004, 0.08))
    }));
    pattern.cuts = vec![level(rng, waist, -1.0, 0.08), level(rng, hem_height, 1.0, 0.0)];
    pattern.openings = 3;
}

fn upper(pattern: &mut Pattern, category: Category, rng: &mut ChaCha8Rng, edge_length: f64, sag: f64) {
    let fit = pattern.fit;
    let mark = fit.landmarks;
    let torso = mark.armpit - mark.hip;
    let arm = mark.wrist - mark.shoulder[0];
    let hem_height = match category {
        Category::Dress => {
            let shortest = mark.crotch - 0.07;
            shortest + choose(rng, 0.0, 1.0).powf(1.3) * (mark.ankle + 0.07 - shortest)
        }
        Category::Top => choose(rng, mark.crotch + 0.01, mark.waist + 0.1 * torso),
        Category::TShirt => choose(rng, mark.crotch - 0.02, mark.waist - 0.02),
        _ => choose(rng, mark.crotch - 0.08, mark.hip + 0.05),
    };
    let has_sleeves = match category {
        Category::TShirt | Category::OpenShirt => true,
        Category::Dress => rng.random_bool(0.45),
        _ => false,
    };
    let strapless = !has_sleeves && rng.random_bool(0.25);
    let loose = choose(rng, 0.0, 1.0);
    let ease = 0.007 + 0.022 * loose + sag;
    let (hang_above, hang_below) = match category {
        Category::Dress => (0.7 * loose, choose(rng, 0.6, 1.0)),
        _ => (loose, loose),
    };
    let hem = match category {
        Category::Dress => Hem::random(rng, mark.waist, hem_height, 0.5),
        _ => Hem::random(rng, mark.waist + 0.5 * torso, hem_height, 0.12),
    };
    let chest = mark.armpit - 0.02;
    let tube = fit
        .column
        .clone()
        .hang(chest, |y| {
            hang_above + (hang_below - hang_above) * smooth_step(mark.waist + 0.04, mark.waist - 0.06, y)
        })
        .map(|y, a, r| {
            r + ease * smooth_step(mark.armpit + 0.06, mark.armpit - 0.04, y).max(0.3) + hem.extra(y, a)
        });
    let shoulder_ease = 0.001 + 0.008 * loose;
    pattern.clearance += shoulder_ease;

    let neck_line =
        |rng: &mut ChaCha8Rng, low: f64, high: f64| low + (high - low) * choose(rng, 0.0, 1.0).powf(1.4);
    let shoulder_x = mark.shoulder[0];
    let top;
    if strapless {
        let height = mark.armpit - choose(rng, 0.025, 0.05);
        pattern.cuts.push(level(rng, height, -1.0, 0.06));
        pattern.openings = 2;
        top = height + 0.06;
    } else {
        // How far the armhole may come in.
        let strap = (3.0 * edge_length).max(0.035);
        let armhole = shoulder_x * choose(rng, 0.80, 0.97);
        let (narrow, wide) = if has_sleeves {
            (mark.neck_width + 0.024, mark.neck_width * 1.3 + 0.030)
        } else {
            (mark.neck_width + 0.024, mark.neck_width * 1.5 + 0.030)
        };
        let half_width = neck_line(rng, narrow, wide).min(armhole - strap).max(mark.neck_width + 0.015);
        let depth = neck_line(rng, 0.005, if category == Category::TShirt { 0.07 } else { 0.11 });
        let depth_back = neck_line(rng, 0.0, if has_sleeves { 0.015 } else { 0.05 });
        let power = [1.15, 2.0, 2.0, 3.0][rng.random_range(0..4usize)];
        // Bodies put the neck joint at different heights: the slope of the shoulders tells where the neck begins.
        let base = fit.shoulder_height(0.42 * shoulder_x).min(mark.neck[1] + 0.02);
        let side = fit.shoulder_height(half_width).min(base) + pattern.clearance;
        top = side + 0.06;
        let front = base - 0.03 - depth;
        let back = base + 0.012 - depth_back;
        let middle = mark.neck[2];
        pattern.cuts.push(Box::new(move |p| {
            let bottom = back + (front - back) * smooth_step(middle - 0.05, middle + 0.06, p[2]);
            let across = (p[0] * p[0] + 1e-4).sqrt() / half_width;
            let rise = across.powf(power) * (side - bottom) + bottom - p[1];
            // Scaled towards a distance where the curve is steep.
            // Nothing climbs the neck above the side of the neckline.
            let rise = rise.min(side + 0.004 - p[1]);
            rise / (1.0 + power * across.min(2.0).powf(power - 1.0) * (side - bottom).max(0.0) / half_width)
        }));
        pattern.openings = 4;
        if has_sleeves {
            let share = match rng.random_range(0..3u32) {
                0 => choose(rng, 0.20, 0.42),
                1 => choose(rng, 0.45, 0.75),
                _ => choose(rng, 0.85, 0.97),
            };
            let cuff = shoulder_x + share * arm;
            let sleeve_ease = 0.006 + 0.016 * loose + choose(rng, 0.0, 0.006) + sag;
            let sleeve_hang = choose(rng, 0.0, 0.8);
            let flare = choose(rng, -0.004, 0.035) * share;
            let armhole_extra = choose(rng, 0.0, 0.012);
            let tilt = choose(rng, -0.15, 0.15);
            for (side, tube) in [1.0, -1.0].into_iter().zip(&fit.arms) {
                // Widest so far along the arm, the same for every direction: sleeves are round.
                let mut widest = f64::MIN;
                let tube = tube.clone().map(|s, a, r| {
                    if a == 0.0 {
                        widest = widest.max(if s > shoulder_x + 0.03 { r * 0.8 } else { 0.0 });
                    }
                    let along = ((s - shoulder_x) / (cuff - shoulder_x).max(0.05)).clamp(0.0, 1.0);
                    // Fades out over the shoulder, which would otherwise carry a puff.
                    let out = smooth_step(shoulder_x - 0.03, shoulder_x + 0.09, s);
                    let round = r + out * sleeve_hang * (widest - r).max(0.0);
                    let armhole = armhole_extra * smooth_step(shoulder_x + 0.10, shoulder_x, s);
                    round + (1.4 * out - 0.4) * sleeve_ease + flare * along + out * armhole
                });
                pattern.sleeves.push((tube, side));
                let height = mark.shoulder[1];
                pattern.cuts.push(Box::new(move |p| cuff + tilt * (p[1] - height) - side * p[0]));
            }
            pattern.bounds[1][0] = cuff + 0.06;
        } else {
            // From the shoulder the armhole runs down and out to the armpit.
            let bottom = mark.armpit - pattern.clearance - choose(rng, 0.015, 0.035);
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
    }
    if category == Category::OpenShirt {
        let gap = choose(rng, 0.006, 0.02);
        let widening = choose(rng, 0.0, 0.12);
        let height = mark.neck[1];
        let middle = fit.column.centre(mark.waist)[0];
        pattern.cuts.push(Box::new(move |p| {
            let open = gap + widening * (height - p[1]).max(0.0);
            (p[0].abs() - open).max(middle - 0.02 - p[2])
        }));
        pattern.openings = 3;
    }
    let reach = pattern.bounds[1][0];
    pattern.bounds = column_bounds(&tube, hem_height - 0.05, top);
    let width = reach.max(shoulder_x + 0.04);
    pattern.bounds[0][0] = pattern.bounds[0][0].min(-width);
    pattern.bounds[1][0] = pattern.bounds[1][0].max(width);
    pattern.bounds[0][2] = pattern.bounds[0][2].min(-0.16 + mark.shoulder[2]);
    pattern.bounds[1][2] = pattern.bounds[1][2].max(0.10 + mark.shoulder[2]);
    pattern.column = Some(Column { tube, top: mark.armpit + 0.03, bottom: f64::MIN });
    let tail = if category == Category::OpenShirt { 0.10 } else { 0.05 };
    pattern.cuts.push(level(rng, hem_height, 1.0, tail));
}
