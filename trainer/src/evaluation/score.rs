//! The score of one draped scene, and of a method over many.

use crate::dataset::PreparedScene;
use crate::inference::Draped;
use crate::inference::reference::wide;
use crate::run::spread::Spread;
use crate::run::validation::MethodScore;
use clothcombo_physics::contact::{
    CountedBody, LayerOrder, OrderViolations, Penetration, Report, ReportGarment, Selection,
};
use clothcombo_physics::energy::{SceneEnergy, Term, TermMap};
use clothcombo_physics::query::{Distance, Surface};

/// Vertices deeper than this inside the body count as visibly wrong (m).
pub const VISIBLE_DEPTH: f64 = 0.005;

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
    for (term, raw, weight) in weighted_terms(energy, &value.garments, &value.layers) {
        score.raw[term] += raw;
        score.weighted[term] += raw * weight;
        score.total += raw * weight;
    }
    let positions = wide(&draped.posed);
    let garments = report_garments(scene, &positions);
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &scene.contacts, order, triangles: false, body_itself: false };
    let report = Report::count(&CountedBody::new(body, Distance::ClosestPoint), &garments, &selection);
    (score.penetration, score.order) = (report.penetration(VISIBLE_DEPTH), report.order());
    score
}

/// The energies of a scene that were evaluated, of all `garments` and then of all `layers`: term, raw value and weight.
pub fn weighted_terms<'a>(
    energy: &'a SceneEnergy<f32>,
    garments: &'a [TermMap<Option<f64>>],
    layers: &'a [TermMap<Option<f64>>],
) -> impl Iterator<Item = (Term, f64, f64)> + 'a {
    let weights = energy.garments.iter().map(|g| &g.weights).chain(energy.layers.iter().map(|l| &l.weights));
    let values = garments.iter().chain(layers).zip(weights);
    values.flat_map(|(values, weights)| {
        Term::ALL.into_iter().filter_map(|term| Some((term, values[term]?, weights[term])))
    })
}

/// The garments of `scene` at packed `positions`, to be counted.
pub fn report_garments<'a>(scene: &'a PreparedScene, positions: &'a [[f64; 3]]) -> Vec<ReportGarment<'a>> {
    let parts = scene.parts(positions).into_iter().zip(&scene.garments);
    parts
        .map(|(positions, garment)| ReportGarment { positions, faces: garment.garment.rest.faces() })
        .collect()
}

/// Gathers the scores of `method` over scenes.
pub fn method_score(method: &'static str, scenes: &[SceneScore]) -> MethodScore {
    let over = |f: &dyn Fn(&SceneScore) -> f64| Spread::of(scenes.iter().map(f).collect());
    let share = |part: &dyn Fn(&SceneScore) -> usize, whole: &dyn Fn(&SceneScore) -> usize| {
        let (p, w): (usize, usize) = scenes.iter().fold((0, 0), |a, s| (a.0 + part(s), a.1 + whole(s)));
        if w == 0 { 0.0 } else { p as f64 / w as f64 }
    };
    MethodScore {
        method,
        total: over(&|s| s.total),
        raw: Term::ALL.into_iter().map(|t| (t.name(), over(&|s| s.raw[t]))).collect(),
        weighted: Term::ALL.into_iter().map(|t| (t.name(), over(&|s| s.weighted[t]).mean)).collect(),
        inside: share(&|s| s.penetration.inside, &|s| s.penetration.vertices),
        deeper_than_5mm: share(&|s| s.penetration.deep, &|s| s.penetration.vertices),
        order_violations_nearest_vertex: share(&|s| s.order.violations, &|s| s.order.counted),
    }
}
