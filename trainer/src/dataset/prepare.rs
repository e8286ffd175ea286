//! Turns a sample into numbers: posed body, bone transforms, start positions, and the scene's energies.

use super::active_joints::ActiveJoints;
use super::contents::Dataset;
use super::error::DatasetError;
use super::pose_features::joint_features;
use super::prepared_garment::PreparedGarment;
use super::sampling::{BodySample, SceneSample};
use super::skinning::skinning_transforms;
use crate::config::{LossesConfig, PoseEncoding};
use crate::dataset::objective::scene_weights;
use clothcombo_data::asset::Body;
use clothcombo_model::{Graph, OutfitTensors, Packing};
use clothcombo_physics::energy::{EnergySettings, SceneEnergy, SceneGarment, SceneLayers};
use clothcombo_physics::query::Surface;
use clothcombo_physics::transform::{self, Transform};
use std::sync::Arc;

/// One body of a prepared scene, with the garments' state on it; garments are packed inner → outer.
pub struct PreparedBody {
    /// Shape parameters, `[S]`.
    pub shape: Vec<f32>,
    /// Pose features of the active joints, `[P]`.
    pub pose: Vec<f32>,
    /// World transforms of the active joints relative to the T-pose.
    pub bones: Vec<[[f64; 4]; 3]>,
    /// What each active joint knows of the pose around it, `[J, 30]`.
    pub joint_features: Vec<f32>,
    /// Canonical start positions of all garments, in their order, `[ΣV, 3]`.
    pub start: Vec<[f32; 3]>,
    /// The losses of this scene.
    pub energy: Arc<SceneEnergy<f32>>,
}

/// A scene ready for a step.
pub struct PreparedScene {
    /// What was sampled.
    pub sample: SceneSample,
    /// The garments themselves.
    pub garments: Vec<Arc<PreparedGarment>>,
    /// Pairs (inner, outer) of positions in `garments` that interact: those of [`contacts`].
    pub contacts: Vec<(usize, usize)>,
    /// Thickness of the garments below every vertex `[ΣV]` (m); empty where there is none, or the networks do not ask.
    pub thickness_below: Vec<f32>,
    /// Bodies.
    pub bodies: Vec<PreparedBody>,
    /// Weight of the losses of single garments, in addition to those of the outfit.
    pub single_garments: f64,
}

impl PreparedScene {
    /// What of `packed`, one value per vertex of all garments inner → outer, belongs to each garment.
    pub fn parts<'a, T>(&self, packed: &'a [T]) -> Vec<&'a [T]> {
        Packing::new(self.garments.iter().map(|garment| garment.vertex_count())).parts(packed)
    }

    /// Initial skinning of every vertex on the first body, canonical → posed, `[ΣV]`.
    pub fn skinning_transforms(&self) -> Vec<Transform> {
        skinning_transforms(&self.garments, &self.bodies[0].bones)
    }

    /// Linear blend skinning of the start state on the first body (m), `[ΣV]`, by its `transforms`
    /// ([`skinning_transforms`](Self::skinning_transforms)).
    pub fn skinned_start(&self, transforms: &[Transform]) -> Vec<[f64; 3]> {
        let start = self.bodies[0].start.iter().map(|p| p.map(f64::from));
        transforms.iter().zip(start).map(|(t, p)| transform::apply(t, p)).collect()
    }

    /// The energy on `body` of every garment by itself, those below it being part of the body.
    pub fn energy_of_singles(&self, body: &PreparedBody) -> SceneEnergy<f32> {
        let mut energy = body.energy.without_layers();
        if !self.thickness_below.is_empty() {
            let below = self.parts(&self.thickness_below);
            let garments = energy.garments.iter_mut().zip(below);
            garments.for_each(|(garment, below)| garment.thickness_below = below.to_vec());
        }
        energy
    }

    /// Thickness of what of that is no garment of the scene `[ΣV]` (m); empty where nothing is.
    pub fn thickness_of_unseen(&self) -> Vec<f32> {
        let garments = &self.bodies[0].energy.garments;
        garments.iter().flat_map(|garment| &garment.thickness_below).copied().collect()
    }

    /// The first body in f64, for exact distances and intersections.
    pub fn exact_body(&self) -> Surface<f64> {
        let body = &self.bodies[0].energy.body;
        Surface::new(body.positions.iter().map(|p| p.map(f64::from)).collect(), body.faces.clone())
    }
}

/// Two garments whose rest bounding boxes are farther apart than this are not near (m).
const CONTACT_MARGIN: f64 = 0.05;

/// Prepares `sample`; loss weights are taken at `run_progress`.
///
/// # Errors
/// [`DatasetError`] when a garment cannot be read.
pub fn prepare(
    dataset: &Dataset,
    losses: &LossesConfig,
    sample: SceneSample,
    run_progress: f64,
) -> Result<PreparedScene, DatasetError> {
    let read = |indices: &[usize]| -> Result<Vec<Arc<PreparedGarment>>, DatasetError> {
        indices.iter().map(|&g| dataset.garments.garment(g)).collect()
    };
    let (garments, below) = (read(&sample.garments)?, read(&sample.below)?);
    let builder = SceneBuilder {
        body: &dataset.body,
        joints: dataset.joints(),
        encoding: dataset.poses.encoding,
        losses,
        graph: dataset.graph,
        layer_thickness: dataset.layer_thickness,
    };
    Ok(builder.build(sample, &builder.arrange(garments, &below), run_progress))
}

/// Everything but the garments and the bodies that a scene is prepared with.
pub struct SceneBuilder<'a> {
    /// The body model.
    pub body: &'a Body,
    /// The joints the networks see.
    pub joints: &'a ActiveJoints,
    /// How the networks see a pose.
    pub encoding: PoseEncoding,
    /// The losses.
    pub losses: &'a LossesConfig,
    /// Which garments have layer losses with each other.
    pub graph: Graph,
    /// How thick a garment is for those above it (m), if the networks ask.
    pub layer_thickness: Option<f64>,
}

/// Garments, inner → outer, and how they lie over each other: the same on every body.
pub struct Arrangement {
    garments: Vec<Arc<PreparedGarment>>,
    /// Thickness below each vertex of each garment of what is no garment of the scene (m); empty where nothing is.
    unseen: Vec<Vec<f32>>,
    /// Pairs (inner, outer) that interact.
    pub contacts: Vec<(usize, usize)>,
    /// Thickness of the garments below every vertex `[ΣV]` (m); empty where there is none, or the networks do not ask.
    pub thickness_below: Vec<f32>,
}

impl SceneBuilder<'_> {
    /// Arranges `garments` that lie over those `below`.
    pub fn arrange(
        &self,
        garments: Vec<Arc<PreparedGarment>>,
        below: &[Arc<PreparedGarment>],
    ) -> Arrangement {
        let contacts = contacts(self.graph, &garments);
        // What is there as geometry pushes as geometry.
        let unseen = |garment: &Arc<PreparedGarment>| match self.layer_thickness.filter(|_| !below.is_empty())
        {
            Some(each) => garment.thickness_of(&below.iter().collect::<Vec<_>>(), self.body, each),
            None => Vec::new(),
        };
        let unseen: Vec<Vec<f32>> = garments.iter().map(unseen).collect();
        let each = self.layer_thickness;
        let thickness_below =
            each.map_or_else(Vec::new, |each| thickness_below(&garments, below, self.body, each));
        Arrangement { garments, unseen, contacts, thickness_below }
    }

    /// Prepares `sample` of the garments of `arrangement`; loss weights are taken at `run_progress`.
    ///
    /// # Panics
    /// If a shape or pose is longer than the body allows.
    pub fn build(&self, sample: SceneSample, arrangement: &Arrangement, run_progress: f64) -> PreparedScene {
        let settings =
            EnergySettings { repulsion_sample: sample.repulsion_sample, ..self.losses.energy_settings() };
        let on_body = |body| self.on_body(arrangement, body, &settings, run_progress);
        let bodies = sample.bodies.iter().map(on_body).collect();
        PreparedScene {
            sample,
            garments: arrangement.garments.clone(),
            contacts: arrangement.contacts.clone(),
            thickness_below: arrangement.thickness_below.clone(),
            bodies,
            single_garments: self.losses.single_garments.at(run_progress),
        }
    }

    fn on_body(
        &self,
        Arrangement { garments, unseen, contacts, .. }: &Arrangement,
        body: &BodySample,
        settings: &EnergySettings,
        run_progress: f64,
    ) -> PreparedBody {
        let Self { losses, .. } = self;
        let posed = self.body.posed(&body.shape, &body.pose);
        let posed = posed.expect("shapes and poses have the body's own dimensions");
        let surface = Surface::new(
            posed.positions.iter().map(|p| p.map(|v| v as f32)).collect(),
            self.body.faces.clone(),
        );
        let bones: Vec<Transform> = self.joints.indices.iter().map(|&j| posed.bones[j]).collect();
        let starts: Vec<Vec<[f32; 3]>> = garments.iter().map(|g| g.start_positions(&body.shape)).collect();
        let counts: Vec<usize> = garments.iter().map(|g| g.vertex_count()).collect();
        let weights = scene_weights(losses, run_progress, &counts, contacts);
        let scene_garments = garments
            .iter()
            .zip(&starts)
            .zip(unseen)
            .zip(weights.garments)
            .map(|(((g, start), below), weights)| SceneGarment {
                energies: g.energies.clone(),
                holding_reference: match losses.holding.relative {
                    true => start.clone(),
                    false => g.garment.rest.positions().iter().map(|p| p.map(|v| v as f32)).collect(),
                },
                pull_back: None,
                thickness_below: below.clone(),
                weights,
            })
            .collect();
        let layers = contacts
            .iter()
            .zip(weights.layers)
            .map(|(&(inner, outer), weights)| SceneLayers { inner, outer, weights })
            .collect();
        let mut energy =
            SceneEnergy { body: Arc::new(surface), garments: scene_garments, layers, settings: *settings };
        if losses.holding.posed {
            energy = energy.pulled_back(&skinning_transforms(garments, &bones));
        }
        let start = starts.concat();
        PreparedBody {
            shape: body.shape.iter().map(|v| *v as f32).collect(),
            pose: self.encoding.features(&body.pose, &self.joints.indices),
            joint_features: joint_features(&bones, &self.joints.parents),
            bones,
            start,
            energy: Arc::new(energy),
        }
    }
}

/// Thickness (m) of the garments below every vertex of `garments`, inner → outer `[ΣV]`: of those `below` them all and of those
/// nearer to the body, `each` as thick; empty where nothing is.
fn thickness_below(
    garments: &[Arc<PreparedGarment>],
    below: &[Arc<PreparedGarment>],
    body: &Body,
    each: f64,
) -> Vec<f32> {
    if garments.len() + below.len() < 2 {
        return Vec::new();
    }
    let inside: Vec<_> = below.iter().chain(garments).collect();
    let of = |(i, garment): (usize, &Arc<PreparedGarment>)| {
        garment.thickness_of(&inside[..below.len() + i], body, each)
    };
    garments.iter().enumerate().flat_map(of).collect()
}

/// Pairs (inner, outer) of `garments`, inner → outer, that interact: all in the full graph, else those whose rest boxes are near
/// enough for them ever to touch.
fn contacts(graph: Graph, garments: &[Arc<PreparedGarment>]) -> Vec<(usize, usize)> {
    let mut pairs = OutfitTensors::all_pairs(garments.len());
    if graph == Graph::Near {
        pairs.retain(|&(i, j)| are_near(&garments[i], &garments[j]));
    }
    pairs
}

fn are_near(a: &PreparedGarment, b: &PreparedGarment) -> bool {
    let [(a_low, a_high), (b_low, b_high)] = [a, b].map(|g| g.garment.rest.bounds());
    (0..3).all(|k| a_low[k] - CONTACT_MARGIN <= b_high[k] && b_low[k] - CONTACT_MARGIN <= a_high[k])
}

#[cfg(test)]
mod tests;
