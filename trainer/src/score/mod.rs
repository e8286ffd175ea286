//! Scores of anyone's draped garments. In: meshes of a body and of garments at rest and draped. Out: every energy in the paper's
//! printed form ([`EnergySettings::printed`]), penetration of the body, exact triangle intersections, order of the layers.
//!
//! Nothing is measured here: energies come from [`SceneEnergy::raw`], contacts from [`contact::Report`]. This file
//! fixes the definitions and the form of the answer.

mod files;
mod place;
#[cfg(test)]
mod tests;

pub use files::{NamedMesh, SceneMeshes, checked_body, checked_garment, score_meshes};
pub(crate) use place::misplaced;

use crate::config::LossesConfig;
use crate::dataset::objective::scene_weights;
use clothcombo_physics::contact::{self, CountedBody, LayerOrder, ReportGarment, Selection};
use clothcombo_physics::energy::{
    EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers, Term, TermMap,
};
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::query::{Distance, Surface};
use miette::{Report, miette};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Which distance to the body collision, layer distance and penetration are measured with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ScoreDistance {
    /// Offset from the nearest body vertex along its area-weighted normal: the paper's.
    #[default]
    NearestVertex,
    /// Signed distance to the closest point of the body's surface.
    Surface,
}

impl From<ScoreDistance> for Distance {
    fn from(distance: ScoreDistance) -> Self {
        match distance {
            ScoreDistance::NearestVertex => Distance::NearestVertex,
            ScoreDistance::Surface => Distance::ClosestPoint,
        }
    }
}

/// Values by the name of their energy ([`Term::name`]).
pub type TermValues = BTreeMap<String, f64>;

/// Everything that is known of garments draped on a body. Indices are 0-based, shares lie between 0 and 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The definitions used.
    pub settings: ScoreSettings,
    /// The body alone.
    pub body: BodyScore,
    /// Every garment, innermost first.
    pub garments: Vec<GarmentScore>,
    /// Every two garments, by inner, then outer index.
    pub layers: Vec<LayerScore>,
}

/// The definitions a score was made with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoreSettings {
    /// Margin ε of both collision energies (mm).
    pub epsilon_mm: f64,
    /// The distance to the body.
    pub distance: ScoreDistance,
}

/// Intersections of the body with itself: no garment can avoid them, so they are counted against none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BodyScore {
    /// Pairs of its triangles that intersect.
    pub self_triangle_pairs: usize,
}

/// One garment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GarmentScore {
    /// Its name: of files, the draped file's name without extension.
    pub name: String,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Energies of one garment (J, m³, 1, m²); holding only where canonical positions are given.
    pub raw: TermValues,
    /// The same times the paper's weights, whatever the number of vertices.
    pub weighted: TermValues,
    /// How it intersects the body and itself.
    pub penetration: PenetrationScore,
}

/// Contact of one garment with the body and with itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PenetrationScore {
    /// Share of the vertices inside the body, by the distance of [`ScoreSettings::distance`].
    pub vertices_inside: f64,
    /// Largest depth of a vertex (mm); 0 when none is inside.
    pub max_depth_mm: f64,
    /// Pairs of a garment triangle and a body triangle that share a point. Exact.
    pub body_triangle_pairs: usize,
    /// Pairs of triangles of the garment that share more than their common vertices. Exact.
    pub self_triangle_pairs: usize,
}

/// Two garments, one over the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LayerScore {
    /// Index of the garment nearer to the body.
    pub inner: usize,
    /// Index of the garment over it.
    pub outer: usize,
    /// Layer collision, ungated (m³).
    pub layer_collision: f64,
    /// Layer distance (m³).
    pub layer_distance: f64,
    /// Pairs of triangles that share a point. Exact.
    pub triangle_pairs: usize,
    /// Share of the outer vertices within 5 cm of the inner garment that violate the order of the layers: their gap to
    /// the nearest inner vertex is negative (the paper's form).
    pub order_violations_nearest_vertex: f64,
}

/// A garment to be scored.
#[derive(Clone, Copy, Debug)]
pub struct DrapedGarment<'a> {
    /// Its name.
    pub name: &'a str,
    /// The undeformed garment.
    pub rest: &'a TriMesh,
    /// Draped positions of the vertices of `rest`, `[V, 3]` (m).
    pub positions: &'a [[f64; 3]],
    /// The same before skinning, for the holding energy against `rest`, the paper's printed form; all garments have them or
    /// none.
    pub canonical: Option<&'a [[f64; 3]]>,
}

/// Scores `garments`, innermost first, on the posed `body`.
///
/// # Errors
/// Naming the garment whose positions, rest shape or values cannot be used.
pub fn score(body: &TriMesh, garments: &[DrapedGarment], distance: ScoreDistance) -> Result<Score, Report> {
    let settings = EnergySettings { distance: distance.into(), ..EnergySettings::printed() };
    let surface = Arc::new(Surface::<f64>::from_mesh(&used_part(body)));
    let pairs: Vec<(usize, usize)> =
        (0..garments.len()).flat_map(|i| (i + 1..garments.len()).map(move |j| (i, j))).collect();
    let counts: Vec<usize> = garments.iter().map(|g| g.rest.vertex_count()).collect();
    // The paper's weights are the defaults of the configuration, without the scaling by the number of vertices.
    let losses = LossesConfig { reference_vertices: 0.0, ..LossesConfig::default() };
    let weights = scene_weights(&losses, 1.0, &counts, &pairs);
    let scene_garments = garments
        .iter()
        .zip(&weights.garments)
        .map(|(garment, weights)| scene_garment(garment, *weights, &settings))
        .collect::<Result<Vec<_>, _>>()?;
    let scene = SceneEnergy {
        body: surface.clone(),
        garments: scene_garments,
        layers: pairs
            .iter()
            .zip(&weights.layers)
            .map(|(&(inner, outer), weights)| SceneLayers { inner, outer, weights: *weights })
            .collect(),
        settings,
    };
    let posed: Vec<[f64; 3]> = garments.iter().flat_map(|g| g.positions).copied().collect();
    let canonical: Option<Vec<&[[f64; 3]]>> = garments.iter().map(|g| g.canonical).collect();
    let value = scene.raw(&posed, &canonical.map_or(Vec::new(), |parts| parts.concat()));

    let meshes: Vec<ReportGarment> =
        garments.iter().map(|g| ReportGarment { positions: g.positions, faces: g.rest.faces() }).collect();
    let order = LayerOrder::NearestVertex;
    let selection = Selection { layers: &pairs, order, triangles: true, body_itself: true };
    let report = contact::Report::count(&CountedBody::new(&surface, distance.into()), &meshes, &selection);

    let garment_scores = garments.iter().enumerate().map(|(i, garment)| -> Result<GarmentScore, Report> {
        let (found, inside) = (&report.garments[i], report.garments[i].penetration(0.0));
        Ok(GarmentScore {
            name: garment.name.to_owned(),
            vertices: garment.rest.vertex_count(),
            triangles: garment.rest.face_count(),
            raw: named(garment.name, &value.garments[i], |_| 1.0)?,
            weighted: named(garment.name, &value.garments[i], |term| weights.garments[i][term])?,
            penetration: PenetrationScore {
                vertices_inside: inside.inside as f64 / inside.vertices as f64,
                max_depth_mm: 1e3 * inside.max_depth,
                body_triangle_pairs: found.with_body.pairs.len(),
                self_triangle_pairs: found.with_itself.pairs.len(),
            },
        })
    });
    let layer_scores =
        value.layers.iter().zip(&report.layers).map(|(raw, layer)| -> Result<LayerScore, Report> {
            let [under, over] = [layer.inner, layer.outer].map(|garment| garments[garment].name);
            let raw = named(&format!("{under} under {over}"), raw, |_| 1.0)?;
            Ok(LayerScore {
                inner: layer.inner,
                outer: layer.outer,
                layer_collision: raw[Term::LayerCollision.name()],
                layer_distance: raw[Term::LayerDistance.name()],
                triangle_pairs: layer.pairs.pairs.len(),
                order_violations_nearest_vertex: layer.order().share(),
            })
        });
    Ok(Score {
        settings: ScoreSettings { epsilon_mm: 1e3 * settings.body_collision_epsilon, distance },
        body: BodyScore { self_triangle_pairs: report.body_itself.pairs },
        garments: garment_scores.collect::<Result<_, Report>>()?,
        layers: layer_scores.collect::<Result<_, Report>>()?,
    })
}

/// The body without the vertices that no face uses (helpers, joints): as nearest vertices they would hide the surface.
fn used_part(body: &TriMesh) -> TriMesh {
    let mut number = vec![u32::MAX; body.vertex_count()];
    let mut positions = Vec::with_capacity(body.vertex_count());
    body.faces().as_flattened().iter().for_each(|&v| number[v as usize] = 0);
    for (number, position) in number.iter_mut().zip(body.positions()).filter(|(number, _)| **number == 0) {
        *number = positions.len() as u32;
        positions.push(*position);
    }
    let faces = body.faces().iter().map(|face| face.map(|v| number[v as usize])).collect();
    TriMesh::new(positions, faces).expect("a part of a valid mesh that keeps every face is valid")
}

fn scene_garment(
    garment: &DrapedGarment,
    weights: TermMap<f64>,
    settings: &EnergySettings,
) -> Result<SceneGarment<f64>, Report> {
    let name = garment.name;
    if let Some([face, first]) = garment.rest.doubled_face() {
        return Err(miette!(
            help = "remove one of them, or let `clothcombo fit` repair the rest mesh (triangles count from 0, after polygons \
                    were cut)",
            "garment '{name}': face {face} has the vertices of face {first}"
        ));
    }
    for positions in [Some(garment.positions), garment.canonical].into_iter().flatten() {
        let moved = garment.rest.with_positions(positions.to_vec());
        moved.map_err(|reason| miette!("garment '{name}': {reason}"))?;
    }
    let is_held = garment.canonical.is_some();
    let energies = GarmentEnergies::new(garment.rest, &Topology::new(garment.rest), settings, is_held)
        .map_err(|reason| miette!("garment '{name}': {reason}"))?;
    Ok(SceneGarment {
        energies: Arc::new(energies),
        holding_reference: if is_held { garment.rest.positions().to_vec() } else { Vec::new() },
        pull_back: None,
        thickness_below: Vec::new(),
        weights,
    })
}

/// The evaluated terms by name, times `factor`.
fn named(
    of: &str,
    values: &TermMap<Option<f64>>,
    factor: impl Fn(Term) -> f64,
) -> Result<TermValues, Report> {
    let evaluated = values.iter().filter_map(|(term, value)| Some((term, (*value)? * factor(term))));
    evaluated
        .map(|(term, value)| match value.is_finite() {
            true => Ok((term.name().to_owned(), value)),
            false => Err(miette!(
                help = "the coordinates are far outside a human body; all files must be in metres",
                "'{of}' has a {} of {value}",
                term.name()
            )),
        })
        .collect()
}
