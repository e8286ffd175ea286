//! The loss of a scene: which weight each energy has, for each garment and each pair of layers.

use crate::config::LossesConfig;
use clothcombo_physics::energy::{Term, TermMap};

/// Weights of one scene.
pub struct SceneWeights {
    /// Per garment; the layer terms are zero.
    pub garments: Vec<TermMap<f64>>,
    /// Per pair of layers; the garment terms are zero.
    pub layers: Vec<TermMap<f64>>,
}

/// Whether a term is a sum over vertices that is compared with terms that do not grow with the vertex count.
fn grows_with_vertices(term: Term) -> bool {
    matches!(term, Term::BodyCollision | Term::LayerCollision)
}

/// Weights at `run_progress` for garments of `vertex_counts` and pairs of positions `(inner, outer)`.
///
/// Collision terms are scaled by `reference_vertices / N` of the garment whose vertices they sum over (the outer one
/// of a pair), because their weights belong to the paper's vertex count.
pub fn scene_weights(
    losses: &LossesConfig,
    run_progress: f64,
    vertex_counts: &[usize],
    pairs: &[(usize, usize)],
) -> SceneWeights {
    let weights = |of_layers: bool, vertices: usize| {
        let mut map = TermMap::<f64>::default();
        for term in Term::ALL.into_iter().filter(|t| t.is_layer_term() == of_layers) {
            let scale = match grows_with_vertices(term) && losses.reference_vertices > 0.0 {
                true => losses.reference_vertices / vertices as f64,
                false => 1.0,
            };
            map[term] = losses.weight(term).at(run_progress) * scale;
        }
        map
    };
    SceneWeights {
        garments: vertex_counts.iter().map(|&n| weights(false, n)).collect(),
        layers: pairs.iter().map(|&(_, outer)| weights(true, vertex_counts[outer])).collect(),
    }
}
