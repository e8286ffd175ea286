//! Between bodies of the same vertices: the inverse of what draping does, pose first, then shape.

use super::source::SourceMesh;
use super::{Cloth, bound, one_shape_body};
use crate::asset::body::unskin;
use crate::asset::rotation;
use crate::asset::{Body, KnownShape, recover_body};
use crate::fit::placement::{Origin, Placement, Unit, UpAxis};
use crate::fit::settings::FitSettings;
use clothcombo_physics::vec3::{norm, scale, sub};
use std::sync::Arc;

/// Rounds of binding: the binding depends on where the garment ends up.
const ROUNDS: usize = 4;

/// A body of the target's vertices.
pub(super) struct SameModel {
    /// Vertices in T-pose (m), pelvis at the origin.
    shaped: Vec<[f64; 3]>,
    posed: Option<Posed>,
    /// Mean distance of the recovered vertices to the given ones (mm), if they were.
    pub residual_mm: Option<f64>,
}

struct Posed {
    positions: Vec<[f64; 3]>,
    bones: Vec<[[f64; 4]; 3]>,
}

/// Whether `faces` join the vertices as those of `body` do.
pub(super) fn has_topology(body: &Body, faces: &[[u32; 3]]) -> bool {
    let sorted = |f: &[u32; 3]| {
        let mut f = *f;
        f.sort_unstable();
        f
    };
    body.faces.len() == faces.len() && body.faces.iter().zip(faces).all(|(a, b)| sorted(a) == sorted(b))
}

impl SameModel {
    /// A body in T-pose.
    pub fn shaped(positions: Vec<[f64; 3]>) -> Self {
        Self { shaped: positions, posed: None, residual_mm: None }
    }

    /// A shaped body `[V, 3]` in T-pose that `bones` carry to `positions` (m).
    pub fn posed(shaped: Vec<[f64; 3]>, positions: Vec<[f64; 3]>, bones: Vec<[[f64; 4]; 3]>) -> Self {
        Self { shaped, posed: Some(Posed { positions, bones }), residual_mm: None }
    }

    pub fn is_posed(&self) -> bool {
        self.posed.is_some()
    }

    /// The surface on which the garment was made (m).
    pub fn surface(&self, body: &Body) -> (Vec<[f64; 3]>, Arc<[[u32; 3]]>) {
        let positions = self.posed.as_ref().map_or(&self.shaped, |posed| &posed.positions);
        (positions.clone(), body.faces.clone())
    }

    /// Carries cloth on it to the zero body.
    ///
    /// # Errors
    /// When no mesh is left, or the pose cannot be undone.
    pub fn carry(&self, cloth: &Cloth, body: &Body) -> Result<Vec<[f64; 3]>, String> {
        let field: Vec<f32> = self
            .shaped
            .as_flattened()
            .iter()
            .zip(body.template.as_flattened())
            .map(|(s, t)| (s - t) as f32)
            .collect();
        if self.posed.is_none() && field.iter().all(|d| d.abs() < 1e-7) {
            return Ok(cloth.positions.to_vec());
        }
        let joints = body.joint_template.clone();
        let start = self.posed.as_ref().map_or(&self.shaped, |posed| &posed.positions).clone();
        let at_rest = one_shape_body(body, body.template.clone(), joints.clone(), Some(field.clone()))?;
        let on_source = one_shape_body(body, start, joints, Some(field))?;
        let mut rest = cloth.positions.to_vec();
        for round in 0..ROUNDS {
            let binding = bound(cloth, rest, if round == 0 { &on_source } else { &at_rest }, body)?;
            let mut shaped = cloth.positions.to_vec();
            if let Some(Posed { bones, .. }) = &self.posed {
                let rows = binding.skin_weights.chunks_exact(bones.len());
                for (p, row) in shaped.iter_mut().zip(rows) {
                    let weighted = bones.iter().zip(row).map(|(bone, w)| (bone, f64::from(*w)));
                    *p = unskin(*p, weighted)
                        .ok_or("the pose of the source body cannot be undone: a blended bone transform has no inverse")?;
                }
            }
            let moved = binding.shape_displacement(&[1.0], 1);
            rest = shaped.iter().zip(&moved).map(|(p, d)| sub(*p, *d)).collect();
        }
        Ok(rest)
    }
}

/// A mesh that is a pose and shape of the target body, in any unit, with any axis up; none if it is no such mesh.
pub(super) fn recovered(
    mesh: &SourceMesh,
    body: &Body,
    settings: &FitSettings,
) -> Option<(Placement, Vec<f64>, SameModel)> {
    if mesh.vertices.len() != body.vertex_count() {
        return None;
    }
    let (size, trunk) = trunk_of(body);
    let placement = axes(&mesh.vertices, body, &trunk, size, settings)?;
    let positions = placement.apply(&mesh.vertices);
    let found = recover_body(body, KnownShape::Unknown, &positions).ok()?;
    let placement = Placement { translation: scale(found.place, -1.0), ..placement };
    let posed = body.posed(&found.shape, &found.pose).ok()?;
    let positions = placement.apply(&mesh.vertices);
    let shaped = (0..positions.len())
        .map(|v| {
            let (joints, weights) = body.skin_weights.row(v);
            let weighted = joints.iter().zip(weights);
            // What shape and pose leave open stays with the vertex.
            unskin(positions[v], weighted.map(|(j, w)| (&posed.bones[usize::from(*j)], f64::from(*w))))
        })
        .collect::<Option<Vec<_>>>()?;
    let residual_mm = Some(1e3 * found.mean_distance);
    let posed = Some(Posed { positions, bones: posed.bones });
    Some((placement, found.shape, SameModel { shaped, posed, residual_mm }))
}

/// Vertices of the trunk, which no pose turns much, and their mean distance from their centre (m).
fn trunk_of(body: &Body) -> (f64, Vec<usize>) {
    const TRUNK: [&str; 6] = ["pelvis", "spine1", "spine2", "spine3", "left_hip", "right_hip"];
    let is_trunk: Vec<bool> = body.joint_names.iter().map(|n| TRUNK.contains(&n.as_str())).collect();
    let of_trunk = |v: &usize| {
        let (joints, weights) = body.skin_weights.row(*v);
        joints.iter().zip(weights).filter(|(j, _)| is_trunk[usize::from(**j)]).map(|(_, w)| w).sum::<f32>()
            > 0.5
    };
    let trunk: Vec<usize> = (0..body.vertex_count()).filter(of_trunk).collect();
    (centred(&body.template, &trunk).1, trunk)
}

/// The points about their centre, and their mean distance from it.
fn centred(positions: &[[f64; 3]], which: &[usize]) -> (Vec<[f64; 3]>, f64) {
    let count = which.len().max(1) as f64;
    let centre: [f64; 3] =
        std::array::from_fn(|a| which.iter().map(|v| positions[*v][a]).sum::<f64>() / count);
    let points: Vec<[f64; 3]> = which.iter().map(|v| sub(positions[*v], centre)).collect();
    let size = points.iter().map(|p| norm(*p)).sum::<f64>() / count;
    (points, size)
}

/// Unit, up axis and quarter turn under which the trunk looks most like that of the zero body.
fn axes(
    vertices: &[[f64; 3]],
    body: &Body,
    trunk: &[usize],
    size: f64,
    settings: &FitSettings,
) -> Option<Placement> {
    let (points, own_size) = centred(vertices, trunk);
    let (template, _) = centred(&body.template, trunk);
    let misfit = |unit: &Unit| (own_size * unit.metres() / size).ln().abs();
    let unit = match settings.unit {
        Some(unit) => unit,
        None => Unit::ALL.into_iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b)))?,
    };
    if misfit(&unit).is_nan() || misfit(&unit) > 0.5 {
        return None;
    }
    let ups = settings.up.map_or(UpAxis::USUAL.to_vec(), |up| vec![up]);
    let turns = settings.turn_degrees.map_or(vec![0.0, 90.0, 180.0, 270.0], |turn| vec![turn]);
    let candidates = ups.iter().flat_map(|up| {
        turns.iter().map(|turn| Placement {
            unit,
            up: *up,
            turn_degrees: *turn,
            origin: Origin::SourceBody,
            ..Placement::AS_GIVEN
        })
    });
    let distance = |placement: &Placement| {
        let turn = placement.turn();
        let turned = points.iter().map(|p| scale(rotation::apply(&turn, *p), size / own_size));
        turned.zip(&template).map(|(p, t)| norm(sub(p, *t))).sum::<f64>()
    };
    candidates.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
