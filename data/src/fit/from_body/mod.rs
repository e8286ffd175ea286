//! A garment that was made on a known body is placed exactly, through that body: nothing about its place is searched for.
//!
//! In three steps: the file's coordinates become those of the source body (unit, axes, origin); the garment is carried from the
//! source body to the zero body of the target; what is left is measured, and refused where it is implausible.
//!
//! | source body | carried by |
//! |---|---|
//! | npz of the target's model | inverse of the shape transfer ([`same_model`]) |
//! | npz of another model | a similarity per bone, then the distance to the skin ([`other_model`]) |
//! | mesh of the target's vertices | recovered pose and shape, then as the first ([`same_model`]) |
//! | any mesh of a person | registration with the target's model, the distance to the skin, then as the first ([`registered`]) |

mod bones;
mod gaps;
mod icp;
mod model;
mod other_model;
mod registered;
mod registration;
mod same_model;
mod source;
mod stance;
#[cfg(test)]
mod tests;

pub use source::SourceBody;

use super::error::FitError;
use super::placement::{Origin, Placement, Unit, UpAxis};
use super::settings::FitSettings;
use crate::asset::{Binding, BindingSettings, Body, BodyParts, Category, Garment};
use clothcombo_physics::query::Distance;
use clothcombo_physics::vec3::{norm, scale, sub};
use clothcombo_physics::{Surface, TriMesh};
use other_model::OtherModel;
use rayon::prelude::*;
use registered::Registered;
use same_model::SameModel;
use serde::Serialize;
use source::SourceKind;

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
    name: String,
    shape: Vec<f64>,
    carrier: Carrier,
}

enum Carrier {
    Same(SameModel),
    Other(OtherModel),
    Registered(Registered),
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
        let name = self.name.clone();
        match &self.kind {
            SourceKind::Model(model) => {
                let placement = Placement {
                    unit: settings.unit.unwrap_or(Unit::M),
                    up: settings.up.unwrap_or(UpAxis::Y),
                    turn_degrees: settings.turn_degrees.unwrap_or(0.0),
                    origin: Origin::SourceBody,
                    translation: settings.offset.unwrap_or(scale(model.pelvis, -1.0)),
                    ..Placement::AS_GIVEN
                };
                let carrier = match same_model::has_topology(body, &model.faces) {
                    true => Carrier::Same(SameModel::shaped(model.positions.clone())),
                    false => Carrier::Other(OtherModel::new(model, body).map_err(wrong)?),
                };
                Ok(Aligned { placement, name, shape: model.shape.clone(), carrier })
            }
            SourceKind::Mesh(mesh) => {
                // Vertices in another order, or of another model by chance, are a mesh like any other.
                if let Some((placement, shape, same)) = same_model::recovered(mesh, body, settings) {
                    return Ok(Aligned { placement, name, shape, carrier: Carrier::Same(same) });
                }
                let (placement, registered) = registration::register(mesh, body, settings).map_err(wrong)?;
                let shape = registered.shape.clone();
                Ok(Aligned { placement, name, shape, carrier: Carrier::Registered(registered) })
            }
        }
    }
}

/// Cloth on the source body, in its coordinates (m).
pub(super) struct Cloth<'a> {
    pub positions: &'a [[f64; 3]],
    pub faces: &'a [[u32; 3]],
    pub category: Option<Category>,
}

impl Aligned {
    /// A garment that does not lie on its body.
    pub fn not_on_it(&self, where_it_is: &str) -> FitError {
        let what = format!(
            "the garment does not lie on this body: {where_it_is}. It must be in the body file's coordinates, in its pose and shape: \
             export both together, or say how the garment's coordinates differ by --unit, --up, --turn and, beside an npz, --offset; \
             an npz takes shape parameters as body.npz:1.2,-0.5"
        );
        FitError::SourceBody { name: self.name.clone(), what }
    }

    /// What is odd about a garment where its body puts it.
    pub fn doubt(&self, what: &str) -> String {
        format!(
            "placed through {}, the garment looks odd: {what}: was it made on this body, and are both in the same coordinates?",
            self.name
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
        let source = match &self.carrier {
            Carrier::Same(same) => same.surface(body),
            Carrier::Other(other) => other.surface(),
            Carrier::Registered(registered) => registered.surface(),
        };
        let source = Surface::new(source.0, source.1);
        let placed = self.placement.apply(positions);
        let lies = Lies::new(&placed, &source);
        if let Some(where_it_is) = lies.implausible() {
            return Err(self.not_on_it(&where_it_is));
        }
        let cloth = Cloth { positions: &placed, faces, category };
        let (carried, base, how, alignment_mm, scale) = match &self.carrier {
            Carrier::Same(same) => {
                let how = if same.is_posed() { Carried::PoseAndShape } else { Carried::Shape };
                (
                    same.carry(&cloth, body).map_err(FitError::Mesh)?,
                    placed.clone(),
                    how,
                    same.residual_mm,
                    1.0,
                )
            }
            Carrier::Other(other) => {
                let (carried, alignment) = other.carry(&cloth, &source, body).map_err(FitError::Mesh)?;
                (carried, placed.clone(), Carried::Bones, Some(alignment), 1.0)
            }
            Carrier::Registered(registered) => {
                let carried = registered.carry(&cloth, &source, body).map_err(FitError::Mesh)?;
                let (alignment, scale) = (registered.alignment_mm, registered.motion.scale);
                (carried.positions, carried.unrestored, Carried::Registration, Some(alignment), scale)
            }
        };
        let mut moves: Vec<f64> = carried.iter().zip(&base).map(|(a, b)| norm(sub(*a, *b))).collect();
        let moved_mm = 1e3 * median(&mut moves);
        let (body, shape) = (self.name.clone(), self.shape.clone());
        let pelvis = (how != Carried::Registration).then(|| self.placement.translation.map(|x| 0.0 - x));
        Ok((carried, SourcePlacement { body, shape, carried: how, alignment_mm, pelvis, scale, moved_mm }))
    }
}

/// How a garment lies on its source body.
struct Lies {
    /// Share of the vertices deeper inside than [`DEEP`].
    deep: f64,
    /// Share of the vertices closer to the skin than [`CLOSE`].
    close: f64,
}

/// Cloth this far inside the body (m) is no tight fit any more.
const DEEP: f64 = 0.025;
/// Cloth this close to the skin (m) rests on it.
const CLOSE: f64 = 0.05;

/// A garment of which a larger share is deep inside was made on another body, or is in other coordinates.
const MOST_DEEP: f64 = 0.1;
/// So was one of which a smaller share is close to the skin.
const LEAST_CLOSE: f64 = 0.1;

impl Lies {
    fn new(positions: &[[f64; 3]], source: &Surface<f64>) -> Self {
        let gaps = gaps_to(positions, source);
        let share = |is: &dyn Fn(&f64) -> bool| {
            gaps.iter().filter(|g| is(g)).count() as f64 / gaps.len().max(1) as f64
        };
        Self { deep: share(&|g| *g < -DEEP), close: share(&|g| g.abs() < CLOSE) }
    }

    fn implausible(&self) -> Option<String> {
        if self.deep > MOST_DEEP {
            let (share, depth) = (100.0 * self.deep, 1e3 * DEEP);
            return Some(format!("{share:.0} % of the garment is more than {depth:.0} mm inside it"));
        }
        let (share, reach) = (100.0 * self.close, 1e3 * CLOSE);
        (self.close < LEAST_CLOSE)
            .then(|| format!("only {share:.0} % of the garment is within {reach:.0} mm of its skin"))
    }
}

/// Signed distance of every point to the surface (m), positive outside.
fn gaps_to(positions: &[[f64; 3]], surface: &Surface<f64>) -> Vec<f64> {
    // Built before it is shared.
    surface.closest_point();
    positions.par_iter().with_min_len(64).map(|p| surface.gap(*p, Distance::ClosestPoint).gap).collect()
}

/// The middle one of some numbers; 0 of none.
fn median(numbers: &mut [f64]) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// `body` with these vertices, joints and one shape component, whose bindings cost no more than that. Without a
/// direction it has none.
fn one_shape_body(
    body: &Body,
    template: Vec<[f64; 3]>,
    joints: Vec<[f64; 3]>,
    direction: Option<Vec<f32>>,
) -> Result<Body, String> {
    let (shape_count, shape_directions) = direction.map_or((0, Vec::new()), |d| (1, d));
    Body::new(BodyParts {
        name: body.name.clone(),
        faces: body.faces.clone(),
        template,
        shape_directions,
        shape_count,
        joint_shape_directions: vec![0.0; 3 * shape_count * joints.len()],
        joint_template: joints,
        pose_directions: None,
        skin_weights: body.skin_weights.clone(),
        parents: body.parents.clone(),
        joint_names: body.joint_names.clone(),
    })
    .map_err(|e| e.to_string())
}

/// Binds cloth at `positions` to `on`; `target` guesses the category where none is known.
fn bound(cloth: &Cloth, positions: Vec<[f64; 3]>, on: &Body, target: &Body) -> Result<Binding, String> {
    let mesh = TriMesh::new(positions, cloth.faces.to_vec()).map_err(|e| e.to_string())?;
    let category = cloth.category.unwrap_or_else(|| Category::guess(&mesh, target));
    Ok(Binding::new(&Garment::new(category, mesh), on, &BindingSettings::default()))
}
