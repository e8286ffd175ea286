//! Bodies in SMPL-family npz files.
//!
//! Read: `v_template`, `f`, `shapedirs`, `weights`, `kintree_table`, and either `J_template` with `J_shapedirs` or
//! `J_regressor`; optionally `posedirs` and `joint_names`. Written: the same keys with `J_template` and `J_shapedirs`, plus
//! `source`, `author` and `licence`.

use super::body::{Body, BodyError, BodyParts};
use super::provenance::Provenance;
use super::skeleton::{self, BODY_JOINT_NAMES};
use super::skin_weights::SparseSkinWeights;
use crate::format::npz::{Array, NpzError, NpzFile, NpzWriter};
use clothcombo_physics::mesh::is_inside_out;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a body file cannot be used.
#[derive(Debug, Error)]
pub enum BodyFileError {
    /// The archive or one of its arrays is unusable.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The arrays do not make a body.
    #[error("{}: {reason}", path.display())]
    Body {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: BodyError,
    },
    /// A face names a vertex that is not there.
    #[error("{}: key 'f', face {face} names vertex {vertex}, but there are {vertices} vertices", path.display())]
    Face {
        /// The file.
        path: PathBuf,
        /// The face.
        face: usize,
        /// The vertex it names.
        vertex: f64,
        /// How many there are.
        vertices: usize,
    },
    /// Joints in another order than that of SMPL, by which poses name them.
    #[error(
        "{}: key 'joint_names', joint {found} is '{name}', which must be joint {expected}; poses go by the order of SMPL",
        path.display()
    )]
    JointOrder {
        /// The file.
        path: PathBuf,
        /// The joint.
        name: &'static str,
        /// Its number there.
        found: usize,
        /// Its number in SMPL.
        expected: usize,
    },
    /// A vertex or joint is named by a fraction.
    #[error("{}: key '{key}', {place} is {value}, which is no whole number; vertices and joints are numbered 0, 1, 2 …", path.display())]
    Fraction {
        /// The file.
        path: PathBuf,
        /// The key.
        key: &'static str,
        /// Which of its numbers.
        place: String,
        /// Its value.
        value: f64,
    },
}

/// How to read a body file.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyFileSettings {
    /// Keep at most this many shape components (SMPL-X has 300, of which the first ten or so are in common use).
    pub shape_components: usize,
}

impl Default for BodyFileSettings {
    fn default() -> Self {
        Self { shape_components: 16 }
    }
}

const HINT: &str = "a body is an SMPL, SMPL-H or SMPL-X npz with v_template, f, shapedirs, weights, kintree_table and J_regressor";

/// What is told of a body whose faces look inwards.
pub(crate) const INSIDE_OUT: &str = "the body is inside out; its faces were turned";

/// How many of SMPL-X's `shapedirs` are body shape; the rest are facial expression, which clothes do not see. Files with
/// joint directions are those written here (`ours`), where every component is shape.
pub(crate) fn shape_part(joints: usize, components: usize, ours: bool) -> usize {
    match (joints, components) {
        (55, 400) if !ours => 300,
        (55, 20) if !ours => 10,
        _ => components,
    }
}

impl Body {
    /// Reads a body from an SMPL-family npz. The body is moved so that its pelvis stands at the origin (see [`Body`]). Where it is
    /// closed and inside out, its faces are turned, and a warning says so.
    ///
    /// # Errors
    /// [`BodyFileError`] naming file and key.
    pub fn load(path: &Path, settings: &BodyFileSettings) -> Result<Self, BodyFileError> {
        let (body, was_inside_out) = Self::load_turned(path, settings)?;
        if was_inside_out {
            tracing::warn!("{}: {INSIDE_OUT}", path.display());
        }
        Ok(body)
    }

    /// As [`Self::load`], with whether the body was inside out instead of the warning.
    pub(crate) fn load_turned(
        path: &Path,
        settings: &BodyFileSettings,
    ) -> Result<(Self, bool), BodyFileError> {
        let body = Self::load_as_written(path, settings)?;
        let is_inside_out = is_inside_out(&body.zero_body());
        Ok((if is_inside_out { body.turned() } else { body }, is_inside_out))
    }

    fn load_as_written(path: &Path, settings: &BodyFileSettings) -> Result<Self, BodyFileError> {
        let mut file = NpzFile::open(path)?;
        let template = points(path, "v_template", file.numbers("v_template", HINT)?)?;
        let vertices = template.len();
        let faces = faces(path, file.numbers("f", HINT)?, vertices)?;
        let parents = parents(path, file.numbers("kintree_table", HINT)?)?;
        let joints = parents.len();

        let directions = file.numbers_f32("shapedirs", HINT)?;
        let components = match directions.shape[..] {
            [v, 3, k] if v == vertices => k,
            _ => {
                return Err(shape_error(
                    path,
                    "shapedirs",
                    &directions.shape,
                    &format!("[{vertices}, 3, components]"),
                ));
            }
        };
        let ours = file.contains("J_shapedirs");
        let shape_count = shape_part(joints, components, ours).min(settings.shape_components);
        let shape_directions = first_columns(&directions.data, components, shape_count);

        let weights = file.numbers_f32("weights", HINT)?;
        if weights.shape != [vertices, joints] {
            return Err(shape_error(path, "weights", &weights.shape, &format!("[{vertices}, {joints}]")));
        }
        let (joint_template, joint_shape_directions) = if file.contains("J_template") {
            let joint_template = points(path, "J_template", file.numbers("J_template", HINT)?)?;
            if joint_template.len() != joints {
                let found = [joint_template.len(), 3];
                return Err(shape_error(path, "J_template", &found, &format!("[{joints}, 3]")));
            }
            let d = file.numbers("J_shapedirs", "J_template goes with J_shapedirs")?;
            if d.shape != [joints, 3, components] {
                return Err(shape_error(
                    path,
                    "J_shapedirs",
                    &d.shape,
                    &format!("[{joints}, 3, {components}]"),
                ));
            }
            (joint_template, first_columns(&d.data, components, shape_count))
        } else {
            let r = file.numbers("J_regressor", HINT)?;
            if r.shape != [joints, vertices] {
                return Err(shape_error(path, "J_regressor", &r.shape, &format!("[{joints}, {vertices}]")));
            }
            regress_joints(&r.data, &template, &shape_directions, shape_count)
        };
        let pose_directions = if file.contains("posedirs") {
            let p = file.numbers_f32("posedirs", HINT)?;
            let expected = [vertices, 3, 9 * (joints - 1)];
            if p.shape != expected {
                return Err(shape_error(path, "posedirs", &p.shape, &format!("{expected:?}")));
            }
            p.data.iter().any(|x| *x != 0.0).then_some(p.data)
        } else {
            None
        };
        let joint_names = match file.contains("joint_names").then(|| file.strings("joint_names", HINT)) {
            Some(Ok(names)) if names.data.len() == joints => names.data,
            _ => skeleton::joint_names(joints),
        };
        for (expected, name) in BODY_JOINT_NAMES.into_iter().enumerate() {
            let found = joint_names.iter().position(|n| n == name).unwrap_or(expected);
            if found != expected {
                return Err(BodyFileError::JointOrder { path: path.into(), name, found, expected });
            }
        }
        let name = path.file_stem().map_or_else(|| "body".into(), |s| s.to_string_lossy().into_owned());
        Body::new(BodyParts {
            name,
            faces: faces.into(),
            template,
            shape_directions,
            shape_count,
            joint_template,
            joint_shape_directions,
            pose_directions,
            skin_weights: SparseSkinWeights::from_dense(&weights.data, joints),
            parents,
            joint_names,
        })
        .map_err(|reason| BodyFileError::Body { path: path.into(), reason })
    }

    /// Writes the body as npz (keys as [`Body::load`] reads them, `f32` throughout but for the joints).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path, source: &Provenance) -> Result<(), BodyFileError> {
        let (v, j, k) = (self.vertex_count(), self.joint_count(), self.shape_count);
        let parents = self.parents.iter().map(|p| p.map_or(-1, |p| p as i64)).chain(0..j as i64);
        let template: Vec<f32> = self.template.as_flattened().iter().map(|x| *x as f32).collect();
        let mut npz = NpzWriter::new();
        npz.f32("v_template", &[v, 3], &template)
            .u32("f", &[self.faces.len(), 3], self.faces.as_flattened())
            .f32("shapedirs", &[v, 3, k], &self.shape_directions)
            .f32("weights", &[v, j], &self.skin_weights.to_dense(j))
            .i64("kintree_table", &[2, j], &parents.collect::<Vec<_>>())
            .f64("J_template", &[j, 3], self.joint_template.as_flattened())
            .f64("J_shapedirs", &[j, 3, k], &self.joint_shape_directions)
            .strings("joint_names", &[j], &self.joint_names)
            .strings("source", &[], &[&source.source])
            .strings("author", &[], &[&source.author])
            .strings("licence", &[], &[&source.licence]);
        if let Some(p) = &self.pose_directions {
            npz.f32("posedirs", &[v, 3, 9 * (j - 1)], p);
        }
        Ok(npz.save(path)?)
    }
}

fn shape_error(path: &Path, key: &str, found: &[usize], expected: &str) -> BodyFileError {
    NpzError::Shape { path: path.into(), key: key.into(), found: found.into(), expected: expected.into() }
        .into()
}

fn points(path: &Path, key: &str, array: Array<f64>) -> Result<Vec<[f64; 3]>, BodyFileError> {
    match array.shape[..] {
        [n, 3] if n > 0 => Ok(array.data.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()),
        _ => Err(shape_error(path, key, &array.shape, "[n, 3], n >= 1")),
    }
}

fn faces(path: &Path, array: Array<f64>, vertices: usize) -> Result<Vec<[u32; 3]>, BodyFileError> {
    if !matches!(array.shape[..], [_, 3]) {
        return Err(shape_error(path, "f", &array.shape, "[faces, 3]"));
    }
    let is_vertex = |i: f64| i >= 0.0 && i < vertices as f64 && i.fract() == 0.0;
    if let Some(at) = array.data.iter().position(|i| !is_vertex(*i)) {
        let (face, vertex) = (at / 3, array.data[at]);
        if vertex.fract() != 0.0 {
            let place = format!("corner {} of face {face}", at % 3);
            return Err(BodyFileError::Fraction { path: path.into(), key: "f", place, value: vertex });
        }
        return Err(BodyFileError::Face { path: path.into(), face, vertex, vertices });
    }
    Ok(array.data.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect())
}

/// The parent of each joint, from the first row of the table. The root's is −1, or 2³² − 1 where the table is unsigned; anything
/// that is no joint is "none".
fn parents(path: &Path, tree: Array<f64>) -> Result<Vec<Option<usize>>, BodyFileError> {
    let joints = match tree.shape[..] {
        [2, joints] if joints > 0 => joints,
        _ => return Err(shape_error(path, "kintree_table", &tree.shape, "[2, joints]")),
    };
    let parents = &tree.data[..joints];
    if let Some(joint) = parents.iter().position(|p| p.fract() != 0.0) {
        let (key, place) = ("kintree_table", format!("the parent of joint {joint}"));
        return Err(BodyFileError::Fraction { path: path.into(), key, place, value: parents[joint] });
    }
    let is_joint = |p: f64| p >= 0.0 && p < joints as f64;
    Ok((parents.iter().enumerate())
        .map(|(joint, p)| (joint > 0 && is_joint(*p)).then_some(*p as usize))
        .collect())
}

fn first_columns<T: Copy>(data: &[T], columns: usize, keep: usize) -> Vec<T> {
    if columns == 0 {
        return Vec::new();
    }
    data.chunks_exact(columns).flat_map(|row| row[..keep].iter().copied()).collect()
}

/// Joints are linear in the vertices, hence in the shape: `J_reg · (T + S·β)`.
fn regress_joints(
    regressor: &[f64],
    template: &[[f64; 3]],
    shape_directions: &[f32],
    shape_count: usize,
) -> (Vec<[f64; 3]>, Vec<f64>) {
    let mut joint_template = Vec::new();
    let mut joint_directions = Vec::new();
    let width = 3 * shape_count;
    for row in regressor.chunks_exact(template.len()) {
        let mut joint = [0.0; 3];
        let mut directions = vec![0.0; width];
        for (v, w) in row.iter().enumerate().filter(|(_, w)| **w != 0.0) {
            for a in 0..3 {
                joint[a] += w * template[v][a];
            }
            for (d, s) in directions.iter_mut().zip(&shape_directions[v * width..]) {
                *d += w * f64::from(*s);
            }
        }
        joint_template.push(joint);
        joint_directions.extend(directions);
    }
    (joint_template, joint_directions)
}

#[cfg(test)]
mod tests;
