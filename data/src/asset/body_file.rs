//! Bodies in SMPL-family npz files.
//!
//! Read: `v_template`, `f`, `shapedirs`, `weights`, `kintree_table`, and either `J_template` with `J_shapedirs` or
//! `J_regressor`; optionally `posedirs` and `joint_names`. Written: the same keys with `J_template` and `J_shapedirs`, plus
//! `source`, `author` and `licence`.

use super::body::{Body, BodyError, BodyParts};
use super::provenance::Provenance;
use super::skeleton;
use super::skin_weights::SparseSkinWeights;
use crate::format::npz::{Array, NpzError, NpzFile, NpzWriter};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a body file cannot be used.
#[derive(Debug, Error)]
pub enum BodyFileError {
    /// The archive or one of its arrays is unusable.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The arrays do not make a body.
    #[error("{}: {source}", path.display())]
    Body {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: BodyError,
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
    ///
    /// # Errors
    /// [`BodyFileError`] naming file and key.
    pub fn load(path: &Path, settings: &BodyFileSettings) -> Result<Self, BodyFileError> {
        let mut file = NpzFile::open(path)?;
        let template = points(path, "v_template", file.numbers("v_template", HINT)?)?;
        let vertices = template.len();
        let faces = faces(path, file.numbers("f", HINT)?, vertices)?;
        let tree = file.numbers("kintree_table", HINT)?;
        let joints = match tree.shape[..] {
            [2, joints] if joints > 0 => joints,
            _ => return Err(shape_error(path, "kintree_table", &tree.shape, "[2, joints]")),
        };
        // The root's parent is −1, or 2³² − 1 where the table is unsigned; anything that is no joint is "none".
        let parents: Vec<Option<usize>> = tree.data[..joints]
            .iter()
            .map(|p| (*p >= 0.0 && *p < joints as f64).then_some(*p as usize))
            .enumerate()
            .map(|(joint, parent)| if joint == 0 { None } else { parent })
            .collect();

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
        .map_err(|source| BodyFileError::Body { path: path.into(), source })
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
    if let Some(at) = array.data.iter().position(|i| !(*i >= 0.0 && *i < vertices as f64)) {
        let (face, vertex) = (at / 3, array.data[at]);
        return Err(BodyFileError::Face { path: path.into(), face, vertex, vertices });
    }
    Ok(array.data.chunks_exact(3).map(|f| [f[0] as u32, f[1] as u32, f[2] as u32]).collect())
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
mod tests {
    use super::super::body::tests::random_parts;
    use super::*;

    #[test]
    fn a_body_without_vertices_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.npz");
        let mut npz = NpzWriter::new();
        npz.f32("v_template", &[0, 3], &[]).u32("f", &[0, 3], &[]).f32("shapedirs", &[0, 3, 1], &[]);
        npz.f32("weights", &[0, 2], &[]).u32("kintree_table", &[2, 2], &[u32::MAX, 0, 0, 1]);
        npz.f64("J_regressor", &[2, 0], &[]);
        npz.save(&path).unwrap();
        let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
        assert!(message.contains("none.npz") && message.contains("v_template"), "{message}");
    }

    #[test]
    fn what_is_saved_loads_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.npz");
        let body = Body::new(random_parts(7, 1)).unwrap();
        body.save(&path, &Provenance::default()).unwrap();
        let loaded = Body::load(&path, &BodyFileSettings::default()).unwrap();
        assert_eq!(loaded.faces, body.faces);
        assert_eq!(loaded.shape_directions, body.shape_directions);
        assert_eq!(loaded.joint_template, body.joint_template);
        assert_eq!(loaded.joint_shape_directions, body.joint_shape_directions);
        assert_eq!(loaded.pose_directions, body.pose_directions);
        assert_eq!((loaded.parents, loaded.joint_names), (body.parents, body.joint_names));
        for (a, b) in loaded.template.iter().flatten().zip(body.template.iter().flatten()) {
            assert!((a - b).abs() < 1e-7);
        }
        let few = Body::load(&path, &BodyFileSettings { shape_components: 2 }).unwrap();
        assert_eq!(few.shape_count, 2);
        assert_eq!(few.shape_directions[2..4], [body.shape_directions[3], body.shape_directions[4]]);
    }

    /// The layout the SMPL family ships: unsigned tree with 2³² − 1 at the root, dense weights, a joint regressor.
    #[test]
    fn joints_come_from_the_regressor_and_a_missing_key_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("smpl.npz");
        let template = [0.0f32, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0];
        let directions = [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let write = |leave_out: &str| {
            let mut npz = NpzWriter::new();
            if leave_out != "v_template" {
                npz.f32("v_template", &[3, 3], &template);
            }
            npz.u32("f", &[1, 3], &[0, 1, 2]).f32("shapedirs", &[3, 3, 1], &directions);
            if leave_out != "weights" {
                npz.f32("weights", &[3, 2], &[1.0, 0.0, 0.5, 0.5, 0.0, 1.0]);
            }
            npz.u32("kintree_table", &[2, 2], &[u32::MAX, 0, 0, 1]);
            if leave_out != "J_regressor" {
                npz.f64("J_regressor", &[2, 3], &[0.5, 0.5, 0.0, 0.0, 0.5, 0.5]);
            }
            npz.save(&path).unwrap();
        };
        write("");
        let body = Body::load(&path, &BodyFileSettings::default()).unwrap();
        // Regressed joints are (1, 0, 0) and (1, 1, 0); then the pelvis goes to the origin.
        assert_eq!(body.joint_template, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!(body.template[0], [-1.0, 0.0, 0.0]);
        // The second joint's direction (0, .5, .5) less the pelvis' (.5, .5, 0).
        assert_eq!(body.joint_shape_directions[3..], [-0.5, 0.0, 0.5]);
        assert_eq!(body.parents, [None, Some(0)]);
        for key in ["v_template", "weights", "J_regressor"] {
            write(key);
            let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
            assert!(message.contains("smpl.npz") && message.contains(&format!("'{key}'")), "{message}");
            assert!(message.contains("SMPL") && message.contains("shapedirs"), "{message}");
        }
    }

    #[test]
    fn a_pickle_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("SMPL_NEUTRAL.pkl");
        std::fs::write(&path, b"\x80\x02}q\x00.").unwrap();
        let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
        assert!(message.contains("SMPL_NEUTRAL.pkl") && message.contains("pickles"), "{message}");
        let missing = Body::load(&folder.path().join("none.npz"), &BodyFileSettings::default()).unwrap_err();
        assert!(missing.to_string().contains("none.npz"));
    }
}
