//! What a motion may hold, and what can be wrong with it.

use crate::asset::skeleton::BODY_JOINT_NAMES;
use crate::format::NpzError;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use thiserror::Error;

/// Frame rates that a motion may have [frames/s]: from time lapse to high-speed cameras. Beyond them times and numbers of frames
/// leave the range of their types.
pub const FRAME_RATES: RangeInclusive<f64> = 0.01..=10_000.0;

/// Largest component of a rotation vector in a motion [rad]: over a thousand turns, where f32 still tells a thousandth of a radian.
pub const MAX_ANGLE: f64 = 1e4;

/// Refuses a frame rate [frames/s] out of [`FRAME_RATES`].
pub(crate) fn check_frame_rate(rate: f64) -> Result<(), MotionDefect> {
    if FRAME_RATES.contains(&rate) { Ok(()) } else { Err(MotionDefect::FrameRate { rate }) }
}

/// Why a motion file cannot be used.
#[derive(Debug, Error)]
pub enum MotionError {
    /// The archive or one of its arrays is unusable.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// Some joints are named as ours are, but not this one.
    #[error("{}: key 'joint_names' names no '{joint}'; the 22 joints of the body are named as in SMPL, in any order", path.display())]
    Joint {
        /// The file.
        path: PathBuf,
        /// Its name.
        joint: &'static str,
    },
    /// A number in it is out of range.
    #[error("{}: {defect}", path.display())]
    Defect {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        defect: MotionDefect,
    },
}

/// What no motion may hold, from whatever file it comes.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MotionDefect {
    /// The frame rate is out of [`FRAME_RATES`].
    #[error(
        "a frame rate (mocap_framerate) of {rate:?} frames per second, expected {} to {}; is it the duration of a frame, or \
         another unit?",
        FRAME_RATES.start(), FRAME_RATES.end()
    )]
    FrameRate {
        /// The rate [frames/s].
        rate: f64,
    },
    /// A NaN or infinite angle.
    #[error("frame {frame}, joint {joint} ({}) has a non-finite rotation", joint_name(*joint))]
    NonFinite {
        /// The frame, from 0.
        frame: usize,
        /// The joint.
        joint: usize,
    },
    /// An angle above [`MAX_ANGLE`].
    #[error(
        "frame {frame}, joint {joint} ({}) turns by {angle:?} rad, more than the {MAX_ANGLE} rad of any motion; is the file \
         damaged, or in another format?", joint_name(*joint)
    )]
    Angle {
        /// The frame, from 0.
        frame: usize,
        /// The joint.
        joint: usize,
        /// The angle [rad].
        angle: f64,
    },
}

fn joint_name(joint: usize) -> &'static str {
    BODY_JOINT_NAMES.get(joint).copied().unwrap_or("of no body")
}
