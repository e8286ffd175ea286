//! Contact features of the vertices of an outfit, as tensors.

use burn::tensor::{Device, Tensor};

use super::matrix;
use crate::error::{ModelError, check_length};

/// Contact features of every vertex: other garments, the body and forces of its own cloth, as a correction network reads
/// them.
#[derive(Clone, Debug)]
pub struct ContactFeatureTensors {
    /// Dimensionless features `[ΣV,F]`.
    pub features: Tensor<2>,
    /// Canonical directions that vertices may be moved in `[ΣV,3]` each.
    pub directions: [Tensor<2>; ContactFeatureTensors::DIRECTIONS],
}

impl ContactFeatureTensors {
    /// Features F per vertex.
    pub const FEATURES: usize = 54;
    /// Directions per vertex.
    pub const DIRECTIONS: usize = 7;

    /// Uploads them to `device` (the inner device, if it is an autodiff one). Numbers that are not finite pass: they follow
    /// from positions that are not, and a run handles those where it checks its loss.
    ///
    /// # Errors
    /// Lengths that disagree.
    pub fn new(
        features: Vec<f32>,
        directions: [&[[f32; 3]]; Self::DIRECTIONS],
        device: &Device,
    ) -> Result<Self, ModelError> {
        let rows = directions[0].len();
        check_length("contact features", features.len(), rows * Self::FEATURES, "[ΣV,F]")?;
        for direction in directions {
            check_length("contact directions", direction.len(), rows, "[ΣV,3]")?;
        }
        let device = &device.clone().inner();
        let direction = |d: &[[f32; 3]]| matrix(d.as_flattened().to_vec(), rows, 3, device);
        Ok(Self {
            features: matrix(features, rows, Self::FEATURES, device),
            directions: directions.map(direction),
        })
    }
}
