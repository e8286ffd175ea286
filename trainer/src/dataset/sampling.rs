//! Which garments, body shapes and poses a step uses: a pure function of the seed and the step.
//!
//! Every step reads its own stream of the generator, so nothing has to be stored to resume, and drawing ahead on
//! another thread changes nothing.

use super::contents::Dataset;
use super::poses::HeldOut;
use crate::config::{StageConfig, ValidationConfig};
use clothcombo_data::asset::Pose;
use rand::RngExt;
use rand::SeedableRng;
use rand::seq::index;
use rand_chacha::ChaCha8Rng;

/// One body of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct BodySample {
    /// Shape parameters β.
    pub shape: Vec<f64>,
    /// Pose θ, as the networks see it: facing +z unless `data.poses.remove_heading` is off.
    pub pose: Pose,
}

/// Garments from the innermost to the outermost, and the bodies they are draped on.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSample {
    /// Indices into the dataset, inner → outer.
    pub garments: Vec<usize>,
    /// Garments worn below all of them that are not draped: only their thickness counts.
    pub below: Vec<usize>,
    /// Bodies.
    pub bodies: Vec<BodySample>,
    /// Number of the random sample of pairs that the repulsion looks at (`losses.repulsion.subset`): another one in every
    /// training scene, so that in the long run all pairs count.
    pub repulsion_sample: u32,
}

/// The part of the schedule a sample depends on.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// The stage.
    pub stage: &'a StageConfig,
    /// Fraction of the stage done, 0–1.
    pub progress: f64,
}

/// Streams from here on belong to validation; training uses the step number.
const VALIDATION_STREAM: u64 = 1 << 62;

fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

fn garments(pool: &[usize], count: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    if count <= pool.len() {
        index::sample(rng, pool.len(), count).into_iter().map(|i| pool[i]).collect()
    } else {
        (0..count).map(|_| pool[rng.random_range(0..pool.len())]).collect()
    }
}

fn shape(dataset: &Dataset, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let [low, high] = dataset.shape_range;
    (0..dataset.shape_count).map(|_| low + (high - low) * rng.random::<f64>()).collect()
}

/// A scene that is scored: always by the same sample of pairs.
fn scored(garments: Vec<usize>, body: BodySample) -> SceneSample {
    SceneSample { garments, below: Vec::new(), bodies: vec![body], repulsion_sample: 0 }
}

/// Streams of the further scenes of a step lie this far apart; a run has fewer steps.
const FURTHER_SCENE: u64 = 1 << 48;

/// Scene number `scene` (from 0) of training step `step`.
pub fn sample_training(dataset: &Dataset, seed: u64, step: u64, scene: usize, plan: Plan) -> SceneSample {
    let mut rng = generator(seed, step + scene as u64 * FURTHER_SCENE);
    let [low, high] = plan.stage.layers_at(plan.progress);
    let layers = rng.random_range(low..=high);
    // The place of the garments in an outfit: as many below as there would be.
    let below = match plan.stage.below {
        0 => 0,
        most => {
            let outfit = rng.random_range(1..=most + 1);
            rng.random_range(0..outfit)
        }
    };
    let mut garments = garments(&dataset.split.training, below + layers, &mut rng);
    let below = garments.drain(..below).collect();
    let scale = plan.stage.pose_scale.at(plan.progress);
    let bodies = (0..plan.stage.bodies)
        .map(|_| BodySample {
            shape: shape(dataset, &mut rng),
            pose: dataset.poses.sample_training(scale, &mut rng),
        })
        .collect();
    SceneSample { garments, below, bodies, repulsion_sample: rng.random() }
}

/// Scenes of an evaluation lie behind the validation groups.
const EVALUATION_STREAM: u64 = VALIDATION_STREAM + (32 << 32);

/// Scene `index` of block `stream` of an evaluation's random streams: `layers` garments of `pool` in random order, on a body in a
/// pose of `poses`.
pub fn sample_evaluation(
    dataset: &Dataset,
    seed: u64,
    [stream, index]: [usize; 2],
    pool: &[usize],
    layers: usize,
    poses: HeldOut,
) -> SceneSample {
    let mut rng = generator(seed, EVALUATION_STREAM + ((stream as u64) << 32) + index as u64);
    // The body first: with it, two datasets get the same bodies.
    let body =
        BodySample { shape: shape(dataset, &mut rng), pose: dataset.poses.sample_held_out(poses, &mut rng) };
    scored(garments(pool, layers, &mut rng), body)
}

/// What a validation scene is sampled for. No group samples a garment or a clip of the test set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValidationGroup {
    /// One trained garment, held-out windows of the trained clips.
    Single,
    /// One trained garment, validation clips.
    UnseenMotion,
    /// One validation garment, held-out windows of the trained clips.
    UnseenGarment,
    /// Several layers of trained garments, held-out windows of the trained clips.
    Layered,
}

impl ValidationGroup {
    /// All groups, in the order they are scored.
    pub const ALL: [Self; 4] = [Self::Single, Self::UnseenMotion, Self::UnseenGarment, Self::Layered];

    /// Its block of random streams; numbers stay with their group, so that a new group changes no other group's scenes.
    fn stream(self) -> u64 {
        match self {
            Self::Single => 0,
            Self::UnseenMotion => 1,
            Self::Layered => 2,
            Self::UnseenGarment => 3,
        }
    }

    /// Name in tables and logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single garments",
            Self::UnseenMotion => "single garments, validation clips",
            Self::UnseenGarment => "single validation garments",
            Self::Layered => "layered outfits",
        }
    }
}

/// Of `count` scenes, which of `of` garments scene `i` is about: all in turn, or evenly spread ones where there are more
/// garments than scenes.
pub fn round_robin(i: usize, count: usize, of: usize) -> usize {
    if count < of { i * of / count } else { i % of }
}

/// The fixed validation scenes of `group`; garments in turn, layer counts in turn.
pub fn sample_validation(
    dataset: &Dataset,
    seed: u64,
    config: &ValidationConfig,
    group: ValidationGroup,
) -> Vec<SceneSample> {
    let (count, poses) = match group {
        ValidationGroup::Single => (config.single_scenes, HeldOut::Windows),
        ValidationGroup::UnseenMotion => (config.unseen_scenes, HeldOut::ValidationClips),
        ValidationGroup::UnseenGarment => (config.unseen_garment_scenes, HeldOut::Windows),
        ValidationGroup::Layered => (config.layered_scenes, HeldOut::Windows),
    };
    let is_without = group == ValidationGroup::UnseenGarment && dataset.split.validation.is_empty();
    let count = if is_without || !dataset.poses.has(poses) { 0 } else { count };
    let one = |pool: &[usize], i: usize| vec![pool[round_robin(i, count, pool.len())]];
    (0..count)
        .map(|i| {
            let mut rng = generator(seed, VALIDATION_STREAM + (group.stream() << 32) + i as u64);
            let garments = match group {
                ValidationGroup::Layered => {
                    let [low, high] = config.layers;
                    garments(&dataset.split.training, low + i % (high - low + 1), &mut rng)
                }
                ValidationGroup::UnseenGarment => one(&dataset.split.validation, i),
                ValidationGroup::Single | ValidationGroup::UnseenMotion => one(&dataset.split.training, i),
            };
            let pose = dataset.poses.sample_held_out(poses, &mut rng);
            scored(garments, BodySample { shape: shape(dataset, &mut rng), pose })
        })
        .collect()
}

#[cfg(test)]
mod tests;
