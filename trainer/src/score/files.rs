//! Meshes to be scored, from files of any mesh format.

use super::place::{misplaced, oversized, rescaled};
use super::{DrapedGarment, MeshSize, Score, ScoreDistance, ScoreError, score};
use clothcombo_data::format::{load_body_mesh, load_tri_mesh};
use clothcombo_physics::mesh::{Topology, TriMesh, is_inside_out};
use clothcombo_physics::vec3::{norm, sub};
use std::path::{Path, PathBuf};

/// The files of a scene; polygons are cut into triangles.
#[derive(Clone, Copy, Debug)]
pub struct MeshFiles<'a> {
    /// The posed body.
    pub body: &'a Path,
    /// Rest meshes, innermost first.
    pub rest: &'a [PathBuf],
    /// Draped meshes of the same vertices and faces, in the same order.
    pub draped: &'a [PathBuf],
    /// The same before skinning, for the holding energy; none leaves it out.
    pub canonical: &'a [PathBuf],
}

/// Scores the meshes of `files`; a garment is named after its draped file.
///
/// # Errors
/// [`ScoreError`] naming file and line, or the two files that do not fit together.
pub fn score_files(files: &MeshFiles, distance: ScoreDistance) -> Result<Score, ScoreError> {
    let MeshFiles { body, rest, draped, canonical } = *files;
    if rest.len() != draped.len() {
        return Err(ScoreError::FileCounts { rest: rest.len(), what: "draped", found: draped.len() });
    }
    if !(canonical.is_empty() || rest.len() == canonical.len()) {
        return Err(ScoreError::FileCounts { rest: rest.len(), what: "canonical", found: canonical.len() });
    }
    let body = load_body(body)?;
    let loaded = rest.iter().zip(draped).map(|(rest, draped)| load_garment(rest, draped, &body));
    let loaded = loaded.collect::<Result<Vec<_>, _>>()?;
    let before = rest.iter().zip(canonical).map(|(rest, canonical)| load_pair(rest, canonical));
    let before = before.zip(rest.iter().zip(canonical)).map(|(pair, (rest_path, path))| {
        let (rest, before) = pair?;
        match rescaled(&rest, &before) {
            Some(what) => Err(ScoreError::RestUnit { rest: rest_path.into(), draped: path.into(), what }),
            None => Ok(before),
        }
    });
    let before = before.collect::<Result<Vec<TriMesh>, ScoreError>>()?;
    let garments: Vec<DrapedGarment> = loaded
        .iter()
        .enumerate()
        .map(|(i, (name, rest, draped))| DrapedGarment {
            name,
            rest,
            positions: draped.positions(),
            canonical: before.get(i).map(TriMesh::positions),
        })
        .collect();
    score(&body, &garments, distance)
}

/// A posed body in metres. One that is inside out, its faces towards its inside, is turned, and said so.
pub(crate) fn load_body(path: &Path) -> Result<TriMesh, ScoreError> {
    let body = load_body_mesh(path)?;
    warn_about_openings(path, &body);
    if let Some(what) = oversized(&body) {
        return Err(ScoreError::BodySize { path: path.into(), what });
    }
    if !is_inside_out(&body) {
        return Ok(body);
    }
    tracing::warn!("{}: the body is inside out; its faces were turned", path.display());
    Ok(body.turned())
}

/// A longer border (m) is no hole for an eye: half a body, or a garment, has no inside.
const WIDE_OPENING: f64 = 0.2;

fn warn_about_openings(path: &Path, body: &TriMesh) {
    let at = |v: &u32| body.positions()[*v as usize];
    let length = |border: &Vec<u32>| -> f64 {
        let next = border.iter().cycle().skip(1);
        border.iter().zip(next).map(|(a, b)| norm(sub(at(b), at(a)))).sum()
    };
    let longest = Topology::new(body).boundary_loops.iter().map(length).fold(0.0, f64::max);
    if longest > WIDE_OPENING {
        tracing::warn!(
            "{}: the body is open along a border of {longest:.2} m: is it a whole body? What is inside there cannot be told",
            path.display()
        );
    }
}

/// Name, rest mesh and draped mesh of a garment, which have the same faces; in the unit and place of `body`.
pub(crate) fn load_garment(
    rest_path: &Path,
    draped_path: &Path,
    body: &TriMesh,
) -> Result<(String, TriMesh, TriMesh), ScoreError> {
    let (rest, draped) = load_pair(rest_path, draped_path)?;
    if let Some(what) = misplaced(&draped, body) {
        return Err(ScoreError::Place { path: draped_path.into(), what });
    }
    if let Some(what) = rescaled(&rest, &draped) {
        return Err(ScoreError::RestUnit { rest: rest_path.into(), draped: draped_path.into(), what });
    }
    let name = draped_path.file_stem().unwrap_or(draped_path.as_os_str()).to_string_lossy().into_owned();
    Ok((name, rest, draped))
}

/// A rest mesh and a mesh of the same faces.
fn load_pair(rest_path: &Path, draped_path: &Path) -> Result<(TriMesh, TriMesh), ScoreError> {
    let (rest, draped) = (load_tri_mesh(rest_path)?, load_tri_mesh(draped_path)?);
    let size = |path: &Path, mesh: &TriMesh| MeshSize {
        path: path.to_owned(),
        vertices: mesh.vertex_count(),
        triangles: mesh.face_count(),
    };
    let sizes = || (size(rest_path, &rest), size(draped_path, &draped));
    if (rest.vertex_count(), rest.face_count()) != (draped.vertex_count(), draped.face_count()) {
        let (rest, draped) = sizes();
        return Err(ScoreError::Size { rest, draped });
    }
    if let Some(face) = (0..rest.face_count()).find(|&f| rest.faces()[f] != draped.faces()[f]) {
        let [rest_face, draped_face] = [&rest, &draped].map(|mesh| mesh.faces()[face]);
        let (rest, draped) = sizes();
        return Err(ScoreError::Faces { face, rest, rest_face, draped, draped_face });
    }
    Ok((rest, draped))
}
