//! How much memory a run needs: estimated before it starts, measured while it runs.

use crate::config::{Config, StageConfig, Trains};
use crate::scene::Library;
use crate::train_loop::SCENES_AHEAD;

/// Memory of this process [bytes].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// In use now.
    pub resident: u64,
    /// Most that was ever in use, or since [`Memory::reset_peak`].
    pub peak: u64,
}

impl Memory {
    /// What the system says now; `None` where it does not (only Linux does, in `/proc/self/status`).
    pub fn now() -> Option<Self> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let field = |name: &str| -> Option<u64> {
            let line = status.lines().find_map(|l| l.strip_prefix(name))?;
            Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
        };
        Some(Self { resident: field("VmRSS:")?, peak: field("VmHWM:")? })
    }

    /// Makes the peak start again from what is in use now. Whether that worked (on Linux it does).
    pub fn reset_peak() -> bool {
        std::fs::write("/proc/self/clear_refs", "5").is_ok()
    }
}

/// Memory a run is expected to use at its peak [bytes].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryEstimate {
    /// In use before the first step: program, garments, networks.
    pub start: u64,
    /// Adam's moments, gradients and further copies of the parameters.
    pub parameters: u64,
    /// Operators of the garments as tensors.
    pub garments: u64,
    /// Prepared scenes: those of the next steps, and those of a validation.
    pub scenes: u64,
    /// What the largest scene, or several beside each other, take in networks and energies.
    pub activations: u64,
    /// All of it, or the peak so far where that is more.
    pub peak: u64,
}

/// Copies of the parameters that come on top of the networks themselves: two moments, the gradient, the new values beside
/// the old ones during an update, a frozen first stage, and one being written into a checkpoint.
const PARAMETER_COPIES: u64 = 6;

// Values per vertex that a step needs at its peak, fitted to measured peaks of runs in which one part was made wide
// (docs/runs.md); the networks' custom operations keep less than their formulas suggest.

/// Per channel of a DiffusionNet block.
const PER_BLOCK: f64 = 9.0;
/// Per channel of a modulated sine layer.
const PER_SINE_LAYER: f64 = 1.6;
/// Per channel of a hidden layer of the skinning network.
const PER_SKINNING_LAYER: f64 = 2.4;
/// Per channel of a correction network.
const PER_CORRECTION_LAYER: f64 = 12.0;
/// Per joint: weights, corrections, blended transforms.
const PER_JOINT: f64 = 5.0;
/// For the energies of a garment alone.
const PER_GARMENT_VERTEX: f64 = 300.0;
/// For the energies of a garment among others.
const PER_LAYER_VERTEX: f64 = 1100.0;
/// Bytes that drawing curves and samples takes, when no step is computed.
const PICTURES: u64 = 24 << 20;
/// Bytes per vertex and per triangle of a posed body ready for queries.
const BODY_VERTEX: usize = 90;
const BODY_TRIANGLE: usize = 100;
/// Scenes that a validation prepares at a time.
const VALIDATION_SCENES: usize = 16;

/// The estimate for a run of `config` whose networks have `parameters` numbers; called when everything is loaded.
pub fn estimate(config: &Config, library: &Library, parameters: usize) -> Option<MemoryEstimate> {
    let now = Memory::now()?;
    let parameters = 4 * parameters as u64 * (PARAMETER_COPIES + u64::from(config.optimizer.ema_decay > 0.0));
    let joints = library.joints().len();
    let of_garment = |v: usize| 4 * v * (4 * config.model.eigen_count + joints);
    let mut sizes: Vec<usize> =
        (0..library.wardrobe.len()).map(|i| library.wardrobe.card(i).vertices).collect();
    let garments = sizes.iter().map(|v| of_garment(*v)).sum::<usize>().min(library.memory_limit) as u64;

    let body = BODY_VERTEX * library.body.template.len() + BODY_TRIANGLE * library.body.faces.len();
    let bodies = config.stages.iter().map(|s| s.bodies * s.accumulate).max().unwrap_or(1);
    let validated =
        VALIDATION_SCENES.min(config.validation.single_scenes.max(config.validation.layered_scenes));
    let scenes = (body * ((SCENES_AHEAD + 2) * bodies + validated)) as u64;

    sizes.sort_unstable_by(|a, b| b.cmp(a));
    // A garment that is worn twice is embedded once.
    let embedded = |layers: usize| sizes.iter().take(layers).sum::<usize>() as f64;
    let worn = |layers: usize| sizes.iter().cycle().take(layers).sum::<usize>() as f64;
    let of_stage = |s: &StageConfig| {
        let embedding = if s.trains.freezes() { 0.0 } else { per_embedded_vertex(config) };
        let of_scene = embedding * embedded(s.layers[1]) + per_vertex(config, s, joints) * worn(s.layers[1]);
        // Scenes of a step are computed beside each other, one a thread.
        of_scene * s.accumulate.min(rayon::current_num_threads()) as f64
    };
    let activations = 4.0 * config.stages.iter().map(of_stage).fold(0.0, f64::max);
    let activations = activations as u64;
    let peak = (now.resident + parameters + garments + scenes + activations.max(PICTURES)).max(now.peak);
    Some(MemoryEstimate { start: now.resident, parameters, garments, scenes, activations, peak })
}

/// Values per vertex of the embedding network.
fn per_embedded_vertex(config: &Config) -> f64 {
    PER_BLOCK * (config.model.diffusion_blocks * config.model.diffusion_width) as f64
}

/// Values per vertex of a step of `stage`, the embedding apart.
fn per_vertex(config: &Config, stage: &StageConfig, joints: usize) -> f64 {
    let m = &config.model;
    let sine = PER_SINE_LAYER * (m.siren_layers * m.siren_width) as f64;
    let skinning =
        PER_SKINNING_LAYER * (m.skinning_layers * m.skinning_width) as f64 + PER_JOINT * joints as f64;
    let energies = if stage.layers[1] > 1 { PER_LAYER_VERTEX } else { PER_GARMENT_VERTEX };
    let networks = match stage.trains {
        Trains::Single => sine + skinning,
        // The first stage is not trained: it keeps nothing for a backward pass.
        Trains::Untangling => sine,
        Trains::All => 2.0 * sine + skinning,
        Trains::Corrections => PER_CORRECTION_LAYER * (m.corrections * m.correction_width) as f64,
    };
    stage.bodies as f64 * (networks + energies)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_system_says_how_much_is_in_use() {
        // Other tests of this process take and free memory meanwhile: only what is held here is sure.
        let block = vec![1_u8; 64 << 20];
        let now = Memory::now().unwrap();
        assert!(now.resident >= 60 << 20 && now.peak >= now.resident);
        assert_eq!(block.iter().map(|b| usize::from(*b)).sum::<usize>(), 64 << 20);
    }
}
