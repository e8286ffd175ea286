//! A parametric body with linear blend skinning in the form of SMPL, SMPL-H and SMPL-X.
//!
//! Loper et al., "SMPL: A Skinned Multi-Person Linear Model", 2015: `v = T + S·β (+ P·(R − I))`, joints linear in β, then
//! linear blend skinning. Here every body stands with its pelvis joint at the origin *for every shape*: the pelvis of the
//! template and of each shape direction is subtracted when the body is made, which moves SMPL bodies by a translation.

use super::pose::Pose;
use super::rotation::{self, Matrix3, matrix_from_axis_angle};
use super::skin_weights::SparseSkinWeights;
use clothcombo_physics::mesh::{Topology, TriMesh};
use clothcombo_physics::transform;
use clothcombo_physics::vec3::{add, sub};
use rayon::prelude::*;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, OnceLock};
use thiserror::Error;

mod joints;
mod skinning;

pub use skinning::{skin, unskin};

/// Why a body cannot be made, posed or recovered: its name, and the array, joint or vertex that is wrong.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct BodyError(pub(super) String);

/// Everything a body is made of: V vertices, J joints, K shape components.
#[derive(Clone, Debug)]
pub struct BodyParts {
    /// Name used in messages and reports.
    pub name: String,
    /// Triangles.
    pub faces: Arc<[[u32; 3]]>,
    /// Vertices of the mean ("zero") body in T-pose (m).
    pub template: Vec<[f64; 3]>,
    /// Displacement per unit of each shape component (m), `[V × 3 × K]` row-major.
    pub shape_directions: Vec<f32>,
    /// Number of shape components K.
    pub shape_count: usize,
    /// Joints of the zero body (m).
    pub joint_template: Vec<[f64; 3]>,
    /// Displacement of the joints per unit of each shape component (m), `[J × 3 × K]` row-major.
    pub joint_shape_directions: Vec<f64>,
    /// Pose-corrective displacements (m) per entry of `(R_1 … R_{J−1}) − I`, `[V × 3 × 9(J−1)]` row-major.
    pub pose_directions: Option<Vec<f32>>,
    /// Skin weights, sparse, each row summing to one.
    pub skin_weights: SparseSkinWeights,
    /// Parent of each joint; `None` only for joint 0.
    pub parents: Vec<Option<usize>>,
    /// Name of each joint.
    pub joint_names: Vec<String>,
}

/// A parametric body: parts that fit together, its pelvis (joint 0) at the origin for every shape.
#[derive(Clone, Debug)]
pub struct Body {
    parts: BodyParts,
    zero_body: TriMesh,
    topology: OnceLock<Arc<Topology>>,
    file_pelvis: FilePelvis,
}

/// Where the pelvis stood before the body was moved to the origin.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct FilePelvis {
    /// Of the zero body (m).
    pub template: [f64; 3],
    /// Its displacement per unit of each shape component (m), `[3 × K]` row-major.
    pub shape_directions: Vec<f64>,
}

impl Deref for Body {
    type Target = BodyParts;

    fn deref(&self) -> &BodyParts {
        &self.parts
    }
}

impl DerefMut for Body {
    fn deref_mut(&mut self) -> &mut BodyParts {
        &mut self.parts
    }
}

/// Vertices and joints of a shaped body in T-pose (m).
#[derive(Clone, Debug)]
pub struct ShapedBody {
    /// Vertices.
    pub positions: Vec<[f64; 3]>,
    /// Joints.
    pub joints: Vec<[f64; 3]>,
}

/// A shaped and posed body (m).
#[derive(Clone, Debug)]
pub struct PosedBody {
    /// Vertices.
    pub positions: Vec<[f64; 3]>,
    /// Per joint the 3×4 transform that carries a point of the shaped T-pose body to the posed body.
    pub bones: Vec<[[f64; 4]; 3]>,
    /// Joints after posing.
    pub joints: Vec<[f64; 3]>,
}

impl Body {
    /// Checks the parts against each other, and moves the body so that its pelvis (joint 0) is at the origin for every shape.
    ///
    /// # Errors
    /// [`BodyError`] naming the array, joint or vertex that is wrong.
    pub fn new(mut parts: BodyParts) -> Result<Self, BodyError> {
        let name = parts.name.clone();
        let (vertices, joints, k) = (parts.template.len(), parts.joint_template.len(), parts.shape_count);
        let wrong = |message: String| BodyError(format!("body '{name}': {message}"));
        let check = |part, layout, found: usize, expected: usize| match found == expected {
            true => Ok(()),
            false => Err(wrong(format!("{part} has {found} numbers, expected {expected} ({layout})"))),
        };
        check("the joint tree", "[J], J >= 1", parts.parents.len(), joints.max(1))?;
        check("the list of joint names", "[J]", parts.joint_names.len(), joints)?;
        check("the shape directions", "[V, 3, K]", parts.shape_directions.len(), vertices * 3 * k)?;
        check("the joint shape directions", "[J, 3, K]", parts.joint_shape_directions.len(), joints * 3 * k)?;
        check("the skin weights", "[V, J]", parts.skin_weights.vertex_count(), vertices)?;
        if let Some(p) = &parts.pose_directions {
            check("the pose directions", "[V, 3, 9(J-1)]", p.len(), vertices * 27 * (joints - 1))?;
        }
        let in_f64 = |numbers: &[f64]| numbers.iter().position(|x| !x.is_finite());
        let in_f32 = |numbers: &[f32]| numbers.iter().position(|x| !x.is_finite());
        for (part, position) in [
            ("the template", in_f64(parts.template.as_flattened())),
            ("the joint template", in_f64(parts.joint_template.as_flattened())),
            ("the shape directions", in_f32(&parts.shape_directions)),
            ("the joint shape directions", in_f64(&parts.joint_shape_directions)),
            ("the pose directions", parts.pose_directions.as_deref().and_then(in_f32)),
        ] {
            if let Some(index) = position {
                return Err(wrong(format!("{part} holds a non-finite number at position {index}")));
            }
        }
        for (joint, parent) in parts.parents.iter().enumerate() {
            if (joint == 0) != parent.is_none() || parent.is_some_and(|p| p >= joint) {
                return Err(wrong(format!(
                    "joint {joint} has parent {parent:?}; joint 0 must be the only root and parents must come first"
                )));
            }
        }
        for vertex in 0..vertices {
            let (row_joints, row) = parts.skin_weights.row(vertex);
            let sum = row.iter().fold(0.0f32, |sum, w| sum + w);
            let problem = if row.is_empty() || sum.is_nan() || (sum - 1.0).abs() > 1e-3 {
                format!("sum to {sum} instead of 1")
            } else if let Some(j) = row_joints.iter().find(|j| usize::from(**j) >= joints) {
                format!("name joint {j} of {joints}")
            } else {
                continue;
            };
            return Err(wrong(format!("skin weights of vertex {vertex} {problem}")));
        }

        // Pelvis to the origin: of the template, and of every shape direction.
        let pelvis = parts.joint_template[0];
        for p in parts.template.iter_mut().chain(&mut parts.joint_template) {
            *p = sub(*p, pelvis);
        }
        let pelvis_directions = parts.joint_shape_directions[..3 * k].to_vec();
        if k > 0 && pelvis_directions.iter().any(|x| *x != 0.0) {
            for row in parts.shape_directions.chunks_exact_mut(3 * k) {
                row.iter_mut().zip(&pelvis_directions).for_each(|(x, p)| *x = (f64::from(*x) - p) as f32);
            }
            for row in parts.joint_shape_directions.chunks_exact_mut(3 * k) {
                row.iter_mut().zip(&pelvis_directions).for_each(|(x, p)| *x -= p);
            }
        }
        let zero_body =
            TriMesh::new(parts.template.clone(), parts.faces.to_vec()).map_err(|e| wrong(e.to_string()))?;
        let file_pelvis = FilePelvis { template: pelvis, shape_directions: pelvis_directions };
        Ok(Self { parts, zero_body, topology: OnceLock::new(), file_pelvis })
    }

    /// The same body, made of a file that holds it moved already: there its pelvis stood at `recorded`.
    pub(super) fn with_recorded_pelvis(mut self, recorded: FilePelvis) -> Self {
        let own = &self.file_pelvis;
        let directions = own.shape_directions.iter().zip(&recorded.shape_directions).map(|(a, b)| a + b);
        self.file_pelvis = FilePelvis {
            template: add(own.template, recorded.template),
            shape_directions: directions.collect(),
        };
        self
    }

    pub(super) fn recorded_pelvis(&self) -> &FilePelvis {
        &self.file_pelvis
    }

    /// Where the pelvis of shape `beta` stands in the coordinates that the body was given in (m): for SMPL some 0.22 m
    /// and for SMPL-X some 0.35 m below the origin. A short `beta` is continued with zeros. A file that [`Body::save`]
    /// wrote still knows it.
    pub fn file_pelvis(&self, beta: &[f64]) -> [f64; 3] {
        let FilePelvis { template, shape_directions, .. } = &self.file_pelvis;
        let k = self.shape_count;
        std::array::from_fn(|a| {
            let row = shape_directions.get(a * k..(a + 1) * k).unwrap_or_default();
            template[a] + row.iter().zip(beta).map(|(d, b)| d * b).sum::<f64>()
        })
    }

    /// The same body inside out: every face is turned over.
    pub(super) fn turned(mut self) -> Self {
        self.zero_body = self.zero_body.turned();
        self.parts.faces = self.zero_body.faces().into();
        self.topology = OnceLock::new();
        self
    }

    /// The same body with its first `count` shape components, or all it has.
    pub fn with_shape_components(mut self, count: usize) -> Self {
        let k = self.shape_count;
        if count < k {
            self.shape_directions = first_columns(&self.shape_directions, k, count);
            self.joint_shape_directions = first_columns(&self.joint_shape_directions, k, count);
            self.file_pelvis.shape_directions = first_columns(&self.file_pelvis.shape_directions, k, count);
            self.shape_count = count;
        }
        self
    }

    /// Neighbours of the vertices of the zero body.
    pub(super) fn topology(&self) -> &Topology {
        self.topology.get_or_init(|| Arc::new(Topology::new(&self.zero_body)))
    }

    /// Number of vertices V.
    pub fn vertex_count(&self) -> usize {
        self.template.len()
    }

    /// Number of joints J.
    pub fn joint_count(&self) -> usize {
        self.joint_template.len()
    }

    /// The body of shape `beta` in T-pose; a short `beta` is continued with zeros.
    ///
    /// # Errors
    /// [`BodyError`] if `beta` is longer than K.
    pub fn shaped(&self, beta: &[f64]) -> Result<ShapedBody, BodyError> {
        let k = self.shape_count;
        if beta.len() > k {
            return Err(BodyError(format!(
                "{} shape numbers for body '{}', which has {k} shape components",
                beta.len(),
                self.name
            )));
        }
        if beta.iter().all(|b| *b == 0.0) {
            return Ok(ShapedBody { positions: self.template.clone(), joints: self.joint_template.clone() });
        }
        let positions = self
            .template
            .par_iter()
            .with_min_len(1024)
            .zip(self.shape_directions.par_chunks_exact(3 * k))
            .map(|(p, directions)| {
                std::array::from_fn(|a| {
                    let row = &directions[a * k..a * k + beta.len()];
                    p[a] + row.iter().zip(beta).map(|(d, b)| f64::from(*d) * b).sum::<f64>()
                })
            })
            .collect();
        let joints = (self.joint_template.iter().zip(self.joint_shape_directions.chunks_exact(3 * k)))
            .map(|(p, directions)| {
                std::array::from_fn(|a| {
                    p[a] + directions[a * k..].iter().zip(beta).map(|(d, b)| d * b).sum::<f64>()
                })
            })
            .collect();
        Ok(ShapedBody { positions, joints })
    }

    /// World transform of every joint relative to the T-pose, as 3×4 matrices `[R | t]`. The root turns about joint 0 and
    /// does not translate. Rotations the pose does not have are identities; those past J are ignored.
    pub fn bone_transforms(&self, joints: &[[f64; 3]], pose: &Pose) -> Vec<[[f64; 4]; 3]> {
        let mut rotations: Vec<Matrix3> = Vec::with_capacity(joints.len());
        let mut places: Vec<[f64; 3]> = Vec::with_capacity(joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let local = matrix_from_axis_angle(pose.rotation(j));
            match self.parents.get(j).copied().flatten() {
                Some(p) => {
                    let turned = rotation::apply(&rotations[p], sub(*joint, joints[p]));
                    places.push(add(places[p], turned));
                    rotations.push(rotation::product(&rotations[p], &local));
                }
                None => {
                    places.push(*joint);
                    rotations.push(local);
                }
            }
        }
        (0..joints.len()).map(|j| rotation::rigid_motion(&rotations[j], joints[j], places[j])).collect()
    }

    /// The body of shape `beta` in `pose`: shape, pose correctives, linear blend skinning.
    ///
    /// # Errors
    /// [`BodyError`] if `beta` or `pose` is longer than the body allows.
    pub fn posed(&self, beta: &[f64], pose: &Pose) -> Result<PosedBody, BodyError> {
        if pose.rotations.len() > self.joint_count() {
            return Err(BodyError(format!(
                "{} joint rotations for body '{}', which has {} joints",
                pose.rotations.len(),
                self.name,
                self.joint_count()
            )));
        }
        let ShapedBody { mut positions, joints } = self.shaped(beta)?;
        self.add_pose_correctives(&mut positions, pose);
        let bones = self.bone_transforms(&joints, pose);
        let positions = (0..positions.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|v| {
                let weights = self.skin_weights.of_vertex(v);
                skin(positions[v], weights.map(|(j, w)| (&bones[j], f64::from(w))))
            })
            .collect();
        let joints = joints.iter().zip(&bones).map(|(p, b)| transform::apply(b, *p)).collect();
        Ok(PosedBody { positions, bones, joints })
    }

    fn add_pose_correctives(&self, positions: &mut [[f64; 3]], pose: &Pose) {
        let Some(directions) = &self.pose_directions else { return };
        let columns = 9 * (self.joint_count() - 1);
        // Only the joints that are turned contribute: (first column, nine entries of R − I).
        let features: Vec<(usize, [f32; 9])> = (1..pose.rotations.len())
            .filter(|j| pose.rotations[*j] != [0.0; 3])
            .map(|j| {
                let m = matrix_from_axis_angle(pose.rotations[j]);
                (
                    9 * (j - 1),
                    std::array::from_fn(|i| (m[i / 3][i % 3] - rotation::IDENTITY[i / 3][i % 3]) as f32),
                )
            })
            .collect();
        if features.is_empty() {
            return;
        }
        positions.par_iter_mut().with_min_len(256).enumerate().for_each(|(v, p)| {
            for a in 0..3 {
                let row = &directions[(3 * v + a) * columns..(3 * v + a + 1) * columns];
                p[a] += features
                    .iter()
                    .map(|(start, f)| {
                        let block = &row[*start..*start + 9];
                        f64::from(block.iter().zip(f).map(|(d, x)| d * x).sum::<f32>())
                    })
                    .sum::<f64>();
            }
        });
    }

    /// The mean body in T-pose as a mesh.
    pub fn zero_body(&self) -> TriMesh {
        self.zero_body.clone()
    }

    /// Height of the collarbone of the zero body (m): the mean of the two collar joints, or, for a skeleton without them,
    /// 18 % of the pelvis-to-top length below the top.
    pub fn collarbone_height(&self) -> f64 {
        let collars: Vec<f64> = ["left_collar", "right_collar"]
            .iter()
            .filter_map(|n| self.joint_place(n))
            .map(|p| p[1])
            .collect();
        if collars.is_empty() {
            let top = self.template.iter().map(|p| p[1]).fold(0.0, f64::max);
            return 0.82 * top;
        }
        collars.iter().sum::<f64>() / collars.len() as f64
    }
}

/// The first `keep` of so many `columns` of a row-major array.
pub(super) fn first_columns<T: Copy>(data: &[T], columns: usize, keep: usize) -> Vec<T> {
    if columns == 0 {
        return Vec::new();
    }
    data.chunks_exact(columns).flat_map(|row| row[..keep].iter().copied()).collect()
}

#[cfg(test)]
pub(crate) mod tests;
