//! The numbers that matrices are multiplied in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[cfg(target_arch = "x86_64")]
use super::bf16;

/// Numbers that large matrices are multiplied in on a processor. Sums, weights and everything else are f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// f32.
    #[default]
    F32,
    /// bf16 where the processor multiplies it (AVX512-BF16), at twice the rate; else f32. A GPU has numbers of its own.
    Bf16,
}

impl Precision {
    /// What this processor makes of it.
    pub fn effective(self) -> Self {
        if self.rounds() { Self::Bf16 } else { Self::F32 }
    }

    /// Whether this processor rounds factors to bf16.
    pub fn rounds(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        let is_available = bf16::is_available();
        #[cfg(not(target_arch = "x86_64"))]
        let is_available = false;
        self == Self::Bf16 && is_available
    }
}
