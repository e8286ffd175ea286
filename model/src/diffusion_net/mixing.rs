//! Learned rotation and scaling of gradients between channels.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::initializer::{Initializer, fan_in_bound};

/// Complex matrix A that mixes the tangent gradients (as complex numbers) of all channels.
///
/// Parameters: `real` `[C,C]`, `imaginary` `[C,C]`, acting from the right.
#[derive(Module, Debug)]
pub struct ComplexMixing {
    /// Real part of A, transposed.
    pub real: Param<Tensor<2>>,
    /// Imaginary part of A, transposed.
    pub imaginary: Param<Tensor<2>>,
}

impl ComplexMixing {
    pub(crate) fn new(width: usize, start: &mut Initializer) -> Self {
        let bound = fan_in_bound(width);
        Self { real: start.uniform([width, width], bound), imaginary: start.uniform([width, width], bound) }
    }
}
