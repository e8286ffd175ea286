//! A garment before it is meshed: a solid around the body and the cuts that open it.

use super::super::field::{smooth_min, smooth_step};
use super::design::FlareDesign;
use super::fit::BodyFit;
use super::measures::Landmarks;
use super::tube::{Tube, angle};
use std::f64::consts::TAU;

/// Keeps the part where the field is not negative (m, distance-like).
pub(super) type Cut = Box<dyn Fn([f64; 3]) -> f64 + Send + Sync>;

/// A solid around a body, and where it is opened.
pub(super) struct Pattern<'a> {
    pub fit: &'a BodyFit,
    pub column: Option<Column>,
    pub sleeves: Vec<(Tube, f64)>,
    pub trouser_legs: Option<[Tube; 2]>,
    pub leg_top: f64,
    /// Distance the cloth keeps from the skin where no tube is wider (m).
    pub clearance: f64,
    /// The curves along which the solid is opened; cut `i` has the label bit `1 << i`.
    pub cuts: Vec<Cut>,
    /// Number of closed boundary curves the finished garment must have.
    pub openings: usize,
    /// A box around everything that the cuts keep.
    pub bounds: [[f64; 3]; 2],
}

/// The tube around trunk and legs.
pub(super) struct Column {
    pub tube: Tube,
    pub pleats: Option<Pleats>,
    pub top: f64,
    pub bottom: f64,
}

/// Half the width of the gap between trouser legs (m).
const LEG_GAP: f64 = 0.007;
/// Length over which a cuff is gathered (m).
const GATHER: f64 = 0.045;
/// Width of a gathered cuff beyond the limb (m).
const CUFF_EASE: f64 = 0.008;
/// Most a fold stands out (m).
const FOLD_HEIGHT: f64 = 0.045;
/// Edges a fold needs to be seen.
const EDGES_PER_FOLD: f64 = 6.0;

impl<'a> Pattern<'a> {
    /// A pattern without cuts yet, whose cloth keeps `clearance` (m) from the body.
    pub fn blank(fit: &'a BodyFit, clearance: f64) -> Self {
        Pattern {
            fit,
            column: None,
            sleeves: Vec::new(),
            trouser_legs: None,
            leg_top: 0.0,
            clearance,
            cuts: Vec::new(),
            openings: 0,
            bounds: [[0.0; 3]; 2],
        }
    }

    /// The solid whose surface is the cloth: negative inside (m).
    pub fn field(&self, p: [f64; 3]) -> f64 {
        let mut f = self.fit.distance.distance(p) - self.clearance;
        if let Some(column) = &self.column {
            let side = match &column.pleats {
                Some(pleats) => column.tube.value_of_wider(p, |y, a, r| pleats.extra(y, a, r)),
                None => column.tube.value(p),
            };
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

/// Folds around a column, ready to be evaluated.
pub(super) struct Pleats {
    from: f64,
    to: f64,
    count: f64,
    depth: f64,
    formed: f64,
    phase: f64,
}

impl Pleats {
    /// The pleats of `design` on `tube` between two heights; `None` without pleats, or where the triangles could not show
    /// them.
    pub fn new(design: &FlareDesign, tube: &Tube, from: f64, to: f64, edge_length: f64) -> Option<Self> {
        let pleats = design.pleats.as_ref()?;
        let middle = 0.5 * (from + to);
        let radius = 0.25
            * [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
                .iter()
                .map(|(u, v)| tube.radius(middle, *u, *v))
                .sum::<f64>();
        let most = (TAU * radius / (EDGES_PER_FOLD * edge_length)).floor();
        let count = f64::from(pleats.count).min(most);
        (count >= 5.0).then_some(Self {
            from,
            to,
            count,
            depth: pleats.depth.clamp(0.0, 0.25),
            formed: pleats.formed.clamp(0.05, 1.0),
            phase: pleats.phase,
        })
    }

    /// Extra radius (m) at height `y`, angle `a`, where the column has radius `r`. Never negative: folds stand out.
    fn extra(&self, y: f64, a: f64, r: f64) -> f64 {
        let share = (self.from - y) / (self.from - self.to).max(0.05);
        if share <= 0.0 {
            return 0.0;
        }
        let height = (self.depth * TAU * r / self.count).min(FOLD_HEIGHT);
        smooth_step(0.0, self.formed, share) * height * 0.5 * (1.0 + (self.count * a + self.phase).cos())
    }
}

/// Extra radius of a flared outline (m) at height `y`, starting at `from`.
pub(super) fn flared(flare: f64, from: f64, y: f64) -> f64 {
    let below = (from - y).max(0.0);
    // Starts tangentially so that there is no crease at the waist.
    flare * below * below / (below + 0.06)
}

/// Height (m) of `length` on the scale of designs: 0 the waist, 1 the crotch, 2 the ankle.
pub(super) fn height(mark: &Landmarks, length: f64) -> f64 {
    if length <= 1.0 {
        mark.waist + (mark.crotch - mark.waist) * length
    } else {
        mark.crotch + (mark.ankle - mark.crotch) * (length - 1.0)
    }
}

/// A nearly level cut that keeps what is above (`sign` 1) or below (−1).
pub(super) fn level(height: f64, sign: f64, tilt: f64) -> Cut {
    Box::new(move |p| sign * (p[1] - height - tilt * p[2]))
}

/// Radius of a limb's cloth gathered by the share `cuff` towards the end, which is `left` metres away; `limb` is the
/// radius of the limb itself.
pub(super) fn gathered(radius: f64, limb: f64, cuff: f64, left: f64, sag: f64) -> f64 {
    let tight = limb + CUFF_EASE + sag;
    let share = cuff * smooth_step(GATHER + 0.02, 0.015, left);
    radius + share * (tight - radius).min(0.0)
}

/// A box around the part of `tube` between two heights, with room for its folds.
pub(super) fn column_bounds(tube: &Tube, low: f64, high: f64) -> [[f64; 3]; 2] {
    const FOLD_MARGIN: f64 = 0.04 + FOLD_HEIGHT;
    let mut bounds = [[-0.1, low, -0.1], [0.1, high, 0.1]];
    for (k, radii) in tube.radii.iter().enumerate() {
        let y = tube.position(k);
        if y < low - 0.03 || y > high + 0.03 {
            continue;
        }
        for (i, r) in radii.iter().enumerate() {
            let (sin, cos) = angle(i).sin_cos();
            let (x, z) = (tube.centres[k][1] + r * sin, tube.centres[k][0] + r * cos);
            for (axis, value) in [(0, x), (2, z)] {
                bounds[0][axis] = bounds[0][axis].min(value - FOLD_MARGIN);
                bounds[1][axis] = bounds[1][axis].max(value + FOLD_MARGIN);
            }
        }
    }
    bounds
}
