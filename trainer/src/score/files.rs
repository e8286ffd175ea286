//! Meshes to be scored, from files of any mesh format or from memory.

use super::place::{misplaced, oversized, rescaled};
use super::{DrapedGarment, MeshSize, Score, ScoreDistance, ScoreError, score};
use clothcombo_data::format::{load_body_mesh, load_tri_mesh};
use clothcombo_physics::mesh::{Topology, TriMesh, is_inside_out};
use clothcombo_physics::vec3::{norm, sub};
use std::path::{Path, PathBuf};

/// A mesh, and what messages call it: its file, or a name.
#[derive(Clone, Debug)]
pub struct NamedMesh {
    /// Its file or name.
    pub path: PathBuf,
    /// The mesh.
    pub mesh: TriMesh,
}

impl NamedMesh {
    /// Reads a mesh file; polygons are cut into triangles.
    ///
    /// # Errors
    /// Naming file and line.
    pub fn load(path: &Path) -> Result<Self, ScoreError> {
        Ok(Self { path: path.into(), mesh: load_tri_mesh(path)? })
    }

    /// Reads a body's mesh file; of a scene of several meshes the one named "body".
    ///
    /// # Errors
    /// Naming file and line.
    pub fn load_body(path: &Path) -> Result<Self, ScoreError> {
        Ok(Self { path: path.into(), mesh: load_body_mesh(path)? })
    }

    fn size(&self) -> MeshSize {
        MeshSize {
            path: self.path.clone(),
            vertices: self.mesh.vertex_count(),
            triangles: self.mesh.face_count(),
        }
    }
}

/// The meshes of a scene.
#[derive(Clone, Debug)]
pub struct SceneMeshes {
    /// The posed body.
    pub body: NamedMesh,
    /// Rest meshes, innermost first.
    pub rest: Vec<NamedMesh>,
    /// Draped meshes of the same vertices and faces, in the same order.
    pub draped: Vec<NamedMesh>,
    /// The same before skinning, for the holding energy; none leaves it out.
    pub canonical: Vec<NamedMesh>,
}

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
    check_counts(rest.len(), draped.len(), canonical.len())?;
    let load = |paths: &[PathBuf]| -> Result<Vec<_>, ScoreError> {
        paths.iter().map(|path| NamedMesh::load(path)).collect()
    };
    let body = NamedMesh::load_body(body)?;
    score_meshes(
        SceneMeshes { body, rest: load(rest)?, draped: load(draped)?, canonical: load(canonical)? },
        distance,
    )
}

/// The same for meshes in memory; a garment is named after its draped mesh.
///
/// # Errors
/// [`ScoreError`] naming the two meshes that do not fit together.
pub fn score_meshes(meshes: SceneMeshes, distance: ScoreDistance) -> Result<Score, ScoreError> {
    let SceneMeshes { body, rest, draped, canonical } = meshes;
    check_counts(rest.len(), draped.len(), canonical.len())?;
    let body = checked_body(body)?;
    let pairs = rest.iter().zip(&draped);
    let names = pairs.map(|(rest, draped)| checked_garment(rest, draped, &body));
    let names = names.collect::<Result<Vec<String>, _>>()?;
    for (rest, before) in rest.iter().zip(&canonical) {
        check_faces(rest, before)?;
        check_unit(rest, before)?;
    }
    let garments: Vec<DrapedGarment> = names
        .iter()
        .enumerate()
        .map(|(i, name)| DrapedGarment {
            name,
            rest: &rest[i].mesh,
            positions: draped[i].mesh.positions(),
            canonical: canonical.get(i).map(|before| before.mesh.positions()),
        })
        .collect();
    score(&body, &garments, distance)
}

fn check_counts(rest: usize, draped: usize, canonical: usize) -> Result<(), ScoreError> {
    let wrong = |what, found| Err(ScoreError::FileCounts { rest, what, found });
    match (rest == draped, canonical == 0 || canonical == rest) {
        (false, _) => wrong("draped", draped),
        (_, false) => wrong("canonical", canonical),
        _ => Ok(()),
    }
}

/// A posed body in metres. One that is inside out, its faces towards its inside, is turned, and said so.
///
/// # Errors
/// When it is not in metres.
pub fn checked_body(body: NamedMesh) -> Result<TriMesh, ScoreError> {
    let NamedMesh { path, mesh } = body;
    warn_about_openings(&path, &mesh);
    if let Some(what) = oversized(&mesh) {
        return Err(ScoreError::BodySize { path, what });
    }
    if !is_inside_out(&mesh) {
        return Ok(mesh);
    }
    tracing::warn!("{}: the body is inside out; its faces were turned", path.display());
    Ok(mesh.turned())
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

/// The name of a garment whose rest mesh and draped mesh have the same faces, and are in the unit and place of `body`.
///
/// # Errors
/// When they are not.
pub fn checked_garment(rest: &NamedMesh, draped: &NamedMesh, body: &TriMesh) -> Result<String, ScoreError> {
    check_faces(rest, draped)?;
    if let Some(what) = misplaced(&draped.mesh, body) {
        return Err(ScoreError::Place { path: draped.path.clone(), what });
    }
    check_unit(rest, draped)?;
    let path = &draped.path;
    Ok(path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned())
}

fn check_unit(rest: &NamedMesh, draped: &NamedMesh) -> Result<(), ScoreError> {
    match rescaled(&rest.mesh, &draped.mesh) {
        Some(what) => {
            Err(ScoreError::RestUnit { rest: rest.path.clone(), draped: draped.path.clone(), what })
        }
        None => Ok(()),
    }
}

fn check_faces(rest: &NamedMesh, draped: &NamedMesh) -> Result<(), ScoreError> {
    let (a, b) = (&rest.mesh, &draped.mesh);
    if (a.vertex_count(), a.face_count()) != (b.vertex_count(), b.face_count()) {
        return Err(ScoreError::Size { rest: rest.size(), draped: draped.size() });
    }
    match (0..a.face_count()).find(|&f| a.faces()[f] != b.faces()[f]) {
        Some(face) => Err(ScoreError::Faces {
            face,
            rest: rest.size(),
            rest_face: a.faces()[face],
            draped: draped.size(),
            draped_face: b.faces()[face],
        }),
        None => Ok(()),
    }
}
