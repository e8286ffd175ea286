//! The instruction sets that kernels are compiled for, of which the best one that the CPU has is taken at run time.

use pulp::Scalar128b;

/// An instruction set that the CPU has.
#[derive(Clone, Copy)]
pub(super) enum InstructionSet {
    #[cfg(target_arch = "x86_64")]
    Avx512(pulp::x86::V4),
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    Baseline(Scalar128b),
}

impl InstructionSet {
    #[inline]
    pub(super) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V4::try_new() {
            return Self::Avx512(simd);
        } else if let Some(simd) = pulp::x86::V3::try_new() {
            return Self::Avx2(simd);
        }
        Self::Baseline(Scalar128b)
    }

    /// f32 elements of a vector.
    pub(super) fn lanes(self) -> usize {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => 16,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => 8,
            Self::Baseline(_) => 4,
        }
    }
}

/// Compiles a kernel for every instruction set and runs the best one this CPU has.
///
/// The closure's body must be inlined into the caller: mark it and what it calls `#[inline(always)]`.
#[inline(always)]
pub(super) fn vectorised<R>(kernel: impl FnOnce() -> R) -> R {
    // Named instruction sets instead of `pulp::Arch::dispatch`, through which a kernel is not inlined and stays narrow.
    match InstructionSet::detect() {
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512(simd) => simd.vectorize(kernel),
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2(simd) => simd.vectorize(kernel),
        InstructionSet::Baseline(_) => kernel(),
    }
}
