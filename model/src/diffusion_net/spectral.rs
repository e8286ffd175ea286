//! Learned diffusion of every channel, on spectral coefficients.

use burn::module::{Module, Param};
use burn::tensor::Tensor;

use crate::initializer::Initializer;

/// Shortest diffusion time: the published lower bound.
pub(crate) const MINIMUM_TIME: f64 = 1e-8;

/// One learned diffusion time per channel.
///
/// Parameter: `time` `[C]`, in the inverse unit of the eigenvalues (m²), starting at zero as published.
#[derive(Module, Debug)]
pub struct SpectralDiffusion {
    /// Diffusion times.
    pub time: Param<Tensor<1>>,
}

impl SpectralDiffusion {
    pub(crate) fn new(width: usize, start: &mut Initializer) -> Self {
        Self { time: start.zeros([width]) }
    }

    /// The times in use `[1,C]`: at least [`MINIMUM_TIME`].
    ///
    /// The published code clamps the parameter itself before every pass, so that the gradient flows even at the bound;
    /// a clamp inside the graph would stop it there for good, and every time starts at the bound.
    pub(crate) fn times(&self) -> Tensor<2> {
        let time = self.time.val();
        let raised = time.clone().detach();
        let raise = raised.clone().clamp_min(MINIMUM_TIME) - raised;
        (time + raise).unsqueeze()
    }

    /// Coefficients `[k,C]` after diffusion; `decay` holds −λ `[k,1]`.
    pub(crate) fn diffuse(&self, coefficients: Tensor<2>, decay: Tensor<2>) -> Tensor<2> {
        coefficients * decay.matmul(self.times()).exp()
    }
}
