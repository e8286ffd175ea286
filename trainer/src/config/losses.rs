//! The eight losses: weights and the switches between the paper's printed form and the measured better one.

use super::ramp::Ramp;
use clothcombo_physics::energy::{ContactSamples, EnergyError, EnergySettings, LayerGate, Material, Term};
use clothcombo_physics::query::Distance;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which distance to the body the collision and distance losses use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DistanceMode {
    /// Offset from the nearest body vertex along its normal (the paper's).
    #[default]
    NearestVertex,
    /// Signed distance to the closest surface point with pseudo-normals: exact, slower.
    ClosestPoint,
}

impl From<DistanceMode> for Distance {
    fn from(mode: DistanceMode) -> Self {
        match mode {
            DistanceMode::NearestVertex => Distance::NearestVertex,
            DistanceMode::ClosestPoint => Distance::ClosestPoint,
        }
    }
}

/// Which points of a garment a collision is summed over; the sum is divided by how many there are for each vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SamplesMode {
    /// The vertices (the paper's): what is between them can intersect unnoticed.
    #[default]
    Vertices,
    /// Also the centres of the faces.
    Faces,
    /// Also the midpoints of the edges.
    FacesAndEdges,
}

impl From<SamplesMode> for ContactSamples {
    fn from(mode: SamplesMode) -> Self {
        match mode {
            SamplesMode::Vertices => Self::Vertices,
            SamplesMode::Faces => Self::Faces,
            SamplesMode::FacesAndEdges => Self::FacesAndEdges,
        }
    }
}

/// A loss with nothing but a weight.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlainLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
}

/// StVK strain.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StrainLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
    /// Rest triangles flatter than this ratio of height to longest edge count as if they had it: a needle is else a
    /// spring of unbounded stiffness, whose gradient hides all others. At most 0.5. 0 is the paper's printed form, and
    /// that of `clothcombo score`.
    pub needle_ratio: f64,
}

impl Default for StrainLoss {
    fn default() -> Self {
        Self { weight: 1.0.into(), needle_ratio: EnergySettings::default().needle_ratio }
    }
}

/// Body collision, Σ max(ε − d, 0)³.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BodyCollisionLoss {
    /// Factor on the raw value (1/m³ · J).
    pub weight: Ramp,
    /// Distance to the body that a vertex should keep (m).
    pub epsilon: f64,
    /// How the distance is measured.
    pub distance: DistanceMode,
    /// Points that should keep it.
    pub samples: SamplesMode,
}

impl Default for BodyCollisionLoss {
    fn default() -> Self {
        Self {
            weight: 250.0.into(),
            epsilon: 0.005,
            distance: DistanceMode::NearestVertex,
            samples: SamplesMode::Vertices,
        }
    }
}

/// Repulsion between near vertices of one garment that share no edge.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RepulsionLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
    /// Pairs farther apart than this do not repel (m).
    pub radius: f64,
    /// Divide the printed double sum by the vertex count.
    pub per_vertex: bool,
    /// Random pairs per vertex, other ones in every training scene: an estimate without bias. 0 takes every pair.
    pub subset: usize,
}

impl Default for RepulsionLoss {
    fn default() -> Self {
        Self { weight: 0.001.into(), radius: 0.1, per_vertex: true, subset: 16 }
    }
}

/// Holding, Σ H (Δy)², of heights before skinning.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HoldingLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
    /// Share of the vertices, from the top, that are held.
    pub fraction: f64,
    /// Measure the displacement from the shape-transferred start instead of the rest garment: a waistband should
    /// follow a taller body.
    pub relative: bool,
    /// Read heights off the posed garment, pulled back by its initial skinning, so that learned skin weights cannot slide a
    /// waistband down for nothing. `false` is the paper's: heights of `x + Δx`, before skinning.
    pub posed: bool,
}

impl Default for HoldingLoss {
    fn default() -> Self {
        Self { weight: 100.0.into(), fraction: 0.1, relative: true, posed: true }
    }
}

/// Collision between layers.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LayerCollisionLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
    /// Gap that an outer vertex should keep to the inner garment (m).
    pub epsilon: f64,
    /// Points of the outer garment that should keep it.
    pub samples: SamplesMode,
    /// Count a pair only when it is really one above the other; the printed form explodes past an open hem.
    pub gated: bool,
    /// Largest tangential offset of a counted pair, in median edge lengths of the inner garment.
    pub gate_tangential_edges: f64,
    /// Largest distance of a counted pair (m).
    pub gate_depth: f64,
}

impl Default for LayerCollisionLoss {
    fn default() -> Self {
        Self {
            weight: 250.0.into(),
            epsilon: 0.002,
            samples: SamplesMode::Vertices,
            gated: true,
            gate_tangential_edges: 0.75,
            gate_depth: 0.05,
        }
    }
}

/// Distance order between layers over the same body vertex.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LayerDistanceLoss {
    /// Factor on the raw value.
    pub weight: Ramp,
    /// Vertices farther than this from the body do not count (m).
    pub radius: f64,
}

impl Default for LayerDistanceLoss {
    fn default() -> Self {
        Self { weight: 25000.0.into(), radius: 0.1 }
    }
}

/// Cloth material; defaults reproduce the paper's magnitudes.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialConfig {
    /// Thickness (m).
    pub thickness: f64,
    /// Density (kg/m³).
    pub density: f64,
    /// First Lamé constant λ (Pa).
    pub lambda: f64,
    /// Second Lamé constant μ (Pa).
    pub mu: f64,
    /// Bending stiffness k (J).
    pub bending_stiffness: f64,
}

impl Default for MaterialConfig {
    fn default() -> Self {
        let m = Material::default();
        Self {
            thickness: m.thickness,
            density: m.density,
            lambda: m.lambda,
            mu: m.mu,
            bending_stiffness: m.bending_stiffness,
        }
    }
}

/// All losses of one run. The key of each table is the name of its energy.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LossesConfig {
    /// Collision and layer-collision weights are multiplied by this over the garment's vertex count: the sums run over
    /// vertices and the paper's weights belong to about 8,000 of them. 0 switches it off.
    pub reference_vertices: f64,
    /// Weight, beside the loss of the outfit, of the losses that every garment of it has when it is draped as a single
    /// garment, before untangling. Counts where all networks are trained at once: what is gained for outfits need not
    /// be lost for single garments. A scene in which nothing can touch has the same losses twice, 1 + `single_garments`
    /// times in all. 0, the default, is the paper's.
    // Configurations of earlier runs are sealed in their checkpoints, and have this key by its earlier name.
    #[serde(alias = "alone")]
    pub single_garments: Ramp,
    /// StVK strain.
    pub strain: StrainLoss,
    /// Bending.
    pub bending: PlainLoss,
    /// Gravity.
    pub gravity: PlainLoss,
    /// Collision with the body.
    pub body_collision: BodyCollisionLoss,
    /// Repulsion inside a garment.
    pub repulsion: RepulsionLoss,
    /// Holding of waistbands.
    pub holding: HoldingLoss,
    /// Collision between layers.
    pub layer_collision: LayerCollisionLoss,
    /// Distance order between layers.
    pub layer_distance: LayerDistanceLoss,
    /// Cloth material.
    pub material: MaterialConfig,
}

impl Default for LossesConfig {
    fn default() -> Self {
        let plain = |w: f64| PlainLoss { weight: w.into() };
        Self {
            reference_vertices: 8000.0,
            single_garments: 0.0.into(),
            strain: StrainLoss::default(),
            bending: plain(5.0),
            gravity: plain(1.0),
            body_collision: BodyCollisionLoss::default(),
            repulsion: RepulsionLoss::default(),
            holding: HoldingLoss::default(),
            layer_collision: LayerCollisionLoss::default(),
            layer_distance: LayerDistanceLoss::default(),
            material: MaterialConfig::default(),
        }
    }
}

impl LossesConfig {
    /// The weight of `term` over the run, before the vertex-count scaling.
    pub fn weight(&self, term: Term) -> &Ramp {
        match term {
            Term::Strain => &self.strain.weight,
            Term::Bending => &self.bending.weight,
            Term::Gravity => &self.gravity.weight,
            Term::BodyCollision => &self.body_collision.weight,
            Term::Repulsion => &self.repulsion.weight,
            Term::Holding => &self.holding.weight,
            Term::LayerCollision => &self.layer_collision.weight,
            Term::LayerDistance => &self.layer_distance.weight,
        }
    }

    /// What is wrong, as (key, what, hint).
    pub fn problem(&self) -> Option<(String, String, String)> {
        let weights = Term::ALL.into_iter().map(|t| (format!("losses.{}.weight", t.name()), self.weight(t)));
        let mut weights = weights.chain([("losses.single_garments".to_owned(), &self.single_garments)]);
        let is_weight = |w: f64| w >= 0.0 && w.is_finite();
        if let Some((key, _)) = weights.find(|(_, w)| !(is_weight(w.from) && is_weight(w.to))) {
            return Some((key, "must be a number from 0 on".into(), "0 switches it off".into()));
        }
        if !is_weight(self.reference_vertices) {
            return Some((
                "losses.reference_vertices".into(),
                "must be a number from 0 on".into(),
                "the paper's weights belong to 8000; 0 switches the scaling off".into(),
            ));
        }
        match self.energy_settings().check().err()? {
            EnergyError::Setting { setting, value, expected } => {
                Some((key_of(setting), format!("is {value}"), format!("it must be {expected}")))
            }
            error => {
                Some(("losses".into(), error.to_string(), "configs/paper.toml shows every value".into()))
            }
        }
    }

    /// The settings the energies are evaluated with.
    pub fn energy_settings(&self) -> EnergySettings {
        let m = &self.material;
        let gate = &self.layer_collision;
        EnergySettings {
            material: Material {
                thickness: m.thickness,
                density: m.density,
                lambda: m.lambda,
                mu: m.mu,
                bending_stiffness: m.bending_stiffness,
            },
            needle_ratio: self.strain.needle_ratio,
            body_collision_epsilon: self.body_collision.epsilon,
            body_samples: self.body_collision.samples.into(),
            layer_samples: gate.samples.into(),
            layer_collision_epsilon: gate.epsilon,
            distance: self.body_collision.distance.into(),
            repulsion_radius: self.repulsion.radius,
            repulsion_normalised: self.repulsion.per_vertex,
            repulsion_subset: (self.repulsion.subset > 0).then_some(self.repulsion.subset),
            layer_gate: gate.gated.then_some(LayerGate {
                tangential_edges: gate.gate_tangential_edges,
                depth: gate.gate_depth,
            }),
            layer_distance_radius: self.layer_distance.radius,
            holding_fraction: self.holding.fraction,
            ..EnergySettings::default()
        }
    }
}

/// The key that sets an energy `setting`.
fn key_of(setting: &str) -> String {
    let key = match setting {
        "body_collision_epsilon" => "body_collision.epsilon",
        "layer_collision_epsilon" => "layer_collision.epsilon",
        "needle_ratio" => "strain.needle_ratio",
        "layer_gate.tangential_edges" => "layer_collision.gate_tangential_edges",
        "layer_gate.depth" => "layer_collision.gate_depth",
        "layer_distance_radius" => "layer_distance.radius",
        "repulsion_radius" => "repulsion.radius",
        "repulsion_subset" => "repulsion.subset",
        "holding_fraction" => "holding.fraction",
        // Those of the material have one name.
        same => same,
    };
    format!("losses.{key}")
}
