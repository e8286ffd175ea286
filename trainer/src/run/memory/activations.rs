//! What one step keeps of the networks and energies for its backward pass, counted from their operations.

use crate::config::{Config, StageConfig, Trains};
use crate::dataset::sizes::DataSizes;

// Values per vertex and channel, as the operations in `clothcombo_model` keep them.

/// A DiffusionNet block: its input, the gradient features and both hidden layers, and before them the three mixed gradients
/// along two axes.
const PER_BLOCK: f64 = 10.0;
/// A modulated sine layer: the product before the sine, its gate and its output.
const PER_SINE_LAYER: f64 = 3.0;
/// The product of all modulator layers with z_v, there until the forward pass ends.
const PER_MODULATOR_LAYER: f64 = 1.0;
/// A hidden layer of the skinning network: the product before GELU and its output.
const PER_SKINNING_LAYER: f64 = 2.0;
/// z_v: of every garment, and packed.
const PER_EMBEDDING: f64 = 2.0;
/// Per joint: weights, corrections, blended transforms.
const PER_JOINT: f64 = 5.0;
/// For the energies; fitted.
const ENERGIES_PER_VERTEX: f64 = 300.0;
/// The rest: buffers of the operation in work, gradients in transit, and gaps that the allocator leaves.
const ALLOCATOR_MARGIN: f64 = 1.1;

/// Bytes of a scene of `stage` at its peak, whose garments have `vertices` vertices, `embedded` of them in distinct garments.
pub(super) fn of_scene(
    config: &Config,
    stage: &StageConfig,
    joints: usize,
    [vertices, embedded]: [usize; 2],
) -> f64 {
    let embedding = if stage.trains.freezes() { 0.0 } else { per_embedded_vertex(config) };
    4.0 * ALLOCATOR_MARGIN
        * (embedding * embedded as f64 + per_vertex(config, stage, joints) * vertices as f64)
}

/// Bytes of the largest tensor of a step: the product of all modulator layers with the z_v of the largest outfit, or the mixed
/// gradients of its largest garment.
pub fn largest_tensor(config: &Config, sizes: &DataSizes) -> u64 {
    let m = &config.model;
    let layers = config.stages.iter().map(|stage| stage.layers[1]).max().unwrap_or(1);
    let outfit = sizes.largest(layers);
    let modulator = outfit.iter().sum::<usize>() * m.siren_layers * m.siren_width;
    let gradients = outfit.first().map_or(0, |largest| largest * 2 * 3 * m.diffusion_width);
    4 * modulator.max(gradients) as u64
}

/// Values per vertex of the embedding network.
fn per_embedded_vertex(config: &Config) -> f64 {
    let m = &config.model;
    PER_BLOCK * (m.diffusion_blocks * m.diffusion_width) as f64 + PER_EMBEDDING * m.embedding as f64
}

/// Values per vertex of a step of `stage`, the embedding apart.
fn per_vertex(config: &Config, stage: &StageConfig, joints: usize) -> f64 {
    let m = &config.model;
    let layers = (m.siren_layers * m.siren_width) as f64;
    let (sine, modulator) = (PER_SINE_LAYER * layers, PER_MODULATOR_LAYER * layers);
    let skinning =
        PER_SKINNING_LAYER * (m.skinning_layers * m.skinning_width) as f64 + PER_JOINT * joints as f64;
    // Of all bodies of a scene, and of the garments whatever the body.
    let (of_body, of_garments) = match stage.trains {
        Trains::Single | Trains::Draping => (sine + skinning, modulator),
        // The first stage is not trained: it keeps nothing for a backward pass.
        Trains::Untangling => (sine, 2.0 * modulator),
        Trains::All => (2.0 * sine + skinning, 2.0 * modulator),
    };
    of_garments + stage.bodies as f64 * (of_body + ENERGIES_PER_VERTEX)
}
