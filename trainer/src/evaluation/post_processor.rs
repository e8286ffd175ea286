//! The post-process of an evaluation's scenes.

use super::ModelUnderTest;
use crate::dataset::{DatasetError, PreparedScene};
use crate::inference::reference::wide;
use clothcombo_data::asset::{Garment, infeasible_pair};
use clothcombo_physics::contact::resolve::{
    Certificate, Layer, PathSample, ResolveError, ResolveSettings, Resolved, RestGarment, certify,
    resolve_along,
};
use clothcombo_physics::query::Surface;
use miette::Diagnostic;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// Why a drape cannot be post-processed.
#[derive(Debug, Error, Diagnostic)]
pub enum PostProcessError {
    /// A pose of the continuation path cannot be prepared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// The drape is no valid scene.
    #[error(transparent)]
    Resolve(#[from] ResolveError),
}

/// What the post-process needs besides a drape: the data, and constants of garments.
pub struct PostProcessor<'a> {
    model: &'a ModelUnderTest,
    known: Mutex<HashMap<usize, Arc<RestGarment>>>,
}

impl<'a> PostProcessor<'a> {
    /// For scenes of `model`.
    pub fn new(model: &'a ModelUnderTest) -> Self {
        Self { model, known: Mutex::default() }
    }

    /// A drape of `scene` from the packed positions of all garments on its first body.
    pub fn of<'s>(&'s self, scene: &'s PreparedScene, packed: &[[f32; 3]]) -> DrapedScene<'s> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let garment = scene.sample.garments.iter().zip(&scene.garments);
        let rest = garment.map(|(&g, garment)| {
            let made = || RestGarment::of_material(&garment.garment.rest, garment.energies.material());
            known.entry(g).or_insert_with(|| Arc::new(made())).clone()
        });
        DrapedScene {
            post_processor: self,
            scene,
            body: scene.exact_body(),
            garments: rest.collect(),
            positions: scene.parts(packed).into_iter().map(wide).collect(),
        }
    }

    /// `scene` in a pose between the T-pose and its own, garments skinned (docs/resolve.md).
    fn path_sample(&self, scene: &PreparedScene, share: f64) -> Result<PathSample, PostProcessError> {
        let mut sample = scene.sample.clone();
        for body in &mut sample.bodies {
            body.pose = body.pose.scaled_keeping_heading(share);
        }
        let scene = self.model.prepare(&sample)?;
        let transforms = scene.skinning_transforms();
        let skinned = scene.skinned_start(&transforms);
        let draped = scene.parts(&skinned).into_iter().map(<[_]>::to_vec).collect();
        Ok(PathSample { body: Arc::new(scene.exact_body()), draped, transforms })
    }
}

/// A scene's body and garments as the post-process takes them.
pub struct DrapedScene<'a> {
    post_processor: &'a PostProcessor<'a>,
    scene: &'a PreparedScene,
    /// The posed body.
    pub body: Surface<f64>,
    /// Constants of the garments, inner → outer.
    garments: Vec<Arc<RestGarment>>,
    /// Their positions.
    pub positions: Vec<Vec<[f64; 3]>>,
}

impl DrapedScene<'_> {
    fn layers(&self) -> Vec<Layer<'_>> {
        let pairs = self.garments.iter().zip(&self.positions);
        pairs.map(|(garment, positions)| Layer { garment, positions }).collect()
    }

    /// Resolves it, if need be on a continuation path from the T-pose.
    ///
    /// # Errors
    /// When it is no valid scene, or another pose cannot be prepared.
    pub fn resolved(&self, settings: &ResolveSettings) -> Result<Resolved, PostProcessError> {
        let sample_at = |share: f64| self.post_processor.path_sample(self.scene, share);
        resolve_along(&self.body, &self.layers(), settings, sample_at)
    }

    /// Whether the order of the garments is feasible ([`infeasible_pair`]).
    pub fn is_feasible(&self) -> bool {
        let order: Vec<&Garment> = self.scene.garments.iter().map(|w| &w.garment).collect();
        infeasible_pair(&order).is_none()
    }

    /// What intersects before anything is done.
    ///
    /// # Errors
    /// When it is no valid scene.
    pub fn certificate(&self) -> Result<Certificate, ResolveError> {
        certify(&self.body, &self.layers())
    }
}
