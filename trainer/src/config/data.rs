//! Where bodies, garments and poses come from, and the state the networks start from.

use crate::scene::{KeptBytes, LibraryError};
use clothcombo_data::asset::Category;
use clothcombo_data::cache::ArrayCache;
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
    pub garments: Vec<GarmentSource>,
    /// Garments of these names are never trained on, nor validated on during the run: they are for the final test.
    #[serde(default)]
    pub held_out_garments: Vec<String>,
    /// Shares of the other garments that are not trained on.
    #[serde(default)]
    pub split: SplitConfig,
    /// Where what is expensive to compute from a garment is kept between runs; without a folder it is computed at every
    /// start and kept in memory.
    #[serde(default)]
    pub cache: CacheConfig,
    /// Memory for what is kept of garments that are streamed from the cache [MiB]: meshes, energies and bindings and, on a CPU
    /// backend, their tensors and embeddings as well. Garments of the scenes in work count and always stay. More only saves
    /// reading and computing; 1 GiB holds 60 garments of 8,000 vertices. Without a cache all garments stay in memory.
    #[serde(default = "memory_mib")]
    pub memory_mib: usize,
    /// Memory on the device for tensors of garments (operators, skin weights) and their embeddings [MiB], with a cache or
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
    /// Share that is neither trained on nor scored during the run.
    pub test: f64,
}

/// The store of operators and bindings, shared by any number of runs and machines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CacheConfig {
    /// Folder, made if needed; none keeps everything in memory.
    pub folder: Option<PathBuf>,
    /// Largest size of the folder [GiB]; a garment of 8,000 vertices takes about 14 MiB with 128 eigenvectors.
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
pub struct GarmentSource {
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
    /// Clips whose name contains one of these are never trained on: validation on unseen motion.
    pub held_out_clips: Vec<String>,
    /// Share of every other clip that is never trained on, in blocks spread over the clip: validation on the trained kinds of
    /// motion. One block in every `1 / held_out_share`, rounded, at most every second one. A clip shorter than half of
    /// `held_out_block / held_out_share` is trained on whole.
    pub held_out_share: f64,
    /// Length of such a block [s]; long against the time in which a pose changes.
    pub held_out_block: f64,
    /// Mirror, interpolation between frames of any clips, exchange of limbs between frames, scaling of joints, noise.
    pub augmentation: bool,
    /// Training poses in which far-apart parts of the body run through each other are drawn again: the most length [m]
    /// of the curves of intersection that is let pass. 0.1 leaves a hand that brushes a thigh and takes out a forearm
    /// in the belly, where no garment can be draped. 10 or more looks at no pose and costs nothing.
    pub max_self_intersection: f64,
    /// Encoding of the pose as network input.
    pub encoding: PoseEncoding,
    /// Turn every pose to face +z: gravity and contact are blind to heading. Off feeds the full root rotation.
    pub remove_heading: bool,
}

impl Default for PoseConfig {
    fn default() -> Self {
        Self {
            motions: None,
            held_out_clips: Vec::new(),
            held_out_share: 0.1,
            held_out_block: 2.0,
            augmentation: true,
            max_self_intersection: 0.1,
            encoding: PoseEncoding::RotationMatrix,
            remove_heading: true,
        }
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
pub const MOST_GARMENTS: usize = 1_000_000;

impl DataConfig {
    /// Memory for what can be made again [bytes]; garments of a run without a cache cannot.
    pub(crate) fn memory_limits(&self) -> KeptBytes {
        let bytes = |mib: usize| mib.saturating_mul(1 << 20);
        let total = if self.cache.folder.is_some() { bytes(self.memory_mib) } else { usize::MAX };
        KeptBytes { total, device: bytes(self.device_memory_mib) }
    }

    /// The cache of the run, if it has one.
    ///
    /// # Errors
    /// When the folder cannot be used.
    pub(crate) fn open_cache(&self) -> Result<Option<ArrayCache>, LibraryError> {
        let limit = (self.cache.limit_gib * f64::from(1 << 30)) as u64;
        let open = |folder: &PathBuf| ArrayCache::open(folder, limit).map_err(LibraryError::data);
        self.cache.folder.as_ref().map(open).transpose()
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
        if !(self.poses.held_out_share > 0.0 && self.poses.held_out_share < 1.0) {
            return says("data.poses.held_out_share", "is not a share between 0 and 1", "for example 0.1");
        }
        if !(self.poses.held_out_block.is_finite() && self.poses.held_out_block > 0.0) {
            return says("data.poses.held_out_block", "is not a positive time", "for example 2.0 seconds");
        }
        if self.poses.max_self_intersection.is_nan() || self.poses.max_self_intersection < 0.0 {
            return says(
                "data.poses.max_self_intersection",
                "is not a length in metres",
                "for example 0.1; 10 lets every pose pass",
            );
        }
        for (i, source) in self.garments.iter().enumerate() {
            if let Some(g) = &source.generate
                && (g.count == 0
                    || g.count > MOST_GARMENTS
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
