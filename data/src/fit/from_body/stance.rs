//! Which way up a person stands, which way it faces, and how it holds its arms: measured on points in metres.

use super::gaps::median;
use crate::asset::Body;
use crate::fit::placement::{FileOrigin, Placement, Unit};
use crate::fit::settings::FitSettings;
use crate::mesh::bounds;

/// Heights of people (m).
pub(super) const PERSON_HEIGHTS: [f64; 2] = [1.2, 2.3];
/// A toe must point forward by this share of the height to say where the front is.
const LEAST_TOE: f64 = 0.008;

/// A way up and round.
#[derive(Clone)]
pub(super) struct Stance {
    pub placement: Placement,
    /// Height (m).
    pub height: f64,
    /// How far the feet point forward, as a share of the height; negative backwards.
    pub toes: f64,
    /// Angle of the arms below the horizontal (degrees).
    pub arms: f64,
    /// Lowest point, and the middle of the body seen from above (m).
    pub foot: [f64; 3],
}

impl Stance {
    pub fn says_front(&self) -> bool {
        self.toes > LEAST_TOE
    }

    pub fn says_back(&self) -> bool {
        self.toes < -LEAST_TOE
    }
}

/// All stances in which the points may be a person: of a plausible height, wider than deep.
pub(super) fn stances(points: &[[f64; 3]], body: &Body, settings: &FitSettings) -> Vec<Stance> {
    let mut all = Vec::new();
    for up in settings.ups() {
        let upright = Placement { up, ..Placement::AS_GIVEN }.apply(points);
        let [low, high] = bounds(&upright);
        let height = high[1] - low[1];
        let is_height =
            |unit: &Unit| (PERSON_HEIGHTS[0]..=PERSON_HEIGHTS[1]).contains(&(height * unit.metres()));
        let unit = match settings.unit {
            Some(unit) => Some(unit).filter(is_height),
            None => Unit::ALL.into_iter().find(is_height),
        };
        let Some(unit) = unit else { continue };
        for turn_degrees in settings.turns() {
            let origin = FileOrigin::SourceBody;
            let placement = Placement { unit, up, turn_degrees, origin, ..Placement::AS_GIVEN };
            let placed = placement.apply(points);
            let [low, high] = bounds(&placed);
            if high[0] - low[0] > high[2] - low[2] {
                all.push(measured(placement, &placed, body));
            }
        }
    }
    all
}

fn measured(placement: Placement, points: &[[f64; 3]], body: &Body) -> Stance {
    let [low, high] = bounds(points);
    let height = high[1] - low[1];
    let of = |axis: usize, is: &dyn Fn(&[f64; 3]) -> bool| {
        median(&mut points.iter().filter(|p| is(p)).map(|p| p[axis]).collect::<Vec<f64>>())
    };
    let level = |p: &[f64; 3]| (p[1] - low[1]) / height;
    let is_trunk = |p: &[f64; 3]| (0.5..0.7).contains(&level(p));
    let (x, z) = (of(0, &is_trunk), of(2, &is_trunk));
    // The sole is as long as the foot, the shin above it as deep as the heel.
    let (sole, shin) = (of(2, &|p| level(p) < 0.035), of(2, &|p| (0.08..0.16).contains(&level(p))));
    // Fingers and palms are the last 4 % of the reach.
    let reach = points.iter().map(|p| (p[0] - x).abs()).fold(0.0, f64::max);
    let tip = of(1, &|p| (p[0] - x).abs() > 0.96 * reach);
    Stance {
        placement,
        height,
        toes: (sole - shin) / height,
        arms: arm_angle(body, (tip - low[1]) / height, reach / height),
        foot: [x, low[1], z],
    }
}

/// Angle below the horizontal of arms whose tips are at this height and distance from the middle, as shares of the body's height.
fn arm_angle(body: &Body, tip: f64, reach: f64) -> f64 {
    let [low, high] = bounds(&body.template);
    let height = high[1] - low[1];
    let Some([x, y, _]) = body.joint_place("left_shoulder") else { return 0.0 };
    let drop = (y - low[1]) / height - tip;
    drop.atan2((reach - x.abs() / height).max(0.01)).to_degrees().clamp(0.0, 85.0)
}
