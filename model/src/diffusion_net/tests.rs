use super::*;
use crate::testing::{
    HostGarment, assert_close, assert_gradients_close, assert_gradients_match_differences, device, loss,
    parameter_gradients, seeded, values,
};

mod plain;

fn net(width: usize) -> DiffusionNet {
    let device = device();
    let mut net = seeded(5, |start| DiffusionNet::new(3, width, 6, start));
    // Away from the starting times, so that diffusion matters.
    for (index, block) in net.blocks.iter_mut().enumerate() {
        let times = (0..width).map(|channel| 0.002 * (channel + index) as f32 - 0.001).collect::<Vec<_>>();
        let times = Tensor::from_floats(times.as_slice(), &device);
        block.diffusion.time = burn::module::Param::from_tensor(times);
    }
    net
}

#[test]
fn fast_form_equals_the_published_one_in_values_and_gradients() {
    let garment = HostGarment::random(150, 20, &[true], 1).tensors(&device());
    let net = net(12);
    let (fast, plain) = (net.forward(&garment), plain::forward(&net, &garment));
    assert_close(&fast.clone().inner(), &plain.clone().inner(), 1e-5);
    let fast = parameter_gradients(&net, loss(fast));
    let plain = parameter_gradients(&net, loss(plain));
    assert!(plain.iter().all(|(_, gradient)| !gradient.is_empty()));
    assert_gradients_close(&fast, &plain, 1e-5);
}

/// Several blocks of rows and parts of the sums; a width that no vector divides.
#[test]
fn the_fused_form_equals_the_steps_one_by_one_in_values_and_gradients_for_any_number_of_threads() {
    let garment = HostGarment::random(1700, 20, &[true], 1).tensors(&device());
    let net = net(38);
    let run = |fused: bool| {
        let start = net.first.forward(garment.rest.clone());
        let block = |features, block: &DiffusionBlock| block.forward_in_form(features, &garment, fused);
        let output = net.last.forward(net.blocks.iter().fold(start, block));
        (output.clone().inner(), parameter_gradients(&net, loss(output)))
    };
    let on_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (output, gradients) = pool.install(|| run(true));
        (values(&output), gradients)
    };
    let (fused, plain) = (run(true), run(false));
    assert_close(&fused.0, &plain.0, 1e-5);
    assert_gradients_close(&fused.1, &plain.1, 1e-5);
    let one = on_threads(1);
    for threads in [2, 4] {
        assert!(one == on_threads(threads), "{threads} threads");
    }
}

#[test]
fn features_follow_a_permutation_of_the_vertices() {
    let host = HostGarment::random(90, 10, &[true], 2);
    let order: Vec<usize> = (0..90).map(|i| i * 37 % 90).collect();
    let net = net(8).valid();
    let device = device().inner();
    let original = net.forward(&host.tensors(&device));
    let permuted = net.forward(&host.permuted(&order).tensors(&device));
    let order: Vec<i32> = order.iter().map(|&i| i as i32).collect();
    let expected = original.select(0, Tensor::from_data(order.as_slice(), &device));
    assert_close(&permuted, &expected, 1e-5);
}

#[test]
fn gradients_match_finite_differences() {
    let garment = HostGarment::random(60, 12, &[true], 3).tensors(&device());
    let net = net(6);
    let parameters = [
        "first.weight",
        "blocks.0.diffusion.time",
        "blocks.1.mixing.real",
        "blocks.1.mixing.imaginary",
        "blocks.0.mlp.diffused",
        "blocks.2.mlp.gradient",
        "blocks.2.mlp.output.bias",
        "last.weight",
    ];
    let steps = [1e-2, 2e-3, 5e-4, 1e-4, 2e-5];
    assert_gradients_match_differences(&net, &parameters, &steps, 1e-2, |net| net.forward(&garment));
}

#[test]
fn a_time_at_its_lower_bound_still_learns() {
    let device = device();
    let garment = HostGarment::random(60, 12, &[true], 4).tensors(&device);
    let net = seeded(6, |start| DiffusionNet::new(1, 6, 6, start));
    let gradients = parameter_gradients(&net, loss(net.forward(&garment)));
    let (_, time) = gradients.iter().find(|(name, _)| name == "blocks.0.diffusion.time").expect("name");
    assert!(time.iter().any(|gradient| gradient.abs() > 0.0));
    let times = net.blocks[0].diffusion.times().inner();
    assert!(values(&times).iter().all(|&time| time == 1e-8));
}

/// Diffusion of an eigenvector multiplies it with e^{−λt}.
#[test]
fn diffusion_damps_each_eigenvector_by_its_eigenvalue() {
    let device = device().inner();
    let mut diffusion = seeded(1, |start| SpectralDiffusion::new(2, start));
    diffusion.time = burn::module::Param::from_tensor(Tensor::from_floats([0.1, 0.5], &device));
    let decay = Tensor::<2>::from_floats([[0.0], [-2.0], [-7.0]], &device);
    let damped = diffusion.diffuse(Tensor::ones([3, 2], &device), decay);
    let expected = [[1.0, 1.0], [(-0.2f32).exp(), (-1.0f32).exp()], [(-0.7f32).exp(), (-3.5f32).exp()]];
    assert_close(&damped, &Tensor::from_floats(expected, &device), 1e-6);
}
