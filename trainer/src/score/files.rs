//! Meshes to be scored, from files of any mesh format or from memory.

use super::place::{misplaced, oversized, rescaled};
use super::{DrapedGarment, Score, ScoreDistance, score};
use clothcombo_data::format::{FileError, load_body_mesh, load_tri_mesh};
use clothcombo_physics::mesh::{Topology, TriMesh, is_inside_out};
use clothcombo_physics::vec3::{norm, sub};
use miette::{Report, miette};
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
    pub fn load(path: &Path) -> Result<Self, Report> {
        Ok(Self { path: path.into(), mesh: load_tri_mesh(path).map_err(|e| unreadable(&e))? })
    }

    /// Reads a body's mesh file; of a scene of several meshes the one named "body".
    ///
    /// # Errors
    /// Naming file and line.
    pub fn load_body(path: &Path) -> Result<Self, Report> {
        Ok(Self { path: path.into(), mesh: load_body_mesh(path).map_err(|e| unreadable(&e))? })
    }
}

/// A mesh file is missing or wrong; the message names file and line.
fn unreadable(reason: &FileError) -> Report {
    miette!(
        help = "every mesh is an OBJ, PLY, STL or glTF file of triangles, quads or polygons, in metres",
        "{reason}"
    )
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

/// Scores meshes; a garment is named after its draped mesh.
///
/// # Errors
/// Naming the two meshes that do not fit together.
pub fn score_meshes(meshes: SceneMeshes, distance: ScoreDistance) -> Result<Score, Report> {
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

fn check_counts(rest: usize, draped: usize, canonical: usize) -> Result<(), Report> {
    let wrong = |what: &str, found: usize| {
        Err(miette!(
            help = "give each garment once in every list, from the body outwards",
            "{rest} rest meshes (--rest) but {found} {what} meshes (--{what})"
        ))
    };
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
pub fn checked_body(body: NamedMesh) -> Result<TriMesh, Report> {
    let NamedMesh { path, mesh } = body;
    warn_about_openings(&path, &mesh);
    if let Some(what) = oversized(&mesh) {
        return Err(miette!(
            help = "scale body and garments to metres (0.01 for centimetres)",
            "{}: {what}",
            path.display()
        ));
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
pub fn checked_garment(rest: &NamedMesh, draped: &NamedMesh, body: &TriMesh) -> Result<String, Report> {
    check_faces(rest, draped)?;
    if let Some(what) = misplaced(&draped.mesh, body) {
        return Err(miette!(
            help = "body and garments must be in one unit and one place: as draped",
            "{}: {what}",
            draped.path.display()
        ));
    }
    check_unit(rest, draped)?;
    let path = &draped.path;
    Ok(path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned())
}

fn check_unit(rest: &NamedMesh, draped: &NamedMesh) -> Result<(), Report> {
    match rescaled(&rest.mesh, &draped.mesh) {
        Some(what) => Err(miette!(
            help = "rest and draped meshes must be in one unit: metres",
            "{} beside {}: {what}",
            rest.path.display(),
            draped.path.display()
        )),
        None => Ok(()),
    }
}

fn check_faces(rest: &NamedMesh, draped: &NamedMesh) -> Result<(), Report> {
    let [at_rest, now] = [rest, draped].map(|named| named.path.display());
    let [a, b] = [rest, draped].map(|named| (named.mesh.vertex_count(), named.mesh.face_count()));
    if a != b {
        return Err(miette!(
            help = "a draped mesh must be its rest mesh with moved vertices; check the order of the files, and that the \
                    program that wrote them neither split nor merged vertices",
            "{now} has {} vertices and {} triangles, {at_rest} has {} and {}",
            b.0,
            b.1,
            a.0,
            a.1
        ));
    }
    let mut faces = rest.mesh.faces().iter().zip(draped.mesh.faces()).enumerate();
    match faces.find(|(_, (of_rest, of_draped))| of_rest != of_draped) {
        Some((face, (of_rest, of_draped))) => Err(miette!(
            help = "a draped mesh must have the faces of its rest mesh in the same order; triangles and vertices count from 0 \
                    here, after polygons were cut into triangles",
            "face {face} has the vertices {of_draped:?} in {now} ({} vertices, {} triangles) but {of_rest:?} in {at_rest} \
             (the same counts)",
            b.0,
            b.1
        )),
        None => Ok(()),
    }
}
