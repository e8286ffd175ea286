//! What of its data a run's memory depends on.

use super::body::load_body;
use super::error::DatasetError;
use super::garment_source::GarmentSource;
use super::prepared_garment::PreparedGarment;
use super::split::{GarmentPurpose, purpose};
use crate::config::{Config, DataConfig};
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body};
use rayon::prelude::*;

/// What of its data a run's memory depends on.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSizes {
    /// Vertices of every garment that a run reads: with a cache not of those that are kept for the final test.
    pub vertices: Vec<usize>,
    /// Joints the networks see.
    pub joints: usize,
    /// Shape components of the body.
    pub shape_components: usize,
    /// Vertices of the body.
    pub body_vertices: usize,
    /// Triangles of the body.
    pub body_faces: usize,
    /// Joints of the body.
    pub body_joints: usize,
}

/// SMPL-X: vertices, triangles, joints.
const SMPL_X: [usize; 3] = [10_475, 20_908, 55];

/// Whether garments that are kept for the final test are loaded, too: without a cache all are.
pub(super) fn reads_tests(config: &DataConfig) -> bool {
    config.cache.folder.is_none()
}

/// Bytes of what is known of a garment without reading it: name, provenance, keys, where its file is.
const GARMENT_INFO: usize = 1536;

impl DataSizes {
    /// Those of the data that `config` names. Meshes are read for their number of vertices, nothing is computed.
    ///
    /// # Errors
    /// [`DatasetError`] naming the file at fault.
    pub fn of_named(config: &Config) -> Result<Self, DatasetError> {
        DatasetError::check_inputs(config)?;
        let body = load_body(&config.data.body, config.data.shape_components)?;
        let mut sources = GarmentSource::list(&config.data.garments)?;
        if !reads_tests(&config.data) {
            sources.retain(|source| purpose(&source.name(), &config.data) != GarmentPurpose::Test);
        }
        Self::of_listed(&sources, &body)
    }

    /// Those of listed garments on `body`.
    ///
    /// # Errors
    /// [`DatasetError`] naming the file at fault.
    pub fn of_listed(sources: &[GarmentSource], body: &Body) -> Result<Self, DatasetError> {
        Ok(Self::of_body(sources.par_iter().map(GarmentSource::vertices).collect::<Result<_, _>>()?, body))
    }

    /// Those of a dataset that is not at hand, on a body like SMPL-X.
    pub fn assumed(garments: usize, vertices: usize, shape_components: usize) -> Self {
        let [body_vertices, body_faces, body_joints] = SMPL_X;
        Self {
            vertices: vec![vertices; garments],
            joints: BODY_JOINT_COUNT,
            shape_components,
            body_vertices,
            body_faces,
            body_joints,
        }
    }

    /// Those of garments of so many `vertices` on `body`.
    pub(super) fn of_body(vertices: Vec<usize>, body: &Body) -> Self {
        Self {
            vertices,
            // Hands and face carry no garment.
            joints: body.joint_count().min(BODY_JOINT_COUNT),
            shape_components: body.shape_count,
            body_vertices: body.vertex_count(),
            body_faces: body.faces.len(),
            body_joints: body.joint_count(),
        }
    }

    /// Memory that everything about the garments takes in a run of `config` without a cache (bytes), but for what only the
    /// device has.
    pub fn unstreamed_bytes(&self, config: &Config) -> u64 {
        // Before the joints in use are known, weights of all joints are there.
        let weights = |v: usize| 4 * v * self.body_joints;
        self.sum(|v| self.garment_bytes(config, v) + operator_bytes(config, v) + weights(v))
    }

    /// Memory of a garment of `vertices` vertices on the host (bytes).
    pub(crate) fn garment_bytes(&self, config: &Config, vertices: usize) -> usize {
        let transferred = if config.start.shape_transfer { self.shape_components } else { 0 };
        PreparedGarment::expected_bytes(vertices, self.joints, transferred)
    }

    /// Memory of its tensors and, `embeddings` times over, of its embedding (bytes).
    pub(crate) fn device_bytes(&self, config: &Config, vertices: usize, embeddings: f64) -> usize {
        let embedding = 4 * config.model.embedding * (vertices + 1);
        tensor_bytes(vertices, config.model.eigen_count, self.joints)
            + (embeddings * embedding as f64) as usize
    }

    /// Memory of the body and the list of garments (bytes).
    pub(crate) fn lasting_bytes(&self) -> u64 {
        let per_vertex = 3 * (self.shape_components + 9 * self.body_joints.saturating_sub(1)) * 4 + 100;
        (self.body_vertices * per_vertex + self.vertices.len() * GARMENT_INFO) as u64
    }

    /// The sum of `bytes` over all garments.
    pub(crate) fn sum(&self, bytes: impl Fn(usize) -> usize) -> u64 {
        self.vertices.iter().map(|v| bytes(*v) as u64).sum()
    }

    /// Vertices of the `count` largest garments; where there are fewer, the largest several times.
    pub(crate) fn largest(&self, count: usize) -> Vec<usize> {
        let mut sizes = self.vertices.clone();
        sizes.sort_unstable_by(|a, b| b.cmp(a));
        sizes.iter().cycle().take(if sizes.is_empty() { 0 } else { count }).copied().collect()
    }
}

/// Memory of DiffusionNet's operators of a garment on the host (bytes).
pub(crate) fn operator_bytes(config: &Config, vertices: usize) -> usize {
    12 * vertices * config.model.eigen_count + 8 * vertices
}

/// Memory of the tensors of a garment (bytes): Φ, ΦᵀM and both gradient products, skin weights, rest positions and masses.
pub fn tensor_bytes(vertices: usize, eigen_count: usize, joints: usize) -> usize {
    4 * vertices * (4 * eigen_count + joints + 4)
}
