//! Bodies in SMPL-family npz files.
//!
//! Read: `v_template`, `f`, `shapedirs`, `weights`, `kintree_table`, and either `J_template` with `J_shapedirs` or
//! `J_regressor`; optionally `posedirs` and `joint_names`. A rigged body without `shapedirs` has one shape. Written:
//! the same keys with `J_template` and `J_shapedirs`, plus `source`, `author` and `licence`, and `pelvis_template` with
//! `pelvis_shapedirs`: where the pelvis was in the file the body came from, if that was not the origin.

use super::body::{Body, BodyParts, FilePelvis, first_columns};
use super::provenance::Provenance;
use super::skeleton::{self, BODY_JOINT_NAMES};
use super::skin_weights::SparseSkinWeights;
use crate::format::{Array, FileError, NpzFile, NpzWriter};
use clothcombo_physics::mesh::is_inside_out;
use std::path::Path;

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

const BODY_HINT: &str = "a body is an SMPL, SMPL-H or SMPL-X npz with v_template, f, shapedirs, weights, kintree_table and J_regressor";

/// Warning about a body whose faces look inwards.
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
    /// Reads a body from an SMPL-family npz. The body is moved so that its pelvis stands at the origin (see [`Body`]).
    /// Where it is closed and inside out, its faces are turned, and a warning says so.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn load(path: &Path, settings: &BodyFileSettings) -> Result<Self, FileError> {
        Self::read(NpzFile::open(path)?, settings)
    }

    /// As [`Self::load`], from an open archive.
    ///
    /// # Errors
    /// [`FileError`] naming file and key.
    pub fn read(file: NpzFile, settings: &BodyFileSettings) -> Result<Self, FileError> {
        let path = file.path().to_owned();
        let (body, was_inside_out) = Self::read_turned(file, settings)?;
        if was_inside_out {
            tracing::warn!("{}: {INSIDE_OUT}", path.display());
        }
        Ok(body)
    }

    /// As [`Self::load`], with whether the body was inside out instead of the warning.
    pub(crate) fn read_turned(file: NpzFile, settings: &BodyFileSettings) -> Result<(Self, bool), FileError> {
        let body = Self::read_as_written(file, settings)?;
        let is_inside_out = is_inside_out(&body.zero_body());
        Ok((if is_inside_out { body.turned() } else { body }, is_inside_out))
    }

    fn read_as_written(mut file: NpzFile, settings: &BodyFileSettings) -> Result<Self, FileError> {
        let path = &file.path().to_owned();
        let wrong = FileError::content(path);
        let template = points(&mut file, "v_template")?;
        let vertices = template.len();
        let faces = faces(&mut file, vertices)?;
        let parents = parents(&mut file)?;
        let joints = parents.len();

        // A body without a shape space has no such array, or an empty one.
        let (components, directions) = match file.contains("shapedirs") {
            false => (0, Vec::new()),
            true => {
                let directions = file.numbers_f32("shapedirs", BODY_HINT)?;
                match directions.shape[..] {
                    [v, 3, k] if v == vertices => (k, directions.data),
                    _ => {
                        let expected = format!("[{vertices}, 3, components]");
                        return Err(file.wrong_shape("shapedirs", &directions.shape, &expected));
                    }
                }
            }
        };
        let ours = file.contains("J_shapedirs");
        let shape_count = shape_part(joints, components, ours).min(settings.shape_components);
        let shape_directions = first_columns(&directions, components, shape_count);

        let weights = file.numbers_f32("weights", BODY_HINT)?;
        let weights = file.of_shape("weights", weights, &[vertices, joints])?;
        let (joint_template, joint_shape_directions) = if file.contains("J_template") {
            let joint_template = points(&mut file, "J_template")?;
            if joint_template.len() != joints {
                let found = [joint_template.len(), 3];
                return Err(file.wrong_shape("J_template", &found, &format!("[{joints}, 3]")));
            }
            let directions = match components == 0 && !ours {
                true => Array { shape: vec![joints, 3, 0], data: Vec::new() },
                false => file.numbers("J_shapedirs", "J_template goes with J_shapedirs")?,
            };
            let directions = file.of_shape("J_shapedirs", directions, &[joints, 3, components])?;
            (joint_template, first_columns(&directions, components, shape_count))
        } else {
            let regressor = file.numbers("J_regressor", BODY_HINT)?;
            let regressor = file.of_shape("J_regressor", regressor, &[joints, vertices])?;
            regress_joints(&regressor, &template, &shape_directions, shape_count)
        };
        let pose_directions = if file.contains("posedirs") {
            let directions = file.numbers_f32("posedirs", BODY_HINT)?;
            let directions = file.of_shape("posedirs", directions, &[vertices, 3, 9 * (joints - 1)])?;
            directions.iter().any(|x| *x != 0.0).then_some(directions)
        } else {
            None
        };
        let names = file.texts("joint_names").ok().flatten().filter(|names| names.len() == joints);
        let joint_names = names.unwrap_or_else(|| skeleton::joint_names(joints));
        for (expected, name) in BODY_JOINT_NAMES.into_iter().enumerate() {
            let found = joint_names.iter().position(|n| n == name).unwrap_or(expected);
            if found != expected {
                return Err(wrong(format!(
                    "key 'joint_names', joint {found} is '{name}', which must be joint {expected}; poses go by the order of SMPL"
                )));
            }
        }
        let name = path.file_stem().map_or_else(|| "body".into(), |s| s.to_string_lossy().into_owned());
        let recorded = recorded_pelvis(&mut file, components, shape_count)?;
        let body = Body::new(BodyParts {
            name,
            faces: faces.into(),
            template,
            shape_directions,
            shape_count,
            joint_template,
            joint_shape_directions,
            pose_directions,
            skin_weights: SparseSkinWeights::from_dense(&weights, joints),
            parents,
            joint_names,
        })
        .map_err(FileError::content(path))?;
        Ok(match recorded {
            Some(pelvis) => body.with_recorded_pelvis(pelvis),
            None => body,
        })
    }

    /// Writes the body as npz (keys as [`Body::load`] reads them, `f32` throughout but for the joints).
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path, source: &Provenance) -> Result<(), FileError> {
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
            .strings("joint_names", &[j], &self.joint_names);
        source.write(&mut npz);
        if let Some(p) = &self.pose_directions {
            npz.f32("posedirs", &[v, 3, 9 * (j - 1)], p);
        }
        let pelvis = self.recorded_pelvis();
        if pelvis.template != [0.0; 3] || pelvis.shape_directions.iter().any(|d| *d != 0.0) {
            npz.f64("pelvis_template", &[3], &pelvis.template);
            npz.f64("pelvis_shapedirs", &[3, k], &pelvis.shape_directions);
        }
        npz.save(path)
    }
}

/// Where the pelvis was before [`Body::save`] wrote the body with its pelvis at the origin.
fn recorded_pelvis(
    file: &mut NpzFile,
    components: usize,
    shape_count: usize,
) -> Result<Option<FilePelvis>, FileError> {
    if !file.contains("pelvis_template") {
        return Ok(None);
    }
    let template = file.numbers("pelvis_template", BODY_HINT)?;
    let [x, y, z] = template.data[..] else {
        return Err(file.wrong_shape("pelvis_template", &template.shape, "[3]"));
    };
    let directions = file.numbers("pelvis_shapedirs", "pelvis_template goes with pelvis_shapedirs")?;
    let directions = file.of_shape("pelvis_shapedirs", directions, &[3, components])?;
    if let Some(x) = template.data.iter().chain(&directions).find(|x| !x.is_finite()) {
        let message =
            format!("keys 'pelvis_template' and 'pelvis_shapedirs' hold {x}; write finite numbers (m)");
        return Err(FileError::content(file.path())(message));
    }
    let shape_directions = first_columns(&directions, components, shape_count);
    Ok(Some(FilePelvis { template: [x, y, z], shape_directions }))
}

fn points(file: &mut NpzFile, key: &str) -> Result<Vec<[f64; 3]>, FileError> {
    let array = file.numbers(key, BODY_HINT)?;
    match array.shape[..] {
        [n, 3] if n > 0 => Ok(array.data.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()),
        _ => Err(file.wrong_shape(key, &array.shape, "[n, 3], n >= 1")),
    }
}

fn faces(file: &mut NpzFile, vertices: usize) -> Result<Vec<[u32; 3]>, FileError> {
    let array = file.numbers("f", BODY_HINT)?;
    if !matches!(array.shape[..], [_, 3]) {
        return Err(file.wrong_shape("f", &array.shape, "[faces, 3]"));
    }
    let is_vertex = |i: f64| i >= 0.0 && i < vertices as f64 && i.fract() == 0.0;
    if let Some(at) = array.data.iter().position(|i| !is_vertex(*i)) {
        let (face, vertex) = (at / 3, array.data[at]);
        if vertex.fract() != 0.0 {
            let place = format!("corner {} of face {face}", at % 3);
            return Err(fraction(file, "f", &place, vertex));
        }
        let message =
            format!("key 'f', face {face} names vertex {vertex}, but there are {vertices} vertices");
        return Err(FileError::content(file.path())(message));
    }
    Ok(array.data.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect())
}

fn fraction(file: &NpzFile, key: &str, place: &str, value: f64) -> FileError {
    FileError::content(file.path())(format!(
        "key '{key}', {place} is {value}, which is no whole number; vertices and joints are numbered 0, 1, 2 …"
    ))
}

/// The parent of each joint, from the first row of the table. The root's is −1, or 2³² − 1 where the table is unsigned; anything
/// that is no joint is "none".
fn parents(file: &mut NpzFile) -> Result<Vec<Option<usize>>, FileError> {
    let tree = file.numbers("kintree_table", BODY_HINT)?;
    let joints = match tree.shape[..] {
        [2, joints] if joints > 0 => joints,
        _ => return Err(file.wrong_shape("kintree_table", &tree.shape, "[2, joints]")),
    };
    let parents = &tree.data[..joints];
    if let Some(joint) = parents.iter().position(|p| p.fract() != 0.0) {
        let place = format!("the parent of joint {joint}");
        return Err(fraction(file, "kintree_table", &place, parents[joint]));
    }
    let is_joint = |p: f64| p >= 0.0 && p < joints as f64;
    Ok((parents.iter().enumerate())
        .map(|(joint, p)| (joint > 0 && is_joint(*p)).then_some(*p as usize))
        .collect())
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
