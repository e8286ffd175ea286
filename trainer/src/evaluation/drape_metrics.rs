//! What is measured of a drape: energies, depths and exact intersections; and of a method over many scenes.

use super::score::{SceneScore, report_garments, score_scene};
use super::{Estimate, Metric};
use crate::dataset::PreparedScene;
use crate::inference::Draped;
use crate::inference::reference::wide;
use clothcombo_physics::contact::{
    self, CountedBody, Intersections, LayerOrder, ReportGarment, Selection, all_layers, self_collision,
};
use clothcombo_physics::energy::{EnergySettings, SceneEnergy, SceneLayers, Term, TermMap};
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::Distance;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// One drape of a scene.
#[derive(Clone, Debug, Default)]
pub struct DrapeMetrics {
    /// Energies, vertices inside the body, layer-order violations.
    pub score: SceneScore,
    /// Collision with the body in the paper's form: weight 250, ε = 2 mm, not scaled with the number of vertices.
    pub paper_collision: f64,
    /// Collision between garments in the same form, over every two garments.
    pub paper_layer_collision: f64,
    /// The paper's degree of self-collision ([`self_collision`]), summed over the garments.
    pub self_collision: f64,
    /// Intersections with the body.
    pub body: Intersections,
    /// Intersections of garments with each other.
    pub layers: Intersections,
    /// Self-intersections.
    pub own: Intersections,
}

/// Vertices repel each other below this distance in the paper (m).
const PAPER_REPULSION_RADIUS: f64 = 0.1;
/// What columns call the paper's form of a collision.
pub const PAPER_COLLISION: &str = "paper's form: 250, ε 2 mm";
/// Weight of both collisions in the paper.
const PAPER_COLLISION_WEIGHT: f64 = 250.0;

/// Measures drapes of `scene` on its first body.
pub fn measure(scene: &PreparedScene, drapes: &[Draped]) -> Vec<DrapeMetrics> {
    let surface = scene.exact_body();
    let body = CountedBody::new(&surface, Distance::NearestVertex);
    let layers = all_layers(scene.garments.len());
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &layers, order, triangles: true, body_itself: false };
    let paper = paper_collisions(&scene.bodies[0].energy);
    let topologies: Vec<_> = scene.garments.iter().map(|g| Topology::new(&g.garment.rest)).collect();
    let measured = |draped: &Draped| {
        let positions = wide(&draped.posed);
        let garments = report_garments(scene, &positions);
        let report = contact::Report::count(&body, &garments, &selection);
        let degrees = garments.iter().zip(&report.garments).zip(&topologies);
        let degrees = degrees.map(|((&ReportGarment { positions, faces }, found), topology)| {
            self_collision(positions, faces, &found.with_itself.pairs, topology, PAPER_REPULSION_RADIUS)
        });
        let paper = paper.value(&draped.posed, &draped.canonical);
        let weighted = |values: &[TermMap<Option<f64>>], term: Term| -> f64 {
            PAPER_COLLISION_WEIGHT * values.iter().filter_map(|raw| raw[term]).sum::<f64>()
        };
        DrapeMetrics {
            score: score_scene(scene, &surface, draped),
            paper_collision: weighted(&paper.garments, Term::BodyCollision),
            paper_layer_collision: weighted(&paper.layers, Term::LayerCollision),
            self_collision: degrees.sum(),
            body: report.garments.iter().map(|garment| garment.with_body.numbers()).sum(),
            layers: report.layers.iter().map(|layer| layer.pairs.numbers()).sum(),
            own: report.garments.iter().map(|garment| garment.with_itself.numbers()).sum(),
        }
    };
    drapes.iter().map(measured).collect()
}

/// The two collisions of `scene` as the paper prints them, and nothing else: nearest vertex, ε = 2 mm (half the thickness
/// of cloth that is thicker), every two garments, no gate, no scaling with the number of vertices.
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
        body_samples: printed.body_samples,
        layer_samples: printed.layer_samples,
        ..scene.settings
    };
    paper.garments.iter_mut().for_each(|garment| garment.weights = only(Term::BodyCollision));
    let count = paper.garments.len();
    let pairs = (0..count).flat_map(|inner| (inner + 1..count).map(move |outer| (inner, outer)));
    let weights = only(Term::LayerCollision);
    paper.layers = pairs.map(|(inner, outer)| SceneLayers { inner, outer, weights }).collect();
    paper
}

/// What is estimated besides the energies.
const DRAPE_METRICS: [Metric<DrapeMetrics>; 9] = [
    ("total", |m| m.score.total),
    ("paper_collision", |m| m.paper_collision),
    ("paper_layer_collision", |m| m.paper_layer_collision),
    ("self_collision", |m| m.self_collision),
    ("inside", |m| m.share_of_vertices(m.score.penetration.inside)),
    ("deeper_than_5mm", |m| m.share_of_vertices(m.score.penetration.deep)),
    ("body_pairs", |m| m.body.pairs as f64),
    ("contour_mm", |m| 1e3 * m.body.contour_length),
    ("self_pairs", |m| m.own.pairs as f64),
];

impl DrapeMetrics {
    fn share_of_vertices(&self, count: usize) -> f64 {
        count as f64 / self.score.penetration.vertices.max(1) as f64
    }
}

/// Estimates of one drape per scene: the energies as they are (strain, bending and gravity in J) and times their weights (J), and
/// the [`DRAPE_METRICS`].
pub fn estimates(method: &str, scenes: &[&DrapeMetrics]) -> Value {
    let energies = |terms: fn(&SceneScore) -> &TermMap<f64>| -> BTreeMap<&str, Estimate> {
        let of = |term: Term| Estimate::of(scenes.iter().map(|m| terms(&m.score)[term]));
        Term::ALL.into_iter().map(|term| (term.name(), of(term))).collect()
    };
    let mut estimates = json!(Estimate::of_metrics(scenes, &DRAPE_METRICS));
    estimates["method"] = json!(method);
    estimates["raw"] = json!(energies(|score| &score.raw));
    estimates["weighted"] = json!(energies(|score| &score.weighted));
    estimates
}
