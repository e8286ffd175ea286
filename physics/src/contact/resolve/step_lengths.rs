//! How long the steps of a path may be.

use super::clearance::Clearance;

/// How long steps are, as shares of the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepLengths {
    /// The longest one.
    pub longest: f64,
    /// The shortest one: it is taken even where it leaves more intersections than there were.
    pub shortest: f64,
    /// The longest one in which cloth may keep its contact orientation: little slides past in it.
    pub keeping: f64,
    /// Whether short steps always keep it; otherwise they do where a step without it leaves intersections.
    pub always_keeps: bool,
    /// Where the body yields.
    pub clearance: Clearance,
}

impl StepLengths {
    /// From the T-pose to a pose.
    pub const FROM_T_POSE: Self = Self {
        longest: 1.0 / 4.0,
        shortest: 1.0 / 512.0,
        keeping: 1.0 / 32.0,
        always_keeps: true,
        clearance: Clearance::DEEP,
    };
    /// From one frame of a motion to the next.
    pub const OF_FRAME: Self = Self {
        longest: 1.0,
        shortest: 1.0 / 128.0,
        keeping: 1.0,
        always_keeps: false,
        clearance: Clearance::AMPLE,
    };
    /// The same from a frame that was not clear.
    pub const OF_INTERSECTED_FRAME: Self = Self { shortest: 1.0 / 4.0, ..Self::OF_FRAME };
}
