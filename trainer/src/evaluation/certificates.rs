//! The post-process of an evaluation's scenes.

use crate::config::LossesConfig;
use crate::dataset::{Dataset, PreparedScene, prepare};
use crate::inference::layer_interaction::LayerInteraction;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use clothcombo_data::asset::{Garment, infeasible_pair};
use clothcombo_physics::contact::resolve::{
    Certificate, Layer, PathSample, ResolveError, ResolveSettings, Resolved, RestGarment, Stage, certify,
    resolve_along,
};
use clothcombo_physics::contact::{
    CountedBody, FilterWork, LayerOrder, Report, ReportGarment, Selection, all_layers,
};
use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::transform::apply;
use miette::Diagnostic;
use serde::Serialize;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// Why a drape cannot be post-processed.
#[derive(Debug, Error, Diagnostic)]
pub enum PostProcessError {
    /// A pose of the continuation path cannot be draped.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Drape(#[from] DrapeError),
    /// The drape is no valid scene.
    #[error(transparent)]
    Resolve(#[from] ResolveError),
}

/// What the post-process needs besides a drape: the data, who drapes other poses, and constants of garments.
pub struct PostProcessor<'a> {
    dataset: &'a Dataset,
    losses: &'a LossesConfig,
    networks: Option<&'a Networks<'a>>,
    known: Mutex<HashMap<usize, Arc<RestGarment>>>,
}

impl<'a> PostProcessor<'a> {
    /// For scenes of `dataset`, draped by `networks`; without them by skinning.
    pub fn new(dataset: &'a Dataset, losses: &'a LossesConfig, networks: Option<&'a Networks<'a>>) -> Self {
        Self { dataset, losses, networks, known: Mutex::default() }
    }

    /// A drape of `scene` from the packed positions of all garments on its first body.
    pub fn of<'s>(&'s self, scene: &'s PreparedScene, packed: &[[f32; 3]]) -> DrapedScene<'s> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let garment = scene.sample.garments.iter().zip(&scene.garments);
        let rest = garment.map(|(&g, garment)| {
            known.entry(g).or_insert_with(|| Arc::new(RestGarment::new(&garment.garment.rest))).clone()
        });
        DrapedScene {
            post_processor: self,
            scene,
            body: scene.exact_body(),
            garments: rest.collect(),
            positions: wide(scene, packed),
        }
    }

    /// Packed positions of `scene` as they are draped.
    ///
    /// # Errors
    /// When the networks do not take it.
    pub fn drape(&self, scene: &PreparedScene) -> Result<Vec<[f32; 3]>, DrapeError> {
        match self.networks {
            Some(networks) => Ok(networks.drape(scene)?.posed),
            None => Ok(skinned(scene)),
        }
    }

    /// `scene` in a pose between the T-pose and its own, draped by the forward pass alone: that leaves fewer intersections
    /// than the accepted state (docs/resolve.md).
    fn stage(&self, scene: &PreparedScene, share: f64) -> Result<PathSample, PostProcessError> {
        let mut sample = scene.sample.clone();
        for body in &mut sample.bodies {
            body.pose = body.pose.scaled_keeping_heading(share);
        }
        let scene = prepare(self.dataset, self.losses, sample, 1.0).map_err(DrapeError::from)?;
        let skinned = skinned(&scene);
        let draped =
            self.networks.map(|networks| networks.forward(&scene, LayerInteraction::Together)).transpose()?;
        Ok(PathSample {
            body: Arc::new(scene.exact_body()),
            draped: wide(&scene, draped.as_ref().map_or(&skinned, |draped| &draped.posed)),
            transforms: scene.skinning_transforms(),
        })
    }
}

/// Packed positions per garment.
fn wide(scene: &PreparedScene, packed: &[[f32; 3]]) -> Vec<Vec<[f64; 3]>> {
    let wide = |part: &[[f32; 3]]| part.iter().map(|p| p.map(f64::from)).collect();
    scene.parts(packed).into_iter().map(wide).collect()
}

/// A scene's body and garments as the post-process takes them.
pub struct DrapedScene<'a> {
    post_processor: &'a PostProcessor<'a>,
    scene: &'a PreparedScene,
    /// The posed body.
    pub body: Surface<f64>,
    /// Constants of the garments, inner → outer.
    pub garments: Vec<Arc<RestGarment>>,
    /// Their positions.
    pub positions: Vec<Vec<[f64; 3]>>,
}

impl DrapedScene<'_> {
    fn layers<'a>(&'a self, positions: &'a [Vec<[f64; 3]>]) -> Vec<Layer<'a>> {
        let pairs = self.garments.iter().zip(positions);
        pairs.map(|(garment, positions)| Layer { garment, positions }).collect()
    }

    /// Resolves it, if need be on a continuation path from the T-pose.
    ///
    /// # Errors
    /// When it is no valid scene, or another pose cannot be draped.
    pub fn resolved(&self, settings: &ResolveSettings) -> Result<Resolved, PostProcessError> {
        let stage_at = |share: f64| self.post_processor.stage(self.scene, share);
        resolve_along(&self.body, &self.layers(&self.positions), settings, stage_at)
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
        certify(&self.body, &self.layers(&self.positions))
    }

    /// The same as numbers.
    ///
    /// # Errors
    /// When it is no valid scene.
    pub fn counts(&self) -> Result<Counts, ResolveError> {
        Ok(Counts::new(&self.certificate()?, self.order_violations_nearest_vertex(&self.positions)))
    }

    /// Share of layer-order violations over all pairs of layers, by the nearest vertex: the definition of the score.
    pub fn order_violations_nearest_vertex(&self, positions: &[Vec<[f64; 3]>]) -> f64 {
        let garments: Vec<ReportGarment> = self
            .garments
            .iter()
            .zip(positions)
            .map(|(garment, positions)| ReportGarment { positions, faces: garment.faces() })
            .collect();
        let layers = all_layers(garments.len());
        let order = LayerOrder::NearestVertex;
        let selection = Selection { layers: &layers, order, triangles: false, body_itself: false };
        Report::count(&CountedBody::new(&self.body, Distance::NearestVertex), &garments, &selection)
            .order()
            .share()
    }
}

/// Linear blend skinning of the start state on the host, packed: what the networks start from.
fn skinned(scene: &PreparedScene) -> Vec<[f32; 3]> {
    let start = scene.bodies[0].start.iter().map(|p| p.map(f64::from));
    scene.skinning_transforms().iter().zip(start).map(|(t, p)| apply(t, p).map(|x| x as f32)).collect()
}

/// The numbers of a certificate without its list.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Counts {
    /// Exact pairs with the body.
    pub body_triangle_pairs: usize,
    /// Those of them where the body leaves hardly any room for cloth.
    pub narrow_triangle_pairs: usize,
    /// Exact pairs of two garments.
    pub layer_triangle_pairs: usize,
    /// Exact pairs of a garment with itself.
    pub self_triangle_pairs: usize,
    /// Pairs of all kinds where the body lies inside itself.
    pub pinched_pairs: usize,
    /// Length of the curves of intersection (mm).
    pub contour_length_mm: f64,
    /// Deepest vertex (mm).
    pub max_depth_mm: f64,
    /// Share of layer-order violations, by the closest surface point.
    pub order_violations: f64,
    /// The same by the nearest vertex: the paper's form.
    pub order_violations_nearest_vertex: f64,
}

impl Counts {
    /// Those of `certificate`.
    pub fn new(certificate: &Certificate, order_violations_nearest_vertex: f64) -> Self {
        Self {
            body_triangle_pairs: certificate.body_triangle_pairs,
            narrow_triangle_pairs: certificate.narrow_triangle_pairs,
            layer_triangle_pairs: certificate.layer_triangle_pairs,
            self_triangle_pairs: certificate.self_triangle_pairs,
            pinched_pairs: certificate.pinched.count(),
            contour_length_mm: certificate.contour_length_mm,
            max_depth_mm: certificate.max_depth_mm,
            order_violations: certificate.order_violations,
            order_violations_nearest_vertex,
        }
    }

    /// Whether no garment intersects the body or another garment.
    pub fn is_clear(&self) -> bool {
        self.body_triangle_pairs + self.layer_triangle_pairs == 0
    }
}

/// One outfit.
#[derive(Clone, Debug, Serialize)]
pub struct OutfitResult {
    /// Number of the outfit.
    pub outfit: usize,
    /// Names, inner → outer.
    pub garments: Vec<String>,
    /// Whether the order is feasible ([`infeasible_pair`]).
    pub is_feasible: bool,
    /// Vertices per garment.
    pub vertices: Vec<usize>,
    /// Before the post-process.
    pub before: Counts,
    /// After it.
    pub after: Counts,
    /// Rise of the strain energy, as a share; none where there was no strain.
    pub strain_added: Option<f64>,
    /// Largest move of a vertex (mm).
    pub largest_move_mm: f64,
    /// Share of vertices that moved.
    pub moved: f64,
    /// The stage that cleared it, or went farthest.
    pub stage: Stage,
    /// What the step filter did.
    pub filter: FilterWork,
    /// What of the time the fast pass took where it was not enough (ms); 0 where it was.
    pub fast_milliseconds: f64,
    /// Rounds per garment, of all attempts but those of the continuation path and of relaxing strain.
    pub rounds: Vec<usize>,
    /// Steps from the T-pose that were tried; 0 where the drape could be resolved as it was.
    pub steps: usize,
    /// Time per garment (ms).
    pub milliseconds: Vec<f64>,
    /// Time to prepare the body, once for all garments (ms).
    pub body_milliseconds: f64,
    /// Time of the certificate, once for all garments (ms).
    pub certificate_milliseconds: f64,
}

impl OutfitResult {
    /// Resolves `draped`.
    ///
    /// # Errors
    /// When it is no valid scene, or another pose cannot be draped.
    pub fn new(
        outfit: usize,
        draped: &DrapedScene<'_>,
        settings: &ResolveSettings,
    ) -> Result<(Self, Resolved), PostProcessError> {
        let scene = draped.scene;
        let before = draped.counts()?;
        let resolved = draped.resolved(settings)?;
        let works = &resolved.garments;
        let ms = |time: std::time::Duration| 1e3 * time.as_secs_f64();
        let vertices: Vec<usize> = scene.garments.iter().map(|w| w.vertex_count()).collect();
        let moved: usize = works.iter().map(|w| w.moved).sum();
        let result = Self {
            outfit,
            garments: scene.garments.iter().map(|w| w.garment.name.clone()).collect(),
            is_feasible: draped.is_feasible(),
            before,
            after: Counts::new(
                &resolved.certificate,
                draped.order_violations_nearest_vertex(&resolved.positions),
            ),
            strain_added: resolved.certificate.strain_added,
            largest_move_mm: 1e3 * works.iter().map(|w| w.largest_move).fold(0.0, f64::max),
            moved: moved as f64 / vertices.iter().sum::<usize>().max(1) as f64,
            stage: resolved.stage,
            filter: resolved.filter,
            fast_milliseconds: ms(resolved.fast_time),
            rounds: works.iter().map(|w| w.rounds).collect(),
            steps: resolved.steps,
            milliseconds: works.iter().map(|w| ms(w.time)).collect(),
            body_milliseconds: ms(resolved.body_time),
            certificate_milliseconds: ms(resolved.certificate_time),
            vertices,
        };
        Ok((result, resolved))
    }
}
