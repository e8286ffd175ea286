//! DiffusionNet in the published order of operations: the oracle of the fast form.

use burn::tensor::Tensor;
use burn::tensor::activation::relu;

use crate::diffusion_net::{DiffusionBlock, DiffusionNet};
use crate::tensors::GarmentTensors;

/// [`DiffusionNet::forward`] with full-size intermediate features.
pub(super) fn forward(net: &DiffusionNet, garment: &GarmentTensors) -> Tensor<2> {
    let features = net.first.forward(garment.rest.clone());
    let features =
        net.blocks.iter().fold(features, |features, block| block_forward(block, features, garment));
    net.last.forward(features)
}

fn block_forward(block: &DiffusionBlock, features: Tensor<2>, garment: &GarmentTensors) -> Tensor<2> {
    let vertices = garment.vertex_count();
    let eigen = garment.eigen_count();
    let spectrum = garment.projection.clone().matmul(features.clone());
    let decayed = spectrum * garment.decay.clone().matmul(block.diffusion.times()).exp();
    let diffused = garment.basis.clone().matmul(decayed.clone());

    // The gradient operators are linear and x_diff = Φ c, so that G x_diff = (G Φ) c.
    let axis = |axis: usize| {
        garment.gradient_basis.clone().slice([axis * vertices..(axis + 1) * vertices, 0..eigen])
    };
    let gradient_x = axis(0).matmul(decayed.clone());
    let gradient_y = axis(1).matmul(decayed);
    let by_real = |gradient: &Tensor<2>| gradient.clone().matmul(block.mixing.real.val());
    let by_imaginary = |gradient: &Tensor<2>| gradient.clone().matmul(block.mixing.imaginary.val());
    let real = by_real(&gradient_x) - by_imaginary(&gradient_y);
    let imaginary = by_real(&gradient_y) + by_imaginary(&gradient_x);
    let gradient = (gradient_x * real + gradient_y * imaginary).tanh();

    let mlp = &block.mlp;
    let weight = Tensor::cat(vec![mlp.input.val(), mlp.diffused.val(), mlp.gradient.val()], 0);
    let joined = Tensor::cat(vec![features.clone(), diffused, gradient], 1);
    let hidden = relu(joined.matmul(weight) + mlp.bias.val().unsqueeze());
    let hidden = relu(mlp.hidden.forward(hidden));
    mlp.output.forward(hidden) + features
}
