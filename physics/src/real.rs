//! The scalar types of the crate.

use std::fmt::{Debug, Display};
use std::iter::Sum;

use num_traits::{Float, FloatConst, NumAssign};

use crate::query::KdScalar;

/// A floating-point scalar: `f32` (training) or `f64` (reference, precompute).
///
/// Everything numerical in this crate that is evaluated in both precisions is written once over this trait.
pub trait Real:
    Float + FloatConst + NumAssign + Sum + Default + Debug + Display + Send + Sync + KdScalar + 'static
{
    /// Rounds an `f64` to this type.
    fn from_f64(value: f64) -> Self;

    /// Widens to `f64` (exact).
    fn to_f64(self) -> f64;
}

impl Real for f32 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        self
    }
}
