//! A trained model with the data it is asked about.

use crate::checkpoint::TrainedModel;
use crate::config::Config;
use crate::drape::{DrapeError, Networks, WardrobeTensors};
use crate::evaluate::{Draped, SceneScore, score_scene};
use crate::scene::{Library, PreparedScene, SceneDraw, Unseen, draw_study, prepare};
use burn::tensor::Device;
use clothcombo_model::ClothCombo;
use clothcombo_physics::contact::{Intersections, TriangleTree};
use clothcombo_physics::query::Surface;
use miette::Report;
use rayon::prelude::*;
use std::sync::Arc;

/// A trained model, its configuration and its data.
pub struct Subject {
    /// Losses, data and seed.
    pub config: Config,
    /// The data.
    pub library: Arc<Library>,
    /// Its tensors.
    pub tensors: WardrobeTensors,
    /// The networks, without automatic differentiation.
    pub model: ClothCombo,
}

impl Subject {
    /// `trained` on `library`, which was loaded for `config`.
    ///
    /// # Errors
    /// When the data is not that of the model, or its parameters cannot be read.
    pub fn new(
        trained: &TrainedModel,
        config: Config,
        library: Arc<Library>,
        device: &Device,
    ) -> Result<Self, Report> {
        trained.check_data(&config, &library)?;
        let tensors = WardrobeTensors::new(library.clone(), trained.state.dimensions(), device);
        Ok(Self { model: trained.networks(device)?, config, library, tensors })
    }

    /// The networks ready to drape.
    pub fn networks(&self) -> Networks<'_> {
        Networks::new(self.model.clone(), &self.tensors)
    }

    /// The same with at most `steps` correction steps.
    pub fn networks_with(&self, steps: usize) -> Networks<'_> {
        Networks::new(self.model.clone().with_correction_steps(steps), &self.tensors)
    }

    /// Scene `index` of question number `question` (`at`), drawn as [`draw_study`] says.
    pub fn draw(&self, at: [usize; 2], pool: &[usize], layers: usize, unseen: Unseen) -> SceneDraw {
        draw_study(&self.library, self.config.validation_seed(), at, pool, layers, unseen)
    }

    /// Prepares a scene, losses with the weights they end with.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn prepare(&self, draw: SceneDraw) -> Result<PreparedScene, DrapeError> {
        Ok(prepare(&self.library, &self.config.losses, draw, 1.0)?)
    }
}

/// One drape: energies, depths, and exact intersections.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// Energies, vertices inside the body, vertices on the wrong side.
    pub score: SceneScore,
    /// With the body.
    pub body: Intersections,
    /// Of garments with each other.
    pub layers: Intersections,
    /// Of garments with themselves.
    pub own: Intersections,
}

/// Scenes are asked about one after the other; their bodies are made ready once.
pub struct Witness<'a> {
    scene: &'a PreparedScene,
    body: Surface<f64>,
}

impl<'a> Witness<'a> {
    /// Of the first body of `scene`.
    pub fn new(scene: &'a PreparedScene) -> Self {
        Self { scene, body: scene.exact_body() }
    }

    /// Measures a drape of the scene.
    pub fn measure(&self, draped: &Draped) -> Measured {
        let positions: Vec<[f64; 3]> = draped.posed.iter().map(|p| p.map(f64::from)).collect();
        let body = TriangleTree::new(&self.body.positions, &self.body.faces);
        let parts = self.scene.parts(&positions).into_iter().zip(&self.scene.worn);
        let trees: Vec<TriangleTree> =
            parts.map(|(part, worn)| TriangleTree::new(part, worn.garment.rest.faces())).collect();
        let pairs = (0..trees.len()).flat_map(|i| (i + 1..trees.len()).map(move |j| (i, j)));
        Measured {
            score: score_scene(self.scene, &self.body, draped),
            body: trees.iter().map(|tree| Intersections::between(tree, &body)).sum(),
            layers: pairs.map(|(i, j)| Intersections::between(&trees[i], &trees[j])).sum(),
            own: trees.iter().map(Intersections::within).sum(),
        }
    }
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
        draws: &[SceneDraw],
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
