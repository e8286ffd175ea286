//! Turns a draw into numbers: posed body, bone transforms, start positions, and the scene's energies.

use super::draw::SceneDraw;
use super::error::LibraryError;
use super::garment::LibraryGarment;
use super::library::Library;
use crate::config::LossesConfig;
use crate::objective::scene_weights;
use clothcombo_physics::energy::{SceneEnergy, SceneGarment, SceneLayers};
use clothcombo_physics::query::Surface;
use std::sync::Arc;

/// One body of a prepared scene, with the garments' state on it; garments are packed inner → outer.
pub struct PreparedBody {
    /// Shape parameters, `[S]`.
    pub shape: Vec<f32>,
    /// Pose features of the active joints, `[P]`.
    pub pose: Vec<f32>,
    /// World transforms of the active joints relative to the T-pose.
    pub bones: Vec<[[f64; 4]; 3]>,
    /// Canonical start positions of all garments, `[ΣV, 3]`.
    pub start: Vec<[f32; 3]>,
    /// The losses of this scene.
    pub energy: Arc<SceneEnergy<f32>>,
}

/// A scene ready for a step.
pub struct PreparedScene {
    /// What was drawn.
    pub draw: SceneDraw,
    /// Indices into the wardrobe, inner → outer.
    pub garments: Vec<usize>,
    /// The garments themselves.
    pub worn: Vec<Arc<LibraryGarment>>,
    /// Pairs (inner, outer) of positions in `garments` that can touch.
    pub contacts: Vec<(usize, usize)>,
    /// Bodies.
    pub bodies: Vec<PreparedBody>,
}

/// Two garments whose rest bounding boxes are farther apart than this never interact [m].
const CONTACT_MARGIN: f64 = 0.05;

/// Prepares `draw`; loss weights are taken at `run_progress`.
///
/// # Errors
/// [`LibraryError`] when a garment cannot be read.
pub fn prepare(
    library: &Library,
    losses: &LossesConfig,
    draw: SceneDraw,
    run_progress: f64,
) -> Result<PreparedScene, LibraryError> {
    let garments =
        draw.garments.iter().map(|&g| library.wardrobe.garment(g)).collect::<Result<Vec<_>, _>>()?;
    let contacts = contacts(library, &draw.garments);
    let bodies = draw
        .bodies
        .iter()
        .map(|body| {
            let posed = library
                .body
                .posed(&body.shape, &body.pose)
                .expect("drawn shapes and poses have the body's own dimensions");
            let surface = Surface::new(
                posed.positions.iter().map(|p| p.map(|v| v as f32)).collect(),
                library.body.faces.clone(),
            );
            let bones = library.joints().indices.iter().map(|&j| posed.bones[j]);
            let starts: Vec<Vec<[f32; 3]>> =
                garments.iter().map(|g| g.start_positions(&body.shape)).collect();
            let counts: Vec<usize> = garments.iter().map(|g| g.vertex_count()).collect();
            let weights = scene_weights(losses, run_progress, &counts, &contacts);
            let scene_garments = garments
                .iter()
                .zip(&starts)
                .zip(weights.garments)
                .map(|((g, start), weights)| SceneGarment {
                    energies: g.energies.clone(),
                    holding_reference: match losses.holding.relative {
                        true => start.clone(),
                        false => g.garment.rest.positions().iter().map(|p| p.map(|v| v as f32)).collect(),
                    },
                    weights,
                })
                .collect();
            let layers = contacts
                .iter()
                .zip(weights.layers)
                .map(|(&(inner, outer), weights)| SceneLayers { inner, outer, weights })
                .collect();
            PreparedBody {
                shape: body.shape.iter().map(|v| *v as f32).collect(),
                pose: library.poses.features(&body.pose, &library.joints().indices),
                bones: bones.collect(),
                start: starts.concat(),
                energy: Arc::new(SceneEnergy {
                    body: Arc::new(surface),
                    garments: scene_garments,
                    layers,
                    settings: losses.energy_settings(),
                }),
            }
        })
        .collect();
    Ok(PreparedScene { garments: draw.garments.clone(), draw, worn: garments, contacts, bodies })
}

fn contacts(library: &Library, garments: &[usize]) -> Vec<(usize, usize)> {
    let boxes: Vec<_> = garments.iter().map(|&g| library.wardrobe.card(g).bounds).collect();
    let touch = |a: usize, b: usize| {
        (0..3).all(|k| {
            boxes[a].0[k] - CONTACT_MARGIN <= boxes[b].1[k] && boxes[b].0[k] - CONTACT_MARGIN <= boxes[a].1[k]
        })
    };
    let pairs = (0..garments.len()).flat_map(|i| (i + 1..garments.len()).map(move |j| (i, j)));
    pairs.filter(|&(i, j)| touch(i, j)).collect()
}
