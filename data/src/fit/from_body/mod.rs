//! A garment that was made on a known body is placed exactly, through that body: nothing about its place is searched for.
//!
//! In three steps: the file's coordinates become those of the source body (unit, axes, origin); the garment is carried from the
//! source body to the zero body of the target; what is left is measured, and refused where it is implausible.
//!
//! | source body | carried by |
//! |---|---|
//! | npz of the target's model | inverse of the shape transfer ([`same_model`]) |
//! | npz of another model | a similarity per bone ([`bones`]), then the distance to the skin ([`gaps`]) |
//! | mesh of the target's vertices | recovered pose and shape, then as the first ([`same_model`]) |
//! | any mesh of a person | registration with the target's model ([`registration`]), the distance to the skin, then as the first |

mod binding;
mod bones;
mod closest_shape;
mod gaps;
mod icp;
mod registration;
mod same_model;
mod source;
mod stance;
#[cfg(test)]
mod tests;

pub(super) use binding::SourceCloth;
pub(super) use same_model::{POSE_BINDINGS, SameModel};
pub use source::SourceBody;

use super::error::FitError;
use super::placement::{FileOrigin, Placement, Unit, UpAxis};
use super::settings::FitSettings;
use crate::asset::body::skin;
use crate::asset::{Body, Category};
use crate::mesh::gaps_to;
use bones::similarities;
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{norm, scale, sub};
use gaps::{apart_mm, median, restore};
use icp::Similarity;
use registration::{RegisteredMesh, register};
use same_model::{RecoveredMesh, SHAPE_BINDINGS, has_topology, recovered};
use serde::Serialize;
use source::{SourceKind, SourceMesh, SourceModel};

/// What was done with a garment that was made on another body.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SourcePlacement {
    /// The body's file, with shape parameters where some were given.
    pub body: String,
    /// Shape of the source body, given or recovered; for a mesh of another model the target's that looks most like it.
    pub shape: Vec<f64>,
    /// How the garment was carried.
    pub carried: Carried,
    /// Median distance of the source body's surface to the target's after the alignment (mm), before the garment's distances to
    /// the skin are restored; none where they have the same vertices.
    pub alignment_mm: Option<f64>,
    /// Where the source body's pelvis is in the file's coordinates once they are in metres, y up; none where it was registered.
    pub pelvis: Option<[f64; 3]>,
    /// Scale of the alignment beside the unit; 1 between bodies of the same vertices.
    pub scale: f64,
    /// Median distance between where the source body has the vertices (in the target's coordinates) and where the
    /// target has them (mm).
    pub moved_mm: f64,
}

/// How a garment was carried to the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Carried {
    /// Inverse of the shape transfer, between bodies of the same vertices.
    Shape,
    /// Inverse of pose and shape, recovered from a mesh of the target's vertices.
    PoseAndShape,
    /// Joint by joint, then by the distances to the skin.
    Bones,
    /// By registration of the surfaces, then by the distances to the skin.
    Registration,
}

impl SourcePlacement {
    /// In words.
    pub fn text(&self) -> String {
        let Self { body, shape, carried, alignment_mm, pelvis, scale, moved_mm } = self;
        let shape = match shape.is_empty() {
            true => String::new(),
            false => {
                format!(" (shape {})", shape.iter().map(|b| format!("{b:.2}")).collect::<Vec<_>>().join(","))
            }
        };
        let how = match carried {
            Carried::Shape => "the same vertices".to_owned(),
            Carried::PoseAndShape => "pose and shape recovered from its vertices".to_owned(),
            Carried::Bones => "another model, joint by joint".to_owned(),
            Carried::Registration => format!("registered, scaled by {scale:.3}"),
        };
        let alignment =
            alignment_mm.map(|mm| format!("; surfaces {mm:.1} mm apart (median)")).unwrap_or_default();
        let pelvis = pelvis.map(|p| p.map(|x| format!("{}", (1e3 * x).round() + 0.0)).join(", "));
        let pelvis = pelvis.map(|p| format!(", its pelvis at {p} mm")).unwrap_or_default();
        format!("placed through body {body}{shape}{pelvis}: {how}{alignment}; median |Δ| {moved_mm:.1} mm")
    }
}

/// A source body brought to the target.
pub(super) struct Aligned {
    /// From the file to the source body, in metres with y up.
    pub placement: Placement,
    /// The surface on which the garment was made (m).
    source: Surface<f64>,
    to_model: ToModel,
    /// The target's model, on which the garment lies then.
    model: SameModel,
    /// What is said of it, but for how far the garment moves.
    report: SourcePlacement,
}

/// How cloth on the source body comes to the target's model.
enum ToModel {
    /// It is there.
    Identity,
    /// By the bones of another model's body.
    Bones(Box<Body>, Vec<[[f64; 4]; 3]>),
    Registration(Similarity),
}

impl SourceBody {
    /// Brings the source body to the target, whatever the garment.
    ///
    /// # Errors
    /// [`FitError::SourceBody`]: hints that contradict it, or no such alignment.
    pub(super) fn aligned(&self, body: &Body, settings: &FitSettings) -> Result<Aligned, FitError> {
        let wrong = |what: String| FitError::SourceBody { name: self.name.clone(), what };
        let is_mesh = matches!(self.kind, SourceKind::Mesh(_));
        for (is_given, flag, says) in [
            (settings.offset.is_some() && is_mesh, "--offset", "where the origin is"),
            (settings.arms_lowered.is_some(), "--arms", "how the arms are held"),
            (settings.legs_degrees.is_some(), "--legs", "how the legs are held"),
        ] {
            if is_given {
                return Err(wrong(format!("the body says {says}; leave {flag} out")));
            }
        }
        let report = SourcePlacement {
            body: self.name.clone(),
            shape: Vec::new(),
            carried: Carried::Shape,
            alignment_mm: None,
            pelvis: None,
            scale: 1.0,
            moved_mm: 0.0,
        };
        match &self.kind {
            SourceKind::Model(source) => Aligned::of_model(source, body, settings, report).map_err(wrong),
            SourceKind::Mesh(mesh) => Aligned::of_mesh(mesh, body, settings, report).map_err(wrong),
        }
    }
}

/// The vertices of a body, carried by its bones.
fn skinned(body: &Body, bones: &[[[f64; 4]; 3]]) -> Vec<[f64; 3]> {
    let carried = |v: usize| {
        let (joints, weights) = body.skin_weights.row(v);
        let bones = joints.iter().zip(weights).map(|(j, w)| (&bones[usize::from(*j)], f64::from(*w)));
        skin(body.template[v], bones)
    };
    (0..body.vertex_count()).map(carried).collect()
}

impl Aligned {
    fn of_model(
        source: &SourceModel,
        body: &Body,
        settings: &FitSettings,
        report: SourcePlacement,
    ) -> Result<Self, String> {
        let translation = settings.offset.unwrap_or(scale(source.pelvis, -1.0));
        let placement = Placement {
            unit: settings.unit.unwrap_or(Unit::M),
            up: settings.up.unwrap_or(UpAxis::Y),
            turn_degrees: settings.turn_degrees.unwrap_or(0.0),
            origin: FileOrigin::SourceBody,
            translation,
            ..Placement::AS_GIVEN
        };
        let pelvis = Some(translation.map(|x| 0.0 - x));
        let report = SourcePlacement { shape: source.shape.clone(), pelvis, ..report };
        let own = &source.body;
        let surface = Surface::from_mesh(&own.zero_body());
        if has_topology(body, &own.faces) {
            let (to_model, model) = (ToModel::Identity, SameModel::shaped(own.template.clone()));
            return Ok(Self { placement, source: surface, to_model, model, report });
        }
        let bones = similarities(own, body)?;
        let alignment_mm = Some(apart_mm(&skinned(own, &bones), &Surface::from_mesh(&body.zero_body())));
        Ok(Self {
            placement,
            source: surface,
            to_model: ToModel::Bones(Box::new(own.clone()), bones),
            model: SameModel::shaped(body.template.clone()),
            report: SourcePlacement { carried: Carried::Bones, alignment_mm, ..report },
        })
    }

    fn of_mesh(
        mesh: &SourceMesh,
        body: &Body,
        settings: &FitSettings,
        report: SourcePlacement,
    ) -> Result<Self, String> {
        // Vertices in another order, or of another model by chance, are a mesh like any other.
        if let Some(RecoveredMesh { placement, shape, model, residual_mm }) = recovered(mesh, body, settings)
        {
            let source = Surface::new(model.positions().to_vec(), body.faces.clone());
            let (carried, alignment_mm) = (Carried::PoseAndShape, Some(residual_mm));
            let pelvis = Some(placement.translation.map(|x| 0.0 - x));
            let report = SourcePlacement { shape, carried, alignment_mm, pelvis, ..report };
            return Ok(Self { placement, source, to_model: ToModel::Identity, model, report });
        }
        let RegisteredMesh { placement, motion, model, alignment_mm } =
            register(&mesh.surface, body, settings)?;
        let positions = placement.apply(mesh.surface.positions());
        let report = SourcePlacement {
            shape: model.shape.clone(),
            carried: Carried::Registration,
            alignment_mm: Some(alignment_mm),
            scale: motion.scale,
            ..report
        };
        Ok(Self {
            placement,
            source: Surface::new(positions, mesh.surface.faces().into()),
            to_model: ToModel::Registration(motion),
            model: SameModel::posed(body, model)?,
            report,
        })
    }

    /// A garment that does not lie on its body.
    pub fn not_on_it(&self, where_it_is: &str) -> FitError {
        let what = format!(
            "the garment does not lie on this body: {where_it_is}. It must be in the body file's coordinates, in its pose and shape: \
             export both together, or say how the garment's coordinates differ by --unit, --up, --turn and, beside an npz, --offset; \
             an npz takes shape parameters as body.npz:1.2,-0.5"
        );
        FitError::SourceBody { name: self.report.body.clone(), what }
    }

    /// What is odd about a garment where its body puts it.
    pub fn doubt(&self, what: &str) -> String {
        format!(
            "placed through {}, the garment looks odd: {what}: was it made on this body, and are both in the same coordinates?",
            self.report.body
        )
    }

    /// Carries a garment, `[V, 3]` in the file's coordinates, to the zero body of `body` (m), and says how.
    ///
    /// # Errors
    /// [`FitError::SourceBody`] when it does not lie on the source body, [`FitError::Mesh`] when no mesh is left of it.
    pub fn carry(
        &self,
        positions: &[[f64; 3]],
        faces: &[[u32; 3]],
        category: Option<Category>,
        body: &Body,
    ) -> Result<(Vec<[f64; 3]>, SourcePlacement), FitError> {
        let placed = self.placement.apply(positions);
        let gaps = gaps_to(&placed, &self.source);
        if let Some(where_it_is) = off_its_body(&gaps) {
            return Err(self.not_on_it(&where_it_is));
        }
        let rest = |positions: &[[f64; 3]]| {
            let cloth = SourceCloth { positions, faces, category };
            self.model.carry(&cloth, body, SHAPE_BINDINGS).map_err(FitError::Mesh)
        };
        let restored = |mut positions: Vec<[f64; 3]>| {
            let gaps: Vec<f64> = gaps.iter().map(|gap| self.report.scale * gap).collect();
            let target = Surface::new(self.model.positions().to_vec(), body.faces.clone());
            restore(&mut positions, faces, &gaps, &target);
            rest(&positions)
        };
        let (carried, base) = match &self.to_model {
            ToModel::Identity => (rest(&placed)?, placed),
            ToModel::Bones(own, bones) => {
                let cloth = SourceCloth { positions: &placed, faces, category };
                let binding = cloth.bound(placed.clone(), own, body).map_err(FitError::Mesh)?;
                (restored(binding.skinned(&placed, bones))?, placed)
            }
            ToModel::Registration(motion) => {
                let moved: Vec<[f64; 3]> = placed.iter().map(|p| motion.apply(*p)).collect();
                let unrestored = rest(&moved)?;
                (restored(moved)?, unrestored)
            }
        };
        let mut moves: Vec<f64> = carried.iter().zip(&base).map(|(a, b)| norm(sub(*a, *b))).collect();
        let report = SourcePlacement { moved_mm: 1e3 * median(&mut moves), ..self.report.clone() };
        Ok((carried, report))
    }
}

/// Cloth this far inside the body (m) is no tight fit any more.
const DEEP_INSIDE: f64 = 0.025;
/// Cloth this close to the skin (m) rests on it.
const CLOSE_TO_SKIN: f64 = 0.05;

/// A garment of which a larger share is deep inside was made on another body, or is in other coordinates.
const MOST_DEEP: f64 = 0.1;
/// So was one of which a smaller share is close to the skin.
const LEAST_CLOSE: f64 = 0.1;

/// Where a garment at these signed distances to its source body (m) is, if it does not lie on that.
fn off_its_body(gaps: &[f64]) -> Option<String> {
    let share = |is: &dyn Fn(f64) -> bool| {
        gaps.iter().filter(|gap| is(**gap)).count() as f64 / gaps.len().max(1) as f64
    };
    let (deep, close) = (share(&|gap| gap < -DEEP_INSIDE), share(&|gap| gap.abs() < CLOSE_TO_SKIN));
    let (depth, reach) = (1e3 * DEEP_INSIDE, 1e3 * CLOSE_TO_SKIN);
    if deep > MOST_DEEP {
        return Some(format!("{:.0} % of the garment is more than {depth:.0} mm inside it", 100.0 * deep));
    }
    (close < LEAST_CLOSE)
        .then(|| format!("only {:.0} % of the garment is within {reach:.0} mm of its skin", 100.0 * close))
}
