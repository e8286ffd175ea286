//! A trained model with the data it is asked about.

use super::table::number;
use crate::config::Config;
use crate::dataset::{Dataset, HeldOut, PreparedScene, SceneSample, prepare, sample_evaluation};
use crate::evaluation::{SceneScore, score_scene};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::{DrapeError, TensorStore};
use crate::run::checkpoint::TrainedModel;
use burn::tensor::Device;
use clothcombo_model::ClothCombo;
use clothcombo_physics::contact::{
    self, Intersections, LayerOrder, PosedBody, ReportGarment, Selection, all_layers, self_collision,
};
use clothcombo_physics::energy::{EnergySettings, SceneEnergy, SceneLayers, Term, TermMap};
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::{Distance, Surface};
use miette::Report;
use rayon::prelude::*;
use std::sync::Arc;

/// A trained model, its configuration and its data.
pub struct Subject {
    /// Losses, data and seed.
    pub config: Config,
    /// The data.
    pub dataset: Arc<Dataset>,
    /// Its tensors.
    pub tensors: TensorStore,
    /// The networks, without automatic differentiation.
    pub model: ClothCombo,
}

impl Subject {
    /// `trained` on `dataset`, which was loaded for `config`.
    ///
    /// # Errors
    /// When the data is not that of the model, or its parameters cannot be read.
    pub fn new(
        trained: &TrainedModel,
        config: Config,
        dataset: Arc<Dataset>,
        device: &Device,
    ) -> Result<Self, Report> {
        trained.check_data(&config, &dataset)?;
        let tensors = TensorStore::new(dataset.clone(), trained.state.dimensions(), device);
        Ok(Self { model: trained.networks(device)?, config, dataset, tensors })
    }

    /// The networks ready to drape.
    pub fn networks(&self) -> Networks<'_> {
        Networks::new(self.model.clone(), &self.tensors)
    }

    /// The same with at most `steps` correction steps.
    pub fn networks_with(&self, steps: usize) -> Networks<'_> {
        Networks::new(self.model.clone().with_correction_steps(steps), &self.tensors)
    }

    /// Weight and margin of one of the collisions in the configuration, as columns call it.
    pub fn collision_form(&self, term: Term) -> String {
        let losses = &self.config.losses;
        let settings = losses.energy_settings();
        let epsilon = match term {
            Term::LayerCollision => settings.layer_collision_epsilon,
            _ => settings.body_collision_epsilon,
        };
        let scale = match losses.reference_vertices {
            vertices if vertices > 0.0 => format!(" · {vertices}/N"),
            _ => String::new(),
        };
        format!("as trained: {}{scale}, ε {} mm", losses.weight(term).at(1.0), number(1e3 * epsilon))
    }

    /// Scene `index` of question number `question` (`at`), drawn as [`sample_evaluation`] says.
    pub fn draw(&self, at: [usize; 2], pool: &[usize], layers: usize, poses: HeldOut) -> SceneSample {
        sample_evaluation(&self.dataset, self.config.validation_seed(), at, pool, layers, poses)
    }

    /// Prepares a scene, losses with the weights they end with.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn prepare(&self, draw: SceneSample) -> Result<PreparedScene, DrapeError> {
        Ok(prepare(&self.dataset, &self.config.losses, draw, 1.0)?)
    }
}

/// One drape: energies, depths, and exact intersections.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Energies, vertices inside the body, vertices on the wrong side.
    pub score: SceneScore,
    /// Collision with the body in the paper's form.
    pub paper_collision: f64,
    /// Collision between garments in the paper's form.
    pub paper_layer_collision: f64,
    /// The paper's degree of self-collision, summed over the garments.
    pub self_collision: f64,
    /// With the body.
    pub body: Intersections,
    /// Of garments with each other.
    pub layers: Intersections,
    /// Of garments with themselves.
    pub own: Intersections,
}

/// What is measured of every drape of a scene; body and rest garments are made ready once.
pub struct Witness<'a> {
    scene: &'a PreparedScene,
    body: Surface<f64>,
    paper: SceneEnergy<f32>,
    topologies: Vec<Topology>,
}

/// Vertices repel each other below this distance in the paper [m].
const PAPER_REPULSION_RADIUS: f64 = 0.1;

impl<'a> Witness<'a> {
    /// Of the first body of `scene`.
    pub fn new(scene: &'a PreparedScene) -> Self {
        Self {
            scene,
            body: scene.exact_body(),
            paper: paper_collisions(&scene.bodies[0].energy),
            topologies: scene.garments.iter().map(|garment| Topology::new(&garment.garment.rest)).collect(),
        }
    }

    /// Measures a drape of the scene.
    pub fn measure(&self, draped: &Draped) -> Measured {
        let positions: Vec<[f64; 3]> = draped.posed.iter().map(|p| p.map(f64::from)).collect();
        let garments: Vec<ReportGarment> = self
            .scene
            .parts(&positions)
            .into_iter()
            .zip(&self.scene.garments)
            .map(|(positions, garment)| ReportGarment { positions, faces: garment.garment.rest.faces() })
            .collect();
        let layers = all_layers(garments.len());
        let order = LayerOrder::NearestVertex;
        let selection = Selection { layers: &layers, order, triangles: true, body_itself: false };
        let body = PosedBody::new(&self.body, Distance::NearestVertex);
        let report = contact::Report::count(&body, &garments, &selection);
        let self_collisions = garments.iter().zip(&report.garments).zip(&self.topologies);
        let self_collisions = self_collisions.map(|((garment, found), topology)| {
            let ReportGarment { positions, faces } = *garment;
            self_collision(positions, faces, &found.with_itself.pairs, topology, PAPER_REPULSION_RADIUS)
        });
        let paper = self.paper.value(&draped.posed, &draped.canonical);
        let weighted = |values: &[TermMap<Option<f64>>], term: Term| -> f64 {
            PAPER_COLLISION_WEIGHT * values.iter().filter_map(|raw| raw[term]).sum::<f64>()
        };
        Measured {
            score: score_scene(self.scene, &self.body, draped),
            paper_collision: weighted(&paper.garments, Term::BodyCollision),
            paper_layer_collision: weighted(&paper.layers, Term::LayerCollision),
            self_collision: self_collisions.sum(),
            body: report.garments.iter().map(|garment| garment.with_body.numbers()).sum(),
            layers: report.layers.iter().map(|layer| layer.pairs.numbers()).sum(),
            own: report.garments.iter().map(|garment| garment.with_itself.numbers()).sum(),
        }
    }
}

/// What columns call the paper's form of a collision.
pub const PAPER_COLLISION: &str = "paper's form: 250, ε 2 mm";
/// Weight of both collisions in the paper.
const PAPER_COLLISION_WEIGHT: f64 = 250.0;

/// The two collisions of `scene` as the paper prints them, and nothing else: nearest vertex, ε = 2 mm, every two garments, no gate,
/// no scaling with the number of vertices.
fn paper_collisions(scene: &SceneEnergy<f32>) -> SceneEnergy<f32> {
    let printed = EnergySettings::printed();
    let only = |term: Term| {
        let mut weights = TermMap::filled(0.0);
        weights[term] = PAPER_COLLISION_WEIGHT;
        weights
    };
    let mut paper = scene.clone();
    paper.settings = EnergySettings {
        body_collision_epsilon: printed.body_collision_epsilon,
        layer_collision_epsilon: printed.layer_collision_epsilon,
        distance: printed.distance,
        layer_contact: printed.layer_contact,
        layer_gate: printed.layer_gate,
        ..scene.settings
    };
    paper.garments.iter_mut().for_each(|garment| garment.weights = only(Term::BodyCollision));
    let count = paper.garments.len();
    let pairs = (0..count).flat_map(|inner| (inner + 1..count).map(move |outer| (inner, outer)));
    let weights = only(Term::LayerCollision);
    paper.layers = pairs.map(|(inner, outer)| SceneLayers { inner, outer, weights }).collect();
    paper
}

/// Scenes prepared and measured at a time: enough to keep every core busy.
const CHUNK: usize = 16;

impl Subject {
    /// Lets `drape` drape every scene by several methods, and measures them: per scene, per method. `done` is called after
    /// each scene.
    ///
    /// # Errors
    /// The first error of `drape`, or when a garment cannot be read.
    pub fn measure(
        &self,
        draws: &[SceneSample],
        done: &(dyn Fn() + Sync),
        mut drape: impl FnMut(&PreparedScene) -> Result<Vec<Draped>, DrapeError>,
    ) -> Result<Vec<Vec<Measured>>, DrapeError> {
        let mut all = Vec::with_capacity(draws.len());
        for chunk in draws.chunks(CHUNK) {
            let scenes: Vec<_> = chunk.par_iter().map(|draw| self.prepare(draw.clone())).collect();
            let scenes = scenes.into_iter().collect::<Result<Vec<_>, _>>()?;
            let drapes = scenes.iter().map(&mut drape).collect::<Result<Vec<_>, _>>()?;
            all.par_extend(scenes.par_iter().zip(&drapes).map(|(scene, drapes)| {
                let witness = Witness::new(scene);
                let measured = drapes.iter().map(|draped| witness.measure(draped)).collect();
                done();
                measured
            }));
        }
        Ok(all)
    }
}
