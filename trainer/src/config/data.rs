//! Where bodies, garments and poses come from, and the state the networks start from.

use crate::system::lru_cache::KeptBytes;
use clothcombo_data::asset::Category;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Body, garments, poses.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataConfig {
    /// `"mannequin"` (built in), or the path of a body model in SMPL / SMPL-H / SMPL-X npz form.
    #[serde(default = "mannequin")]
    pub body: String,
    /// Shape components used; 0 takes all the body has.
    #[serde(default)]
    pub shape_components: usize,
    /// Every shape component is drawn uniformly from this range.
    #[serde(default = "shape_range")]
    pub shape_range: [f64; 2],
    /// Sources of garments, all used together.
    pub garments: Vec<GarmentSourceConfig>,
    /// Garments of these names are for the final test: never trained on, and read by no validation, no choice of the best
    /// checkpoint and no picture of a run. `clothcombo eval` reads them.
    #[serde(default)]
    pub held_out_garments: Vec<String>,
    /// Shares of the other garments that are not trained on.
    #[serde(default)]
    pub split: SplitConfig,
    /// Where what is expensive to compute from a garment is kept between runs; without a folder it is computed at every
    /// start and kept in memory.
    #[serde(default)]
    pub cache: CacheConfig,
    /// Memory for what is kept of garments that are streamed from the cache (MiB): meshes, energies and bindings and, on a CPU
    /// backend, their tensors and embeddings as well. Garments of the scenes in work count and always stay. More only saves
    /// reading and computing; 1 GiB holds 60 garments of 8,000 vertices. Without a cache all garments stay in memory.
    #[serde(default = "memory_mib")]
    pub memory_mib: usize,
    /// Memory on the device for tensors of garments (operators, skin weights) and their embeddings (MiB), with a cache or
    /// without; on a CPU backend a part of `memory_mib`. Those of the scene in work always fit. 4 GiB leaves 20 GiB of a card
    /// of 24 to the paper's networks and the largest of their scenes.
    #[serde(default = "device_memory_mib")]
    pub device_memory_mib: usize,
    /// Garments with more vertices than this are refused before training.
    #[serde(default = "max_vertices")]
    pub max_vertices: usize,
    /// Poses.
    #[serde(default)]
    pub poses: PoseConfig,
}

fn mannequin() -> String {
    "mannequin".into()
}
fn shape_range() -> [f64; 2] {
    [-2.0, 2.0]
}
fn max_vertices() -> usize {
    20_000
}
fn memory_mib() -> usize {
    1024
}
fn device_memory_mib() -> usize {
    4096
}

/// Shares of the garments that are not trained on. A garment goes by the hash of its name: it stays where it is when others
/// are added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SplitConfig {
    /// Share that is scored during the run but never trained on.
    pub validation: f64,
    /// Share that is for the final test, as `data.held_out_garments` is.
    pub test: f64,
}

/// The store of operators and bindings, shared by any number of runs and machines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CacheConfig {
    /// Folder, made if needed; none keeps everything in memory.
    pub folder: Option<PathBuf>,
    /// Largest size of the folder (GiB); a garment of 8,000 vertices takes about 14 MiB with 128 eigenvectors.
    pub limit_gib: f64,
}

impl Default for CacheConfig {
    fn default() -> Self {
        Self { folder: None, limit_gib: 100.0 }
    }
}

/// One source of garments: a folder, or the generator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GarmentSourceConfig {
    /// Folder of garments (OBJ, PLY, STL, glTF) with an optional `garments.toml`.
    #[serde(default)]
    pub folder: Option<PathBuf>,
    /// Garments made by the built-in generator.
    #[serde(default)]
    pub generate: Option<GenerateConfig>,
    /// Of these, only the garments of these names; empty takes all. One name makes a garment-specific model.
    #[serde(default)]
    pub only: Vec<String>,
}

/// Settings of the built-in generator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GenerateConfig {
    /// Number of garments; categories are taken in turn.
    pub count: usize,
    /// First seed; garment i uses seed + i.
    #[serde(default)]
    pub seed: u64,
    /// Categories, taken in turn.
    #[serde(default = "all_categories")]
    pub categories: Vec<Category>,
    /// Vertices per garment, about.
    #[serde(default = "thousand")]
    pub vertices: usize,
}

fn all_categories() -> Vec<Category> {
    Category::ALL.to_vec()
}
fn thousand() -> usize {
    1000
}

/// How a pose enters the networks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PoseEncoding {
    /// Rotation matrix minus identity, 9 numbers per joint: continuous, as in SMPL's pose feature.
    #[default]
    RotationMatrix,
    /// Axis times angle, 3 numbers per joint (the paper's θ).
    AxisAngle,
}

/// Poses and their augmentation.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PoseConfig {
    /// Folder of motion npz files; without it poses are drawn within joint limits.
    pub motions: Option<PathBuf>,
    /// Clips whose name contains one of these are never trained on; every validation of the run scores them.
    pub validation_clips: Vec<String>,
    /// Clips whose name contains one of these are for the final test: never trained on, and read by no validation, no choice
    /// of the best checkpoint and no picture of a run. `clothcombo eval` reads them.
    pub test_clips: Vec<String>,
    /// Names of `validation_clips` and `test_clips` that may fit no clip, for recordings that not everybody has; any other name
    /// that fits none is an error.
    pub optional_clips: Vec<String>,
    /// Share of every other clip that is never trained on, in windows spread over the clip, which every validation scores. One
    /// block of `held_out_block` in every `1 / held_out_share`, rounded, at most every second one. A clip shorter than half of
    /// `held_out_block / held_out_share` has no window. Where the windows hold out less than a quarter of the share, such short
    /// clips are held out whole until the share is reached (chosen by a hash of their names, at most a third of all by time).
    /// Where that holds none out, each clip has a window scaled to its length, of 0.1 s or more.
    pub held_out_share: f64,
    /// Length of such a window (s); long against the time in which a pose changes.
    pub held_out_block: f64,
    /// Time on both sides of such a window that is neither trained on nor validated (s). Frames next door show nearly the same
    /// pose; 1 s later a moving body is in another one. It is taken from the trained part.
    pub held_out_margin: f64,
    /// Mirror, interpolation between frames of any clips, exchange of limbs between frames, scaling of joints, noise.
    pub augmentation: bool,
    /// Training poses in which far-apart parts of the body run through each other are drawn again: the most length (m)
    /// of the curves of intersection that is let pass. 0.1 leaves a hand that brushes a thigh and takes out a forearm
    /// in the belly, where no garment can be draped. 10 or more looks at no pose and costs nothing.
    pub max_self_intersection: f64,
    /// Training poses are made once and kept in the cache instead of being drawn at every step. Without it they are recorded
    /// ones, augmented.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bank: Option<PoseBankConfig>,
    /// Encoding of the pose as network input.
    pub encoding: PoseEncoding,
    /// Turn every pose to face +z: gravity and contact are blind to heading. Off feeds the full root rotation.
    pub remove_heading: bool,
}

/// A bank of training poses and what it consists of; the shares sum to 1. Each is drawn again until it
/// intersects itself no more than `max_self_intersection`, at most 64 times; then the least intersecting one stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PoseBankConfig {
    /// Number of poses; 20,000 take about 6 ms each to make on one core, and 10 MB.
    pub size: usize,
    /// Share of recorded poses, augmented if `augmentation` is on.
    pub recorded: f64,
    /// Share of poses whose trunk, legs and arms come each from a kernel density over what was recorded of them.
    pub recombined: f64,
    /// Share of poses that are uniform within the limits of every joint.
    pub uniform: f64,
}

impl Default for PoseBankConfig {
    fn default() -> Self {
        Self { size: 20_000, recorded: 0.5, recombined: 0.3, uniform: 0.2 }
    }
}

impl PoseBankConfig {
    /// What is inconsistent: what and hint.
    fn problem(&self) -> Option<(&'static str, &'static str)> {
        let shares = [self.recorded, self.recombined, self.uniform];
        if self.size == 0 || self.size > MOST_BANK_POSES {
            return Some(("needs a size of 1 to 10000000 poses", "for example { size = 20000 }"));
        }
        let is_whole =
            shares.iter().all(|share| *share >= 0.0) && (shares.iter().sum::<f64>() - 1.0).abs() < 1e-6;
        (!is_whole).then_some((
            "needs shares of recorded, recombined and uniform poses that sum to 1",
            "for example { recorded = 0.5, recombined = 0.3, uniform = 0.2 }",
        ))
    }
}

impl Default for PoseConfig {
    fn default() -> Self {
        Self {
            motions: None,
            validation_clips: Vec::new(),
            test_clips: Vec::new(),
            optional_clips: Vec::new(),
            held_out_share: 0.1,
            held_out_block: 2.0,
            held_out_margin: 1.0,
            augmentation: true,
            max_self_intersection: 0.1,
            bank: None,
            encoding: PoseEncoding::RotationMatrix,
            remove_heading: true,
        }
    }
}

impl PoseConfig {
    /// One block in so many is held out.
    pub(crate) fn blocks_per_window(&self) -> usize {
        (1.0 / self.held_out_share).round().max(2.0) as usize
    }

    /// What is inconsistent, as (place, what, hint).
    fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((format!("data.poses.{p}"), w.into(), h.into()));
        if !(self.held_out_share > 0.0 && self.held_out_share < 1.0) {
            return says("held_out_share", "is not a share between 0 and 1", "for example 0.1");
        }
        if !(self.held_out_block.is_finite() && self.held_out_block > 0.0) {
            return says("held_out_block", "is not a positive time", "for example 2.0 seconds");
        }
        if !(self.held_out_margin.is_finite() && self.held_out_margin >= 0.0) {
            return says("held_out_margin", "is not a time", "for example 1.0 seconds; 0 leaves no margin");
        }
        let between = (self.blocks_per_window() - 1) as f64 * self.held_out_block;
        if self.motions.is_some() && 2.0 * self.held_out_margin >= between {
            return says(
                "held_out_margin",
                "leaves nothing to train on between two held-out windows",
                "shorten it, lengthen data.poses.held_out_block or lower data.poses.held_out_share: twice the margin must \
                 be less than held_out_block * (1 / held_out_share - 1)",
            );
        }
        let named = [("validation_clips", &self.validation_clips), ("test_clips", &self.test_clips)];
        if let Some((key, _)) =
            named.into_iter().find(|(_, clips)| self.motions.is_none() && !clips.is_empty())
        {
            return says(
                key,
                "names clips, but there are no motions",
                "name their folder: data.poses.motions",
            );
        }
        let is_held_out = |name: &String| named.iter().any(|(_, clips)| clips.contains(name));
        if let Some(name) = self.optional_clips.iter().find(|name| !is_held_out(name)) {
            return says(
                "optional_clips",
                &format!("has {name:?}, which is none of the names of validation_clips and test_clips"),
                "name it in one of them as well",
            );
        }
        if let Some(bank) = &self.bank {
            if self.motions.is_none() {
                return says("bank", "needs recorded poses", "name their folder: data.poses.motions");
            }
            if let Some((what, hint)) = bank.problem() {
                return says("bank", what, hint);
            }
        }
        if self.max_self_intersection.is_nan() || self.max_self_intersection < 0.0 {
            return says(
                "max_self_intersection",
                "is not a length in metres",
                "for example 0.1; 10 lets every pose pass",
            );
        }
        None
    }
}

/// The state the networks displace: the paper's is the rest garment with the nearest body vertex's skin weights.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartConfig {
    /// Smooth the initial skin weights over the garment.
    pub smooth_weights: bool,
    /// Laplacian iterations.
    pub smoothing_iterations: usize,
    /// Laplacian iterations for skirts and dresses, which span the gap between the legs.
    pub skirt_smoothing_iterations: usize,
    /// Add the body's smoothed shape displacement to the rest garment before draping.
    pub shape_transfer: bool,
}

impl Default for StartConfig {
    fn default() -> Self {
        Self {
            smooth_weights: true,
            smoothing_iterations: 30,
            skirt_smoothing_iterations: 100,
            shape_transfer: true,
        }
    }
}

/// Garments a generator is asked for at most.
pub const MOST_GENERATED_GARMENTS: usize = 1_000_000;

/// Poses a bank has at most: 5 GB.
const MOST_BANK_POSES: usize = 10_000_000;

impl DataConfig {
    /// Memory for what can be made again (bytes); garments of a run without a cache cannot.
    pub(crate) fn memory_limits(&self) -> KeptBytes {
        let bytes = |mib: usize| mib.saturating_mul(1 << 20);
        let total = if self.cache.folder.is_some() { bytes(self.memory_mib) } else { usize::MAX };
        KeptBytes { total, device: bytes(self.device_memory_mib) }
    }

    /// Largest size of the cache (bytes).
    pub(crate) fn cache_limit(&self) -> u64 {
        (self.cache.limit_gib * f64::from(1 << 30)) as u64
    }

    /// What is inconsistent, as (place, what, hint).
    pub(crate) fn problem(&self) -> Option<(String, String, String)> {
        let says = |p: &str, w: &str, h: &str| Some((p.into(), w.into(), h.into()));
        let [low, high] = self.shape_range;
        if !(low.is_finite() && high.is_finite() && low <= high) {
            return says("data.shape_range", "is not a range [low, high]", "the paper uses [-2.0, 2.0]");
        }
        let SplitConfig { validation, test } = self.split;
        if !(validation >= 0.0 && test >= 0.0 && validation + test < 1.0) {
            return says(
                "data.split",
                "is not two shares that leave something to train on",
                "for example 0.1 and 0.1",
            );
        }
        if !(self.cache.limit_gib.is_finite() && self.cache.limit_gib > 0.0) {
            return says("data.cache.limit_gib", "is not a positive size", "for example 100.0");
        }
        for (key, mib) in
            [("data.memory_mib", self.memory_mib), ("data.device_memory_mib", self.device_memory_mib)]
        {
            if mib == 0 {
                return says(key, "must be at least 1", "for example 1024");
            }
        }
        if let Some(problem) = self.poses.problem() {
            return Some(problem);
        }
        for (i, source) in self.garments.iter().enumerate() {
            if let Some(g) = &source.generate
                && (g.count == 0
                    || g.count > MOST_GENERATED_GARMENTS
                    || g.categories.is_empty()
                    || !(200..=50_000).contains(&g.vertices))
            {
                return Some((
                    format!("data.garments[{i}].generate"),
                    "needs 1 to 1000000 garments, at least one category, and 200 to 50000 vertices".into(),
                    "for example { count = 12, vertices = 1000 }".into(),
                ));
            }
        }
        None
    }
}
