//! How a file's coordinates become the body's: unit, up axis, facing, origin.

use crate::asset::rotation::{self, Matrix3};
use clothcombo_physics::vec3::{add, scale};
use serde::Serialize;
use std::fmt;
use std::str::FromStr;

/// Length unit of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Metre.
    #[default]
    M,
    /// Decimetre.
    Dm,
    /// Centimetre.
    Cm,
    /// Millimetre.
    Mm,
    /// Inch.
    Inch,
    /// Foot.
    Foot,
}

impl Unit {
    /// All units.
    pub const ALL: [Self; 6] = [Self::M, Self::Dm, Self::Cm, Self::Mm, Self::Inch, Self::Foot];

    /// Name, and metres per unit.
    fn entry(self) -> (&'static str, f64) {
        match self {
            Self::M => ("m", 1.0),
            Self::Dm => ("dm", 0.1),
            Self::Cm => ("cm", 0.01),
            Self::Mm => ("mm", 0.001),
            Self::Inch => ("inch", 0.0254),
            Self::Foot => ("foot", 0.3048),
        }
    }

    /// Metres per unit.
    pub fn metres(self) -> f64 {
        self.entry().1
    }

    /// `m`, `dm`, `cm`, `mm`, `inch` or `foot`.
    pub fn name(self) -> &'static str {
        self.entry().0
    }
}

/// The axis of a file that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// As here.
    #[default]
    Y,
    /// As in Blender, 3ds Max and CAD programs; −y faces forward.
    Z,
    /// Seen in some scanners' files.
    X,
    /// Upside down: as images count their rows.
    MinusY,
    /// See [`UpAxis::MinusY`].
    MinusZ,
    /// See [`UpAxis::MinusY`].
    MinusX,
}

impl UpAxis {
    /// All of them, the usual ones first.
    pub const ALL: [Self; 6] = [Self::Y, Self::Z, Self::X, Self::MinusY, Self::MinusZ, Self::MinusX];
    /// Those that are looked for. Upside down much that is no garment looks like one: the others must be given.
    pub const USUAL: [Self; 3] = [Self::Y, Self::Z, Self::X];
    /// Those that are not.
    pub const DOWN: [Self; 3] = [Self::MinusY, Self::MinusZ, Self::MinusX];

    /// Name, and the rotation that turns this axis up.
    fn entry(self) -> (&'static str, Matrix3) {
        match self {
            Self::Y => ("y", rotation::IDENTITY),
            Self::Z => ("z", [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
            Self::X => ("x", [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
            Self::MinusY => ("-y", [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]),
            Self::MinusZ => ("-z", [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
            Self::MinusX => ("-x", [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
        }
    }

    /// The rotation that turns this axis up.
    pub fn to_y_up(self) -> Matrix3 {
        self.entry().1
    }

    /// `y`, `z`, `x`, `-y`, `-z` or `-x`.
    pub fn name(self) -> &'static str {
        self.entry().0
    }
}

macro_rules! named {
    ($kind:ty, $what:literal) => {
        impl fmt::Display for $kind {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }

        impl FromStr for $kind {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                Self::ALL.into_iter().find(|x| x.name() == text).ok_or_else(|| {
                    let names: Vec<&str> = Self::ALL.iter().map(|x| x.name()).collect();
                    format!("'{text}' is no {}; known are {}", $what, names.join(", "))
                })
            }
        }
    };
}

named!(Unit, "unit");
named!(UpAxis, "up axis");

/// Where the origin of the file was taken to be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FileOrigin {
    /// At the pelvis joint, as here.
    #[default]
    Pelvis,
    /// On the floor below the pelvis.
    Floor,
    /// Nowhere on the body: the garment was moved to where it fits.
    Elsewhere,
    /// Where the body that the garment was made on has it.
    SourceBody,
}

/// The similarity that brings a file onto the body: `p ↦ metres · R · p + translation`. The default is [`Self::AS_GIVEN`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Placement {
    /// Unit of the file.
    pub unit: Unit,
    /// Up axis of the file.
    pub up: UpAxis,
    /// Turn about the vertical after the up axis (degrees, counter-clockwise seen from above).
    pub turn_degrees: f64,
    /// Where the file's origin is.
    pub origin: FileOrigin,
    /// Translation after scaling and turning (m).
    pub translation: [f64; 3],
    /// How far the arms of the garment hang below the horizontal (degrees); 0 is a T-pose.
    pub arm_angle_degrees: f64,
    /// How far each leg of the garment is turned outwards from where the body has it at rest (degrees).
    pub leg_angle_degrees: f64,
}

impl Placement {
    /// Of a file that needs none: metres, y up, the front forward, the pelvis at the origin, level arms.
    pub const AS_GIVEN: Self = Self {
        unit: Unit::M,
        up: UpAxis::Y,
        turn_degrees: 0.0,
        origin: FileOrigin::Pelvis,
        translation: [0.0; 3],
        arm_angle_degrees: 0.0,
        leg_angle_degrees: 0.0,
    };

    /// In words, short: what a reader compares.
    pub(super) fn reading(&self) -> String {
        let arms = match self.arm_angle_degrees {
            0.0 => "T-pose".to_owned(),
            degrees => format!("A-pose, arms {degrees:.0}° down"),
        };
        let legs = match self.leg_angle_degrees {
            0.0 => String::new(),
            degrees => format!(", legs {degrees:.0}° apart"),
        };
        let [x, y, z] = self.translation;
        format!(
            "unit {}, up {}, turned {}°, {arms}{legs}, origin at {x:.3}, {y:.3}, {z:.3} m",
            self.unit, self.up, self.turn_degrees
        )
    }

    /// Whether arms and legs are where the body has them at rest.
    pub(super) fn has_limbs_at_rest(&self) -> bool {
        (self.arm_angle_degrees, self.leg_angle_degrees) == (0.0, 0.0)
    }

    /// The turn without scale and translation.
    pub fn turn(&self) -> Matrix3 {
        // Quarter turns are exact.
        let (s, c) = match self.turn_degrees {
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            degrees => degrees.to_radians().sin_cos(),
        };
        rotation::product(&[[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]], &self.up.to_y_up())
    }

    /// All points moved onto the body (still in the garment's arm pose).
    pub fn apply(&self, positions: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let (turn, metres) = (self.turn(), self.unit.metres());
        positions.iter().map(|p| add(scale(rotation::apply(&turn, *p), metres), self.translation)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_turn_is_a_rotation_that_puts_the_up_axis_up() {
        for up in UpAxis::ALL {
            for turn_degrees in [0.0, 90.0, 180.0, 270.0] {
                let placement = Placement {
                    unit: Unit::Cm,
                    up,
                    turn_degrees,
                    origin: FileOrigin::Pelvis,
                    ..Placement::AS_GIVEN
                };
                let m = placement.turn();
                let square = rotation::product(&m, &rotation::transpose(&m));
                assert_eq!(square, rotation::IDENTITY);
                let determinant: f64 = (0..3)
                    .map(|i| {
                        m[0][i]
                            * (m[1][(i + 1) % 3] * m[2][(i + 2) % 3] - m[1][(i + 2) % 3] * m[2][(i + 1) % 3])
                    })
                    .sum();
                assert_eq!(determinant, 1.0);
                let axis = match up {
                    UpAxis::X => [100.0, 0.0, 0.0],
                    UpAxis::Y => [0.0, 100.0, 0.0],
                    UpAxis::Z => [0.0, 0.0, 100.0],
                    UpAxis::MinusX => [-100.0, 0.0, 0.0],
                    UpAxis::MinusY => [0.0, -100.0, 0.0],
                    UpAxis::MinusZ => [0.0, 0.0, -100.0],
                };
                assert_eq!(placement.apply(&[axis]), [[0.0, 1.0, 0.0]]);
            }
        }
    }

    #[test]
    fn names_parse_back() {
        for unit in Unit::ALL {
            assert_eq!(unit.name().parse(), Ok(unit));
        }
        assert!("furlong".parse::<Unit>().unwrap_err().contains("inch"));
        for up in UpAxis::ALL {
            assert_eq!(up.name().parse(), Ok(up));
        }
    }
}
