//! What is not certain about a placement that was taken, and the flags that settle it.

use super::diagnosis::Size;
use super::placement::Placement;
use clothcombo_physics::vec3::{norm, sub};
use std::fmt;

/// Readings nearer to each other than this are the same (m).
pub(super) const SAME: f64 = 0.02;

/// A doubt about a placement that was taken.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Doubt {
    /// Another reading is nearly as good.
    NearTie { taken: Placement, other: Placement, apart: f64 },
    /// Some centimetres higher or lower it fits nearly as well.
    Height { taken: Placement },
    /// A tube may be a skirt or a strapless top.
    Tube,
    /// Several pieces are worn on their own.
    Outfit { pieces: usize },
    /// It does not look worn, but hints say where it is.
    Odd { why: String },
    /// It would fit much better at another size.
    Size(Size),
    /// The body's arms miss the sleeves.
    Arms,
    /// Its front is where the file has its back, or the other way round.
    Turned,
    /// Arms or legs were found to be held otherwise by little evidence (log-posterior).
    Limbs { taken: Placement, margin: f64 },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NearTie { taken, other, apart } => {
                let flags = differences(taken, other);
                write!(
                    f,
                    "another placement, up to {:.0} mm away, fits nearly as well: {}; {} settles it",
                    1e3 * apart,
                    other.reading(),
                    flags.join(" ")
                )
            }
            Self::Height { taken } => {
                let [x, y, z] = taken.translation;
                write!(
                    f,
                    "its height is known to 3 cm only: look at it; --offset {x:.3},{y:.3},{z:.3} takes it, another y moves it"
                )
            }
            Self::Outfit { pieces } => write!(
                f,
                "{pieces} of its pieces would be worn without the others: for an outfit, export one file per garment"
            ),
            Self::Odd { why } => write!(f, "it does not look worn there: {why}; the hints are taken all the same"),
            Self::Size(size) => write!(f, "{size}: is it of another size, or in another unit (--unit)?"),
            Self::Arms => f.write_str(
                "arms of the body pass through the cloth of its sleeves, which were made for arms held otherwise or of another body: --arms \
                 or --from-body settles it",
            ),
            Self::Turned => f.write_str(
                "turned by 180°, as it lies better on the body so, though no neckline shows where its front is; --turn 0 keeps it",
            ),
            Self::Limbs { taken, margin } => {
                let (limbs, flag, angle) = match taken.arm_angle_degrees {
                    0.0 => ("legs", "--legs 0", taken.leg_angle_degrees),
                    angle => ("arms", "--arms t", angle),
                };
                write!(
                    f,
                    "little tells that its {limbs} are {angle:.0}° from the rest pose (log-odds {margin:.1}); {flag} if they are not"
                )
            }
            Self::Tube => f.write_str(
                "a tube with two openings may be a skirt at the waist or a strapless top at the chest; --category settles it",
            ),
        }
    }
}

/// Flags by which the placement taken differs from another, as they fix the one taken.
fn differences(taken: &Placement, other: &Placement) -> Vec<String> {
    let mut flags = Vec::new();
    if taken.unit != other.unit {
        flags.push(format!("--unit {}", taken.unit));
    }
    if taken.up != other.up {
        flags.push(format!("--up {}", taken.up));
    }
    if taken.turn_degrees != other.turn_degrees {
        flags.push(format!("--turn {}", taken.turn_degrees));
    }
    if (taken.arm_angle_degrees == 0.0) != (other.arm_angle_degrees == 0.0) {
        flags.push(format!("--arms {}", if taken.arm_angle_degrees == 0.0 { "t" } else { "a" }));
    }
    if (taken.leg_angle_degrees == 0.0) != (other.leg_angle_degrees == 0.0) {
        flags.push(format!("--legs {:.0}", taken.leg_angle_degrees));
    }
    let moved = norm(sub(taken.translation, other.translation));
    if flags.is_empty() && moved < SAME {
        flags.push("--from-body with the body it was made on".into());
    }
    if flags.is_empty() {
        let [x, y, z] = taken.translation;
        flags.push(format!("--offset {x:.3},{y:.3},{z:.3}"));
    }
    flags
}
