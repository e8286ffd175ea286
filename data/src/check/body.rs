//! A body file.

use super::checked::CheckedFile;
use crate::asset::body_file::INSIDE_OUT;
use crate::asset::{BODY_JOINT_COUNT, Body, BodyFileSettings};
use crate::format::NpzFile;
use clothcombo_physics::Topology;
use serde::Serialize;
use std::path::Path;

/// Measurements of a body file.
#[derive(Clone, Debug, Serialize)]
pub struct BodyCheck {
    /// Vertices.
    pub vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Joints.
    pub joints: usize,
    /// Shape components.
    pub shape_components: usize,
    /// Whether it has pose-corrective blend shapes.
    pub pose_correctives: bool,
    /// Height of the zero body (m).
    pub height: f64,
    /// Smallest and largest sum of the skin weights of a vertex, as written in the file.
    pub weight_sums: [f64; 2],
    /// Connected components of the surface.
    pub components: usize,
    /// Boundary curves of the surface; a whole body has none.
    pub boundary_loops: usize,
    /// Edges with three or more triangles.
    pub non_manifold_edges: usize,
    /// Whether the faces of its closed surface look inwards; they are turned when it is read.
    pub inside_out: bool,
}

/// Measurements and warnings, or why the body cannot be read.
pub(super) fn check(path: &Path, npz: &mut NpzFile) -> Result<CheckedFile<BodyCheck>, String> {
    let settings = BodyFileSettings { shape_components: usize::MAX };
    let file = NpzFile::open(path).map_err(|e| e.to_string())?;
    let (body, was_inside_out) = Body::read_turned(file, &settings).map_err(|e| e.to_string())?;
    // The loader normalises each row: the sums are those of the file.
    let weights = npz.numbers_f32("weights", "").map_err(|e| e.to_string())?.data;
    let sums = weights
        .chunks_exact(body.joint_count().max(1))
        .map(|row| row.iter().map(|w| f64::from(*w)).sum::<f64>());
    let weight_sums = sums.fold([f64::MAX, f64::MIN], |[low, high], s| [low.min(s), high.max(s)]);
    let mesh = body.zero_body();
    let topology = Topology::new(&mesh);
    let (low, high) = mesh.bounds();
    let check = BodyCheck {
        vertices: body.vertex_count(),
        triangles: body.faces.len(),
        joints: body.joint_count(),
        shape_components: body.shape_count,
        pose_correctives: body.pose_directions.is_some(),
        height: high[1] - low[1],
        weight_sums,
        components: topology.component_count - topology.unreferenced.len(),
        boundary_loops: topology.boundary_loops.len(),
        non_manifold_edges: topology.non_manifold_edges.len(),
        inside_out: was_inside_out,
    };
    let lacks_joints = || {
        (check.joints < BODY_JOINT_COUNT).then(|| {
            format!("{} joints; poses turn the {BODY_JOINT_COUNT} body joints of SMPL", check.joints)
        })
    };
    let unusable = body.implausibility().or_else(lacks_joints);
    let unusable = unusable.map(|reason| format!("{}: {reason}", path.display()));
    Ok(CheckedFile { warnings: warnings(&check), unusable, measured: check })
}

fn warnings(check: &BodyCheck) -> Vec<String> {
    let mut warnings = Vec::new();
    let [low, high] = check.weight_sums;
    if [low, high].iter().any(|s| (s - 1.0).abs() > 1e-3) {
        warnings.push(format!("skin weights sum to {low:.4}–{high:.4} instead of 1; they are normalised"));
    }
    if check.inside_out {
        warnings.push(INSIDE_OUT.into());
    }
    if check.boundary_loops > 0 {
        warnings.push(format!("{} holes in the surface", check.boundary_loops));
    }
    if check.non_manifold_edges > 0 {
        warnings.push(format!("{} non-manifold edges", check.non_manifold_edges));
    }
    warnings
}
