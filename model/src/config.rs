//! Sizes of the networks and of the data they are made for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ModelError;

/// Which garments of an outfit interact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Graph {
    /// Garments whose rest boxes are at most 5 cm apart. `D_m` moves no other garment: Δx_m = 0 exactly.
    #[default]
    Near,
    /// All pairs i < j, as in the paper. `D_m` moves every garment, one without neighbours too (f^i = 0 ⊕ 0).
    Full,
}

/// Joints of which the skinning network S corrects a garment's weights.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SkinningJoints {
    /// Joints that the garment's initial weights W use.
    #[default]
    Bound,
    /// All active joints, as in the paper.
    All,
}

/// Size and scale of every network; the defaults are the paper's.
///
/// Nothing here depends on the data: see [`Dimensions`] for what does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ModelConfig {
    /// Width of the draping and force networks `F_s` and `F_f`, and length of the draping embedding `z_s` and of a force `f^ij`.
    pub width: usize,
    /// Length of the vertex embedding `z_v` and of the garment embedding `z̄_v`.
    pub embedding: usize,
    /// DiffusionNet blocks in the embedding network.
    pub diffusion_blocks: usize,
    /// Channels of a DiffusionNet block.
    pub diffusion_width: usize,
    /// Laplacian eigenpairs a garment is described with (k).
    pub eigen_count: usize,
    /// Linear layers of `F_s` and `F_f`, the output layer included.
    pub mlp_layers: usize,
    /// Sine layers of the modulated SIRENs `D_s` and `D_m`.
    pub siren_layers: usize,
    /// Width of the sine layers and of their modulators.
    pub siren_width: usize,
    /// Frequency w0 of the first sine layer.
    pub omega_first: f64,
    /// Frequency w0 of the other sine layers.
    pub omega_hidden: f64,
    /// Hidden layers of the skinning network S.
    pub skinning_layers: usize,
    /// Width of the hidden layers of S.
    pub skinning_width: usize,
    /// Factor on the output of `D_s`, which makes it Δx_s in metres.
    pub displacement_scale: f64,
    /// Factor on the output of `D_m`, which makes it Δx_m in metres.
    pub untangling_scale: f64,
    /// Factor on the output of S, which makes it ΔW.
    pub skinning_scale: f64,
    /// Keep Σ_j W_j = 1 by removing the mean of ΔW over the joints that `skinning_joints` names. `false` is the paper's raw sum.
    pub zero_sum_skinning: bool,
    /// Joints that ΔW acts on. `"bound"`: those that the garment's initial weights use, so that no garment follows a limb far
    /// from it. `"all"`: every active joint, the paper's W + ΔW.
    pub skinning_joints: SkinningJoints,
    /// Garments that interact: edges of the untangling network, and pairs with layer losses. `"near"`: those whose rest boxes are
    /// at most 5 cm apart, so that garments that cannot touch cost nothing and do not move. `"full"`: all, the paper's fully
    /// connected graph; `D_m` then moves every garment, a single one too. In `"full"` a layer collision without gate
    /// (`losses.layer_collision.gated`) pushes distant garments apart.
    pub graph: Graph,
    /// Give the vertex embedding `z_v` to `D_s`, `S` and `D_m`. `false` is the ablation of the paper's
    /// Table 4: the garment embedding `z̄_v` replaces it at every vertex.
    pub vertex_embedding: bool,
    /// Length of the code of the pose around a joint, which every vertex reads through its skin weights, beside the thickness
    /// of the garments below it; 0 is the paper, which has neither: its networks see the pose only through `z_s`, one row per
    /// garment.
    pub surroundings: usize,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self {
            width: 512,
            embedding: 512,
            diffusion_blocks: 8,
            diffusion_width: 512,
            eigen_count: 128,
            mlp_layers: 6,
            siren_layers: 6,
            siren_width: 512,
            omega_first: 30.0,
            omega_hidden: 1.0,
            skinning_layers: 4,
            skinning_width: 128,
            displacement_scale: 0.1,
            untangling_scale: 0.01,
            skinning_scale: 0.01,
            zero_sum_skinning: true,
            skinning_joints: SkinningJoints::Bound,
            graph: Graph::Near,
            vertex_embedding: true,
            surroundings: 0,
        }
    }
}

impl ModelConfig {
    /// Checks that every size is at least one and every scale and frequency is usable.
    ///
    /// # Errors
    /// Names the first key that is out of range.
    pub fn validate(&self) -> Result<(), ModelError> {
        let sizes = [
            ("width", self.width, 1),
            ("embedding", self.embedding, 1),
            ("diffusion_width", self.diffusion_width, 1),
            ("eigen_count", self.eigen_count, 1),
            ("mlp_layers", self.mlp_layers, 2),
            ("siren_layers", self.siren_layers, 1),
            ("siren_width", self.siren_width, 1),
            ("skinning_layers", self.skinning_layers, 1),
            ("skinning_width", self.skinning_width, 1),
        ];
        for (key, value, minimum) in sizes {
            check(value >= minimum, key, value, &format!("at least {minimum}"))?;
        }
        for (key, value) in [("omega_first", self.omega_first), ("omega_hidden", self.omega_hidden)] {
            check(value.is_finite() && value > 0.0, key, value, "a positive number")?;
        }
        let scales = [
            ("displacement_scale", self.displacement_scale),
            ("untangling_scale", self.untangling_scale),
            ("skinning_scale", self.skinning_scale),
        ];
        for (key, value) in scales {
            check(value.is_finite(), key, value, "a finite number")?;
        }
        Ok(())
    }
}

fn check(valid: bool, key: &'static str, value: impl ToString, expected: &str) -> Result<(), ModelError> {
    match valid {
        true => Ok(()),
        false => Err(ModelError::Config { key, value: value.to_string(), expected: expected.into() }),
    }
}

/// Sizes that come from the data set, not from the configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dimensions {
    /// Active joints J: those with a skin weight on any garment.
    pub joints: usize,
    /// Shape coefficients S (β).
    pub shape: usize,
    /// Length P of the pose feature (θ).
    pub pose: usize,
}
