//! Which function a fused layer applies.

/// Pointwise activation of a fused layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Activation {
    /// The sum itself.
    Identity,
    /// max(x, 0), with derivative 0 at 0.
    Relu,
    /// x·Φ(x) with the exact normal distribution (erf), not its tanh approximation.
    Gelu,
}
