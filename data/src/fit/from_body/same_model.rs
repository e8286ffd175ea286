//! Between bodies of the same vertices: the inverse of what draping does, pose first, then shape.

use super::binding::{SourceCloth, one_shape_body};
use super::source::SourceMesh;
use crate::asset::body::unskin;
use crate::asset::rotation;
use crate::asset::{Body, KnownShape, recover_body};
use crate::fit::limb_pose::LimbPose;
use crate::fit::placement::{FileOrigin, Placement, Unit};
use crate::fit::settings::FitSettings;
use clothcombo_physics::vec3::{norm, scale, sub};

/// Rounds of binding, which depends on where the garment ends up: for a pose alone, and for a pose and a shape.
pub(in crate::fit) const POSE_BINDINGS: usize = 3;
pub(in crate::fit) const SHAPE_BINDINGS: usize = 4;

/// A body of the target's vertices in some shape and pose.
pub(in crate::fit) struct SameModel {
    /// Vertices in T-pose (m), pelvis at the origin.
    shaped: Vec<[f64; 3]>,
    posed: Option<SkinnedShape>,
}

/// Where `bones` carry the shaped vertices (m).
struct SkinnedShape {
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
        Self { shaped: positions, posed: None }
    }

    /// `body` in a pose of its limbs.
    ///
    /// # Errors
    /// When the shape has more numbers than the body.
    pub fn posed(body: &Body, pose: LimbPose) -> Result<Self, String> {
        let shaped = body.shaped(&pose.shape).map_err(|e| e.to_string())?.positions;
        let LimbPose { positions, bones, .. } = pose;
        Ok(Self { shaped, posed: Some(SkinnedShape { positions, bones }) })
    }

    /// Its vertices (m).
    pub fn positions(&self) -> &[[f64; 3]] {
        self.posed.as_ref().map_or(&self.shaped, |posed| &posed.positions)
    }

    /// Carries cloth on it to the zero body.
    ///
    /// # Errors
    /// When no mesh is left, or the pose cannot be undone.
    pub fn carry(&self, cloth: &SourceCloth, body: &Body, rounds: usize) -> Result<Vec<[f64; 3]>, String> {
        let coordinates = self.shaped.as_flattened().iter().zip(body.template.as_flattened());
        let field: Vec<f32> = coordinates.map(|(s, t)| (s - t) as f32).collect();
        if self.posed.is_none() && field.iter().all(|d| d.abs() < 1e-7) {
            return Ok(cloth.positions.to_vec());
        }
        let joints = body.joint_template.clone();
        let at_rest = one_shape_body(body, body.template.clone(), joints.clone(), Some(field.clone()))?;
        let on_source = one_shape_body(body, self.positions().to_vec(), joints, Some(field))?;
        let mut rest = cloth.positions.to_vec();
        for round in 0..rounds {
            let binding = cloth.bound(rest, if round == 0 { &on_source } else { &at_rest }, body)?;
            let mut shaped = cloth.positions.to_vec();
            if let Some(SkinnedShape { bones, .. }) = &self.posed {
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

/// A mesh that is a pose and shape of the target body.
pub(super) struct RecoveredMesh {
    pub placement: Placement,
    pub shape: Vec<f64>,
    pub model: SameModel,
    /// Mean distance of the recovered vertices to the given ones (mm).
    pub residual_mm: f64,
}

/// Recovers pose and shape of a mesh in any unit, with any axis up; none if it is no such mesh.
pub(super) fn recovered(mesh: &SourceMesh, body: &Body, settings: &FitSettings) -> Option<RecoveredMesh> {
    if mesh.vertices.len() != body.vertex_count() {
        return None;
    }
    let placement = axes(&mesh.vertices, body, settings)?;
    let found = recover_body(body, KnownShape::Unknown, &placement.apply(&mesh.vertices)).ok()?;
    let placement = Placement { translation: scale(found.place, -1.0), ..placement };
    let bones = body.posed(&found.shape, &found.pose).ok()?.bones;
    let positions = placement.apply(&mesh.vertices);
    let shaped = (0..positions.len())
        .map(|v| {
            let (joints, weights) = body.skin_weights.row(v);
            let weighted = joints.iter().zip(weights);
            // What shape and pose leave open stays with the vertex.
            unskin(positions[v], weighted.map(|(j, w)| (&bones[usize::from(*j)], f64::from(*w))))
        })
        .collect::<Option<Vec<_>>>()?;
    let model = SameModel { shaped, posed: Some(SkinnedShape { positions, bones }) };
    Some(RecoveredMesh { placement, shape: found.shape, model, residual_mm: 1e3 * found.mean_distance })
}

/// Vertices of the trunk, which no pose turns much.
fn trunk_of(body: &Body) -> Vec<usize> {
    const TRUNK_JOINTS: [&str; 6] = ["pelvis", "spine1", "spine2", "spine3", "left_hip", "right_hip"];
    let is_trunk: Vec<bool> = body.joint_names.iter().map(|n| TRUNK_JOINTS.contains(&n.as_str())).collect();
    let of_trunk = |v: &usize| {
        let (joints, weights) = body.skin_weights.row(*v);
        joints.iter().zip(weights).filter(|(j, _)| is_trunk[usize::from(**j)]).map(|(_, w)| w).sum::<f32>()
            > 0.5
    };
    (0..body.vertex_count()).filter(of_trunk).collect()
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
fn axes(vertices: &[[f64; 3]], body: &Body, settings: &FitSettings) -> Option<Placement> {
    let trunk = trunk_of(body);
    let (points, own_size) = centred(vertices, &trunk);
    let (template, size) = centred(&body.template, &trunk);
    let misfit = |unit: &Unit| (own_size * unit.metres() / size).ln().abs();
    let unit = match settings.unit {
        Some(unit) => unit,
        None => Unit::ALL.into_iter().min_by(|a, b| misfit(a).total_cmp(&misfit(b)))?,
    };
    // People's trunks differ by less than a factor of 1.6.
    if misfit(&unit).is_nan() || misfit(&unit) > 0.5 {
        return None;
    }
    let at = Placement { unit, origin: FileOrigin::SourceBody, ..Placement::AS_GIVEN };
    let turned =
        |up| settings.turns().into_iter().map(move |turn_degrees| Placement { up, turn_degrees, ..at });
    let candidates = settings.ups().into_iter().flat_map(turned);
    let distance = |placement: &Placement| {
        let turn = placement.turn();
        let turned = points.iter().map(|p| scale(rotation::apply(&turn, *p), size / own_size));
        turned.zip(&template).map(|(p, t)| norm(sub(p, *t))).sum::<f64>()
    };
    candidates.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
