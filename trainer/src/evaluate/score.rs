//! The score of one draped scene.

use crate::scene::PreparedScene;
use clothcombo_physics::contact::{
    LayerOrder, OrderViolations, Penetration, PosedBody, Report, ReportGarment, Selection,
};
use clothcombo_physics::energy::{Term, TermMap};
use clothcombo_physics::query::{Distance, Surface};

/// Vertices deeper than this inside the body count as visibly wrong (m).
pub const DEEP: f64 = 0.005;

/// Positions of all garments of a scene on its first body, packed inner → outer.
#[derive(Clone, Debug)]
pub struct Draped {
    /// Before skinning (T-pose), `[ΣV, 3]`.
    pub canonical: Vec<[f32; 3]>,
    /// After skinning, `[ΣV, 3]`.
    pub posed: Vec<[f32; 3]>,
}

/// What one draped scene scores.
#[derive(Clone, Debug, Default)]
pub struct SceneScore {
    /// Raw energies summed over garments and pairs.
    pub raw: TermMap<f64>,
    /// The same, weighted.
    pub weighted: TermMap<f64>,
    /// Weighted sum.
    pub total: f64,
    /// Garment vertices inside the body, by closest surface point.
    pub penetration: Penetration,
    /// Layer-order violations by the nearest vertex, over all pairs of layers that interact.
    pub order: OrderViolations,
}

/// Scores `draped` on the first body of `scene`, whose surface in f64 is `body`.
pub fn score_scene(scene: &PreparedScene, body: &Surface<f64>, draped: &Draped) -> SceneScore {
    let energy = &scene.bodies[0].energy;
    // Terms of weight 0 are scored as well: an ablation wants to see what it left out.
    let value = energy.raw(&draped.posed, &draped.canonical);
    let mut score = SceneScore::default();
    let weights = energy.garments.iter().map(|g| &g.weights).chain(energy.layers.iter().map(|l| &l.weights));
    for (raw, weights) in value.garments.iter().chain(&value.layers).zip(weights) {
        for term in Term::ALL {
            if let Some(v) = raw[term] {
                score.raw[term] += v;
                score.weighted[term] += v * weights[term];
                score.total += v * weights[term];
            }
        }
    }
    let positions: Vec<[f64; 3]> = draped.posed.iter().map(|p| p.map(f64::from)).collect();
    let garments: Vec<ReportGarment> = scene
        .parts(&positions)
        .into_iter()
        .zip(&scene.worn)
        .map(|(positions, worn)| ReportGarment { positions, faces: worn.garment.rest.faces() })
        .collect();
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &scene.contacts, order, triangles: false, body_itself: false };
    let report = Report::count(&PosedBody::new(body, Distance::ClosestPoint), &garments, &selection);
    (score.penetration, score.order) = (report.penetration(DEEP), report.order());
    score
}
