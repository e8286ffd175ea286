//! One garment as tensors.

use burn::tensor::{Device, Tensor};

use super::matrix;
use crate::error::{ModelError, check_array, check_finite};

/// Host arrays a garment's tensors are made from; matrices are row-major.
///
/// V vertices, k eigenpairs, J active joints.
#[derive(Clone, Copy, Debug)]
pub struct GarmentArrays<'a> {
    /// Rest positions `[V,3]` (m).
    pub rest: &'a [f32],
    /// Lumped vertex masses `[V]` (area, m²; only ratios matter in the embedding average).
    pub mass: &'a [f64],
    /// Laplacian eigenvalues `[k]`, ascending, zero in padded columns.
    pub eigenvalues: &'a [f64],
    /// Mass-orthonormal eigenvectors Φ `[V,k]`, zero in padded columns.
    pub eigenvectors: &'a [f32],
    /// `G_x Φ` `[V,k]`: derivative of the eigenvectors along the first tangent axis.
    pub gradient_x_basis: &'a [f32],
    /// `G_y Φ` `[V,k]`: derivative of the eigenvectors along the second tangent axis.
    pub gradient_y_basis: &'a [f32],
    /// Initial skin weights `[V,J]` over the active joints, rows summing to one.
    pub skin_weights: &'a [f32],
}

/// Constant tensors of one garment (V vertices, k eigenpairs, J active joints).
#[derive(Clone, Debug)]
pub struct GarmentTensors {
    /// Rest positions `[V,3]` (m).
    pub rest: Tensor<2>,
    /// Vertex masses over their sum `[1,V]`: the row that averages vertex features.
    pub mass: Tensor<2>,
    /// Negated Laplacian eigenvalues `[k,1]`, the rates of spectral decay.
    pub decay: Tensor<2>,
    /// Eigenvectors Φ `[V,k]`: spectral coefficients to vertices.
    pub basis: Tensor<2>,
    /// `Φᵀ M` `[k,V]`: vertices to spectral coefficients.
    pub projection: Tensor<2>,
    /// `G_x Φ` stacked on `G_y Φ` `[2V,k]`: spectral coefficients to tangent-plane gradients.
    pub gradient_basis: Tensor<2>,
    /// Initial skin weights `[V,J]`.
    pub skin_weights: Tensor<2>,
    /// One where the joint moves any vertex of the garment, zero elsewhere `[1,J]`.
    pub joint_mask: Tensor<2>,
}

impl GarmentTensors {
    /// Uploads a garment to `device` (the inner device, if it is an autodiff one).
    ///
    /// `joints` is J; V and k follow from the array lengths.
    ///
    /// # Errors
    /// An array whose length disagrees with V, k or J, a number that is not finite, or a garment without mass.
    pub fn new(arrays: &GarmentArrays<'_>, joints: usize, device: &Device) -> Result<Self, ModelError> {
        let vertices = arrays.mass.len();
        let eigen = arrays.eigenvalues.len();
        let cells = vertices * eigen;
        check_array("rest positions", arrays.rest, vertices * 3, "[V,3], V = number of masses")?;
        check_array("eigenvectors", arrays.eigenvectors, cells, "[V,k], k = number of eigenvalues")?;
        check_array("gradient_x_basis", arrays.gradient_x_basis, cells, "[V,k], k = number of eigenvalues")?;
        check_array("gradient_y_basis", arrays.gradient_y_basis, cells, "[V,k], k = number of eigenvalues")?;
        check_array("skin weights", arrays.skin_weights, vertices * joints, "[V,J], J = active joints")?;
        check_finite("eigenvalues", arrays.eigenvalues)?;
        check_finite("masses", arrays.mass)?;
        let total: f64 = arrays.mass.iter().sum();
        if total <= 0.0 {
            return Err(ModelError::NoMass { total });
        }

        let device = &device.clone().inner();
        let average = arrays.mass.iter().map(|mass| (mass / total) as f32).collect();
        let decay = arrays.eigenvalues.iter().map(|value| -value as f32).collect();
        let mut projection = vec![0.0_f32; cells];
        for vertex in 0..vertices {
            for column in 0..eigen {
                let value = f64::from(arrays.eigenvectors[vertex * eigen + column]) * arrays.mass[vertex];
                projection[column * vertices + vertex] = value as f32;
            }
        }
        let gradient = [arrays.gradient_x_basis, arrays.gradient_y_basis].concat();
        let moves =
            |joint| arrays.skin_weights.iter().skip(joint).step_by(joints).any(|weight| *weight != 0.0);
        let joint_mask = (0..joints).map(|joint| if moves(joint) { 1.0 } else { 0.0 }).collect();
        Ok(Self {
            rest: matrix(arrays.rest.to_vec(), vertices, 3, device),
            mass: matrix(average, 1, vertices, device),
            decay: matrix(decay, eigen, 1, device),
            basis: matrix(arrays.eigenvectors.to_vec(), vertices, eigen, device),
            projection: matrix(projection, eigen, vertices, device),
            gradient_basis: matrix(gradient, 2 * vertices, eigen, device),
            skin_weights: matrix(arrays.skin_weights.to_vec(), vertices, joints, device),
            joint_mask: matrix(joint_mask, 1, joints, device),
        })
    }

    /// Number of vertices V.
    pub fn vertex_count(&self) -> usize {
        self.rest.dims()[0]
    }

    /// Number of eigenpairs k.
    pub fn eigen_count(&self) -> usize {
        self.basis.dims()[1]
    }

    /// Number of active joints J.
    pub fn joint_count(&self) -> usize {
        self.skin_weights.dims()[1]
    }
}
