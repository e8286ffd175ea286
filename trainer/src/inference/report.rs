//! What a drape reports: `report.json`.

use super::acceleration::{Acceleration, acceleration};
use super::bodies::{Bodies, BodyReport};
use super::drape::{Drape, GarmentDrape};
use super::draper::Draper;
use super::outfit::{Outfit, OutfitGarment};
use super::phase_times::PhaseTimes;
use super::refine::Refinement;
use super::smooth::Smoothing;
use crate::score::{DrapedGarment, Score, ScoreDistance, score};
use crate::system::device::name;
use crate::system::paths::{lossy, lossy_option};
use clothcombo_data::asset::{Category, GarmentMaterial};
use clothcombo_data::fit::FitReport;
use clothcombo_physics::contact::resolve::Certificate;
use clothcombo_physics::mesh::TriMesh;
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use std::path::PathBuf;

/// The model that draped.
#[derive(Clone, Debug, Serialize)]
pub struct ModelReport {
    /// Its folder.
    #[serde(serialize_with = "lossy")]
    pub folder: PathBuf,
    /// Steps it was trained for.
    pub step: u64,
    /// BLAKE3 checksum of its parameters.
    pub checksum: String,
}

/// One garment. The time of what treats all garments at once is shared by number of vertices.
#[derive(Clone, Debug, Serialize)]
pub struct DrapedGarmentReport {
    /// Its name, and that of its file.
    pub name: String,
    /// The file it was read from, if it was.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "lossy_option")]
    pub given: Option<PathBuf>,
    /// Vertices of the mesh as given.
    pub given_vertices: usize,
    /// Vertices that were draped.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Category.
    pub category: Category,
    /// What it is made of, where that is not what the model was trained on.
    #[serde(skip_serializing_if = "GarmentMaterial::is_empty")]
    pub material: GarmentMaterial,
    /// What fitting assumed and repaired; none if the garment lay on the body as it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<FitReport>,
    /// Whether its embedding was known before.
    pub embedding_known: bool,
    /// Wall time, all frames together.
    pub milliseconds: PhaseTimes,
}

/// One frame of a motion.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReport {
    /// Number in the motion.
    pub frame: usize,
    /// Its time (s).
    pub seconds: f64,
    /// Wall time.
    pub milliseconds: PhaseTimes,
    /// What the refinement did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    /// What is left.
    pub certificate: Certificate,
}

/// Everything about a drape.
#[derive(Clone, Debug, Serialize)]
pub struct DrapeReport {
    /// The program.
    pub program: String,
    /// Name of the device that the networks ran on.
    pub device: String,
    /// The model.
    pub model: ModelReport,
    /// The body.
    pub body: BodyReport,
    /// The garments, innermost first.
    pub garments: Vec<DrapedGarmentReport>,
    /// Number of the one frame of a motion that `before`, `after`, `certificate_before` and `refinement` are of: the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scored_frame: Option<usize>,
    /// Score of the networks' drape.
    pub before: Score,
    /// And of the result.
    pub after: Score,
    /// Wall time by phase, all garments and frames together.
    pub milliseconds: PhaseTimes,
    /// What is left: of a motion, numbers of pairs are sums over the frames, depths and strain the worst frame's, and the
    /// lists are those of `frames`.
    pub certificate: Certificate,
    /// The same of the networks' drape, without the list of pairs.
    pub certificate_before: Certificate,
    /// What the refinement did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refinement: Option<Refinement>,
    /// What temporal smoothing did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smoothing: Option<Smoothing>,
    /// How smoothly a motion moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acceleration: Option<Acceleration>,
    /// Every frame of a motion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameReport>,
}

impl DrapeReport {
    /// Puts the report of `drapes`, which are on `bodies`, together.
    ///
    /// # Errors
    /// When a score overflows: a garment has exploded.
    pub fn new(
        draper: &Draper,
        outfit: &Outfit,
        drapes: &[Drape],
        bodies: &Bodies,
        smoothing: Option<Smoothing>,
    ) -> Result<Self, Report> {
        let (first, moments) = (&drapes[0], &bodies.moments);
        let mut milliseconds = PhaseTimes::default();
        drapes.iter().for_each(|drape| milliseconds += drape.milliseconds);
        outfit.garments.iter().for_each(|garment| milliseconds += garment.milliseconds);
        let (certificate_before, (before, after)) = rayon::join(
            || first.certificate_before(draper, outfit),
            || {
                let score =
                    |positions: fn(&GarmentDrape) -> &Vec<[f64; 3]>| first.score(draper, outfit, positions);
                rayon::join(|| score(|g| &g.network), || score(|g| &g.positions))
            },
        );
        let frames = drapes.iter().zip(moments).map(|(drape, moment)| FrameReport {
            frame: moment.frame,
            seconds: moment.seconds,
            milliseconds: drape.milliseconds,
            refinement: drape.refinement.clone(),
            certificate: drape.certificate.clone(),
        });
        let trained = draper.trained();
        Ok(Self {
            program: format!("clothcombo {}", env!("CARGO_PKG_VERSION")),
            device: name(&draper.settings().device),
            model: ModelReport {
                folder: trained.folder.clone(),
                step: trained.state.step,
                checksum: trained.checksum().to_owned(),
            },
            body: bodies.report.clone(),
            garments: garment_reports(outfit, drapes),
            scored_frame: moments.first().map(|moment| moment.frame),
            before: before?,
            after: after?,
            milliseconds,
            certificate: Certificate::of_frames(drapes.iter().map(|drape| &drape.certificate)),
            certificate_before: Certificate { remaining: Vec::new(), ..certificate_before? },
            refinement: first.refinement.clone(),
            smoothing,
            acceleration: acceleration(drapes, moments),
            frames: frames.collect(),
        })
    }
}

impl Drape {
    /// Scores these `positions` of the garments by the paper's energies (see [`crate::score`]).
    ///
    /// # Errors
    /// When a value overflows.
    pub fn score(
        &self,
        draper: &Draper,
        outfit: &Outfit,
        positions: fn(&GarmentDrape) -> &Vec<[f64; 3]>,
    ) -> Result<Score, Report> {
        let body = TriMesh::new(self.body.clone(), draper.body().faces.to_vec()).into_diagnostic()?;
        let garments: Vec<DrapedGarment> = outfit
            .garments
            .iter()
            .zip(&self.garments)
            .map(|(garment, drape)| DrapedGarment {
                name: &garment.name,
                rest: &garment.prepared.garment.rest,
                positions: positions(drape),
                canonical: None,
            })
            .collect();
        score(&body, &garments, ScoreDistance::default())
    }
}

fn garment_reports(outfit: &Outfit, drapes: &[Drape]) -> Vec<DrapedGarmentReport> {
    let all: usize = outfit.garments.iter().map(|p| p.prepared.vertex_count()).sum();
    let report = |(index, garment): (usize, &OutfitGarment)| {
        let vertices = garment.prepared.vertex_count();
        let share = vertices as f64 / all.max(1) as f64;
        let mut times = garment.milliseconds;
        for drape in drapes {
            let own: f64 = drape.garments.iter().map(|g| g.resolve_ms).sum();
            let shared = PhaseTimes { resolve: drape.milliseconds.resolve - own, ..drape.milliseconds };
            times += shared.scaled(share);
            times.resolve += drape.garments[index].resolve_ms;
        }
        DrapedGarmentReport {
            name: garment.name.clone(),
            given: garment.source.path.clone(),
            given_vertices: garment.source.given.positions.len(),
            vertices,
            triangles: garment.prepared.garment.rest.face_count(),
            category: garment.prepared.garment.category,
            material: garment.prepared.garment.material,
            fit: garment.source.fit.clone(),
            embedding_known: garment.embedding_known,
            milliseconds: times,
        }
    };
    outfit.garments.iter().enumerate().map(report).collect()
}
