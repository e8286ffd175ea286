//! What is known about a file, and the limits of what fits.

use super::from_body::SourceBody;
use super::placement::{FileOrigin, Placement, Unit, UpAxis};
use crate::asset::Category;
use std::str::FromStr;
use std::sync::Arc;

/// Most vertices a garment may have after welding.
pub const MAX_GARMENT_VERTICES: usize = 1_000_000;

/// What is left longer than this many times its length by the push out of the body is stretched.
pub(super) const MOST_STRETCH: f64 = 1.5;
/// Share of its edges from which a stretched garment does not fit.
pub(super) const MOST_STRETCHED: f64 = 0.1;
/// Triangles that a connected piece of cloth has on average, at least.
pub(super) const LEAST_PIECE: usize = 4;
/// Fewest triangles that can be a garment.
pub const MIN_TRIANGLES: usize = 20;

/// What is known about a file; `None` is found out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitSettings {
    /// Unit of the file.
    pub unit: Option<Unit>,
    /// Up axis of the file.
    pub up: Option<UpAxis>,
    /// Whether the arms are lowered (A-pose) or not (T-pose).
    pub arms_lowered: Option<bool>,
    /// How far each leg is turned outwards from the rest pose of the body (degrees).
    pub legs_degrees: Option<f64>,
    /// Category; otherwise guessed from the shape.
    pub category: Option<Category>,
    /// Where the file's origin lies on the body, from the pelvis of the zero body (m, x to the left, y up, z forward).
    pub offset: Option<[f64; 3]>,
    /// Turn about the vertical (degrees, counter-clockwise seen from above).
    pub turn_degrees: Option<f64>,
    /// Which surfaces are the garment.
    pub keep: Keep,
    /// Largest distance between borders that are joined (m); otherwise only borders that coincide are.
    pub join_seams: Option<f64>,
    /// The body that the garment was made on: it is placed through that one, and nothing is searched for. Unit, up axis
    /// and turn then say how garment *and* body mesh are written, or how the garment's coordinates differ from a body
    /// npz's.
    pub from_body: Option<Arc<SourceBody>>,
}

impl FitSettings {
    /// Whether it says anything about where and how the garment is worn: that is taken, and what looks odd there is a warning.
    pub(super) fn says_place(&self) -> bool {
        let of_the_file = self.unit.is_some() || self.up.is_some() || self.category.is_some();
        of_the_file || self.arms_lowered.is_some() || self.legs_degrees.is_some() || self.is_placed()
    }

    /// Up axes that are looked for.
    pub(super) fn ups(&self) -> Vec<UpAxis> {
        self.up.map_or(UpAxis::USUAL.to_vec(), |up| vec![up])
    }

    /// Turns about the vertical that are looked for (degrees).
    pub(super) fn turns(&self) -> Vec<f64> {
        self.turn_degrees.map_or(vec![0.0, 90.0, 180.0, 270.0], |turn| vec![turn])
    }

    /// Logarithm of how usual a file of this placement is, up to a constant; what is said has no say.
    pub(super) fn log_prior(&self, placement: &Placement) -> f64 {
        let unit = match placement.unit {
            Unit::M => 0.0,
            Unit::Cm | Unit::Mm => -0.5,
            _ => -2.0,
        };
        let up = match placement.up {
            UpAxis::Y => 0.0,
            UpAxis::Z => -0.5,
            _ => -2.0,
        };
        let turn = match placement.turn_degrees {
            0.0 => 0.0,
            // Back to front is the least usual one.
            180.0 => -5.0,
            _ => -2.0,
        };
        let arms = if placement.arm_angle_degrees == 0.0 { 0.0 } else { -1.5 };
        let legs = if placement.leg_angle_degrees == 0.0 { 0.0 } else { -1.5 };
        let origin = match placement.origin {
            FileOrigin::Pelvis => 0.0,
            FileOrigin::Floor => -0.5,
            // A place known to a centimetre or two in each direction, of a metre: three free numbers fit a little
            // better anywhere.
            _ => -12.0,
        };
        let found_out = [
            (self.unit.is_none(), unit),
            (self.up.is_none(), up),
            (self.turn_degrees.is_none(), turn),
            (self.arms_lowered.is_none(), arms),
            (self.legs_degrees.is_none(), legs),
            (self.offset.is_none(), origin),
        ];
        found_out.iter().map(|(is_found_out, log)| if *is_found_out { *log } else { 0.0 }).sum()
    }

    /// Whether they say where a garment belongs: such a garment is never taken where it lies.
    pub fn is_placed(&self) -> bool {
        self.offset.is_some() || self.turn_degrees.is_some() || self.from_body.is_some()
    }
}

/// Which of a file's surfaces are the garment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All of them; cloth with thickness is refused.
    #[default]
    All,
    /// The connected piece with the largest area.
    Largest,
    /// The outer sheet of cloth with thickness.
    Outer,
}

impl FromStr for Keep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            "largest" => Ok(Self::Largest),
            "outer" => Ok(Self::Outer),
            _ => Err(format!("'{text}' is none of all, largest, outer")),
        }
    }
}
