//! The memory a run is expected to use.

use super::activations::of_scene;
use crate::config::{Config, StageConfig};
use crate::dataset::sizes::{DataSizes, operator_bytes};
use crate::dataset::{GARMENTS_AT_ONCE, SCENES_AHEAD};
use crate::system::device::scenes_at_once;

/// Memory a run is expected to use at its peak (bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryEstimate {
    /// Host: program, body, list of garments, networks as they are made.
    pub program: u64,
    /// Host: garments that are kept (meshes, energies, bindings).
    pub garments: u64,
    /// Host: DiffusionNet's operators, of all garments without a cache, otherwise none.
    pub operators: u64,
    /// Host: scenes prepared for the next steps, their garments apart.
    pub scenes: u64,
    /// Host: the preparation of garments at the start, when there are no scenes yet.
    pub preparation: u64,
    /// Device: tensors of garments and their embeddings that are kept.
    pub tensors: u64,
    /// Device: copies of the parameters beside the networks: Adam's moments, those of frozen networks, a running average.
    pub parameters: u64,
    /// Host: the drawing of curves and samples. The allocator keeps it beside what steps use.
    pub pictures: u64,
    /// Device: what the largest scene, or several in parallel, keep of networks and energies for the backward pass; or the
    /// update of the parameters or the scenes of a validation, where one of these takes more.
    pub step: u64,
    /// What the garments of the whole dataset would take on the host, if all were kept.
    pub all_garments: u64,
    /// What their tensors and embeddings would take on the device.
    pub all_tensors: u64,
    /// Whether the device is the processor, whose memory is the host's.
    pub is_processor: bool,
}

/// Adam's moments: copies of the parameters that are always there.
const MOMENTS: u64 = 2;
/// Copies during an update or a checkpoint, when the backward pass is done: the gradient, the new values beside the old ones,
/// and what is being written.
const UPDATE_COPIES: u64 = 3;
/// The program itself.
const PROGRAM: u64 = 20 << 20;
/// Curves: a picture of two million pixels, and the canvas it is drawn on.
const CURVES: u64 = 16 << 20;
/// A row of samples on its sheet, with the canvas and the renders it is put together from.
const SAMPLE_ROW: u64 = 6 << 20;
/// Bytes per vertex and per triangle of a posed body ready for queries.
const BODY_VERTEX: usize = 90;
const BODY_TRIANGLE: usize = 100;
/// Bodies of a validation besides, as a share: in f64, for exact distances; fitted.
const EXACT_BODIES: f64 = 1.5;
/// Bytes per vertex of a garment in a prepared scene.
const SCENE_VERTEX: usize = 32;
/// Bytes per vertex and eigenpair while operators are computed, and per vertex besides; fitted.
const PREPARED_PAIR: usize = 96;
const PREPARED_VERTEX: usize = 3000;

impl MemoryEstimate {
    /// For a run of `config` on data of these sizes, whose networks have `parameters` numbers, on a processor or on a device
    /// with memory of its own.
    pub fn new(config: &Config, sizes: &DataSizes, parameters: usize, is_processor: bool) -> Self {
        let streams = config.data.cache.folder.is_some();
        let limits = config.data.memory_limits();
        let network = 4 * parameters as u64;
        let threads = rayon::current_num_threads();
        let at_once = |s: &StageConfig| s.accumulate.min(scenes_at_once(is_processor));

        let layers = config.stages.iter().map(|s| s.layers[1]).max().unwrap_or(1);
        let garments_of = |s: &StageConfig| s.accumulate * s.layers[1];
        let ahead = (SCENES_AHEAD + 2) * config.stages.iter().map(garments_of).max().unwrap_or(1);
        // Scenes that a validation prepares at a time, and their garments.
        let v = &config.validation;
        let validated = [(v.single_scenes, 1), (v.unseen_scenes, 1), (v.layered_scenes, v.layers[1])]
            .map(|(scenes, layers)| (scenes.min((GARMENTS_AT_ONCE / layers.max(1)).max(1)), layers));
        let validated_scenes = validated.iter().map(|(scenes, _)| *scenes).max().unwrap_or(0);
        let validated = validated.iter().map(|(scenes, layers)| scenes * layers).max().unwrap_or(0);
        let of_garment = |v: usize| sizes.garment_bytes(config, v);
        let bytes_of = |count: usize, bytes: &dyn Fn(usize) -> usize| -> u64 {
            sizes.largest(count).iter().map(|v| bytes(*v) as u64).sum()
        };
        let all_garments = sizes.sum(of_garment);
        // What scenes in work use stays.
        let in_use = bytes_of((ahead + validated).min(sizes.vertices.len()), &of_garment);
        let limit = (limits.total as u64).max(in_use);
        let garments = if streams { all_garments.min(limit) } else { all_garments };

        // Embeddings by frozen networks, of all garments; and of those that a validation meets.
        let freezes = config.stages.iter().any(|s| s.trains.freezes());
        let met = v.single_scenes + v.unseen_scenes + v.layered_scenes * v.layers.iter().sum::<usize>() / 2;
        let met = 1.0 - (-(met as f64) / sizes.vertices.len().max(1) as f64).exp();
        let frozen = f64::from(u8::from(freezes));
        let of_tensors = |v: usize| sizes.device_bytes(config, v, met + frozen);
        let all_tensors = sizes.sum(|v| sizes.device_bytes(config, v, 1.0 + frozen));
        let of_step = bytes_of(layers.min(sizes.vertices.len()), &of_tensors);
        let left = if is_processor && streams { limit - garments } else { u64::MAX };
        let tensors = sizes.sum(of_tensors).min(left.min(limits.device as u64).max(of_step));

        let bodies = config.stages.iter().map(|s| s.bodies * s.accumulate).max().unwrap_or(1);
        let body = BODY_VERTEX * sizes.body_vertices + BODY_TRIANGLE * sizes.body_faces;
        let scenes = (body * (SCENES_AHEAD + 2) * bodies) as u64 + bytes_of(ahead, &|v| SCENE_VERTEX * v);
        let validated_bodies = (EXACT_BODIES * (body * validated_scenes) as f64) as u64;
        let validation = validated_bodies + bytes_of(validated, &|v| SCENE_VERTEX * v);
        let sample_rows: usize = [v.single_scenes, v.layered_scenes]
            .iter()
            .map(|scenes| config.output.sample_scenes.min(*scenes))
            .sum();
        let prepared = |v: usize| v * (PREPARED_PAIR * config.model.eigen_count + PREPARED_VERTEX);

        let of_stage = |s: &StageConfig| {
            let vertices = sizes.largest(s.layers[1]).iter().sum::<usize>();
            // A garment that occurs twice is embedded once.
            let embedded = sizes.largest(s.layers[1].min(sizes.vertices.len())).iter().sum();
            of_scene(config, s, sizes.joints, [vertices, embedded]) * at_once(s) as f64
        };
        let activations = config.stages.iter().map(of_stage).fold(0.0, f64::max) as u64;
        let gradients = config.stages.iter().map(at_once).max().unwrap_or(1) as u64 - 1;
        let copies = MOMENTS + gradients + u64::from(freezes) + u64::from(config.optimizer.ema_decay > 0.0);
        Self {
            program: PROGRAM + sizes.lasting_bytes() + network,
            garments,
            operators: if streams { 0 } else { sizes.sum(|v| operator_bytes(config, v)) },
            scenes,
            preparation: bytes_of(threads.min(sizes.vertices.len()), &prepared),
            tensors,
            parameters: network * copies,
            pictures: CURVES + SAMPLE_ROW * sample_rows as u64,
            step: activations.max(UPDATE_COPIES * network).max(validation.saturating_sub(scenes)),
            all_garments,
            all_tensors,
            is_processor,
        }
    }

    /// The same with `resident` bytes in use now that everything is loaded and no step was taken.
    pub fn after_start(self, resident: u64, streams: bool) -> Self {
        let loaded = if streams { 0 } else { self.garments + self.operators };
        Self { program: resident.saturating_sub(loaded), ..self }
    }

    /// On the host, but for what is on the device.
    pub fn host(&self) -> u64 {
        let loaded = self.program + self.garments + self.operators;
        loaded + self.pictures + self.scenes.max(self.preparation.saturating_sub(self.garments))
    }

    /// On the device.
    pub fn device(&self) -> u64 {
        self.tensors + self.parameters + self.step
    }

    /// In this process's memory.
    pub fn peak(&self) -> u64 {
        if self.is_processor { self.host() + self.device() } else { self.host() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;
    use crate::run::memory::largest_tensor;
    use std::path::Path;

    fn paper(more: &[&str]) -> Config {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/paper.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let more: Vec<String> = more.iter().map(|o| (*o).to_owned()).collect();
        parse(&text, &path, &more).unwrap()
    }

    /// Of networks of the paper's size.
    const PARAMETERS: usize = 35_000_000;
    const GIB: u64 = 1 << 30;

    #[test]
    fn the_paper_fits_a_card_of_24_gib_and_a_machine_of_64() {
        let config = paper(&["data.cache.folder=\"cache\""]);
        let sizes = DataSizes::assumed(4300, 8000, 300);
        let gpu = MemoryEstimate::new(&config, &sizes, PARAMETERS, false);
        assert!(gpu.host() < 60 * GIB && gpu.device() < 22 * GIB, "{gpu:?}");
        assert!(gpu.all_garments > 35 * GIB && gpu.all_tensors > 100 * GIB, "{gpu:?}");
        assert!(gpu.step > 8 * GIB, "six garments of 8,000 vertices at width 512: {gpu:?}");
        assert_eq!(largest_tensor(&config, &sizes), 6 * 8000 * 6 * 512 * 4);
        let cpu = MemoryEstimate::new(&config, &sizes, PARAMETERS, true);
        assert!(cpu.peak() < 60 * GIB && cpu.garments + cpu.tensors < 2 * GIB, "{cpu:?}");
    }

    #[test]
    fn memory_of_a_streamed_wardrobe_does_not_grow_with_it_and_that_of_a_kept_one_does() {
        let of = |config: &Config, garments| {
            let sizes = DataSizes::assumed(garments, 8000, 300);
            MemoryEstimate::new(config, &sizes, PARAMETERS, false)
        };
        let streamed = paper(&["data.cache.folder=\"cache\""]);
        let (few, many) = (of(&streamed, 1000), of(&streamed, 8000));
        assert!(many.host() - few.host() < 7000 * 2048, "only the list of garments");
        assert_eq!(many.device(), few.device());
        let mut kept = streamed.clone();
        kept.data.cache.folder = None;
        assert!(of(&kept, 4300).host() > 80 * GIB);
        // Shape transfer stores all components of every garment; without it there is nothing to store.
        let mut transferred = paper(&["start.shape_transfer=true"]);
        transferred.data.cache.folder = None;
        let more = of(&transferred, 4300).garments - of(&kept, 4300).garments;
        assert_eq!(more, 4300 * 8000 * 3 * 300 * 4);
    }
}
