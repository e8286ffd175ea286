use super::*;
use crate::testing::{
    assert_close, assert_gradients_close, assert_gradients_match_differences, broadcast, device, loss,
    parameter_gradients, seeded, uniform, values,
};

const SIZES: SirenSizes = SirenSizes {
    layers: 4,
    width: 10,
    garment_latent: 5,
    vertex_latent: 7,
    omega_first: 30.0,
    omega_hidden: 1.0,
};

struct SirenCase {
    siren: ModulatedSiren,
    coordinates: Tensor<2>,
    vertex: Tensor<2>,
    garment: Tensor<2>,
    packing: Packing,
}

fn case() -> SirenCase {
    case_of(&SIZES, Packing::new([20, 33, 7]))
}

fn case_of(sizes: &SirenSizes, packing: Packing) -> SirenCase {
    let device = device();
    let tensor = |rows, columns, range, seed| uniform(rows, columns, range, seed, &device).autodiff();
    SirenCase {
        siren: seeded(11, |start| ModulatedSiren::new(sizes, start)),
        coordinates: tensor(packing.rows(), 3, 0.8, 1).require_grad(),
        vertex: tensor(packing.rows(), 7, 2.0, 2).require_grad(),
        garment: tensor(packing.count(), 5, 2.0, 3).require_grad(),
        packing,
    }
}

impl SirenCase {
    fn split(&self) -> Tensor<2> {
        self.of(&self.siren)
    }

    fn of(&self, siren: &ModulatedSiren) -> Tensor<2> {
        let product = siren.modulator.vertex_product(self.vertex.clone());
        siren.forward(self.coordinates.clone(), product, self.garment.clone(), &self.packing)
    }

    fn layer_by_layer(&self) -> Tensor<2> {
        let modulator = &self.siren.modulator;
        let (product, rows) =
            (modulator.vertex_product(self.vertex.clone()), modulator.rows(self.garment.clone()));
        self.siren.layer_by_layer(self.coordinates.clone(), product, rows, &self.packing)
    }

    /// The network as published: [previous gate, garment row, vertex row] concatenated and multiplied with whole weights.
    fn concatenated(&self) -> Tensor<2> {
        let modulator = &self.siren.modulator;
        let rows = broadcast(self.garment.clone(), &self.packing);
        let latent = Tensor::cat(vec![rows, self.vertex.clone()], 1);
        let mut gate: Option<Tensor<2>> = None;
        let mut features = self.coordinates.clone();
        for (layer, sine) in self.siren.sine.iter().enumerate() {
            let block = |weight: Tensor<2>| weight.narrow(1, layer * SIZES.width, SIZES.width);
            let mut weight = vec![block(modulator.garment.val()), block(modulator.vertex.val())];
            let mut input = vec![latent.clone()];
            if let Some(previous) = gate {
                weight.insert(0, modulator.hidden[layer - 1].val());
                input.insert(0, previous);
            }
            let sum = Tensor::cat(input, 1).matmul(Tensor::cat(weight, 0))
                + block(modulator.bias.val().unsqueeze());
            let opened = burn::tensor::activation::relu(sum);
            let omega = if layer == 0 { SIZES.omega_first } else { SIZES.omega_hidden };
            let phase = features.matmul(sine.weight.val()) + sine.bias.val().unsqueeze();
            features = (phase * omega).sin() * opened.clone();
            gate = Some(opened);
        }
        let output = &self.siren.output;
        features.matmul(output.weight.val()) + output.bias.val().unsqueeze()
    }
}

#[test]
fn split_latents_equal_the_concatenated_form_in_values_and_gradients() {
    let case = case();
    let (split, concatenated) = (case.split(), case.concatenated());
    assert_close(&split.clone().inner(), &concatenated.clone().inner(), 1e-5);
    let split = parameter_gradients(&case.siren, loss(split));
    let concatenated = parameter_gradients(&case.siren, loss(concatenated));
    assert!(concatenated.iter().all(|(_, gradient)| !gradient.is_empty()));
    assert_gradients_close(&split, &concatenated, 1e-5);
}

/// Widths that no vector divides, several blocks of rows per garment, several parts of the sums.
#[test]
fn the_fused_form_equals_the_layers_one_by_one_in_values_and_gradients_for_any_number_of_threads() {
    for (width, layers, rows) in [(10, 2, vec![20, 33, 7]), (64, 6, vec![400, 1500, 1]), (130, 3, vec![97])] {
        let case = case_of(&SirenSizes { width, layers, ..SIZES }, Packing::new(rows));
        let gradients = |output: Tensor<2>| {
            let all = loss(output).backward();
            [&case.coordinates, &case.vertex, &case.garment].map(|input| {
                let gradient = input.grad(&all).expect("a gradient");
                values(&gradient)
            })
        };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let output = case.split();
                let parameters = parameter_gradients(&case.siren, loss(output.clone()));
                (values(&output), parameters, gradients(case.split()))
            })
        };
        let (fused, plain) = (case.split(), case.layer_by_layer());
        assert_close(&fused.clone().inner(), &plain.clone().inner(), 1e-5);
        let (fused, plain) = (gradients(fused), gradients(plain));
        for (input, (fused, plain)) in fused.iter().zip(&plain).enumerate() {
            let scale = plain.iter().fold(0.0_f32, |scale, value| scale.max(value.abs()));
            let worst = fused.iter().zip(plain).fold(0.0_f32, |worst, (a, b)| worst.max((a - b).abs()));
            assert!(worst <= 1e-5 * scale, "input {input} at width {width}: {worst:e} of {scale:e}");
        }
        let fused = parameter_gradients(&case.siren, loss(case.split()));
        let plain = parameter_gradients(&case.siren, loss(case.layer_by_layer()));
        assert_gradients_close(&fused, &plain, 1e-5);
        let one = run(1);
        for threads in [2, 4] {
            assert!(one == run(threads), "width {width} on {threads} threads");
        }
    }
}

#[test]
fn gradients_match_finite_differences() {
    let case = case();
    let parameters = [
        "modulator.vertex",
        "modulator.garment",
        "modulator.bias",
        "modulator.hidden.1",
        "sine.0.weight",
        "sine.2.bias",
        "output.weight",
    ];
    // Short enough to cross few of the gates' kinks.
    let steps = [2.5e-4];
    assert_gradients_match_differences(&case.siren, &parameters, &steps, 2e-2, |siren| case.of(siren));
}

#[test]
fn weights_start_within_the_bounds_of_the_concatenated_layers() {
    let siren = case().siren.valid();
    let width = SIZES.width;
    let largest = |weight: Tensor<2>| {
        values(&weight).into_iter().fold(0.0f32, |largest, value| largest.max(value.abs()))
    };
    let of_layer = |weight: &Tensor<2>, layer: usize| largest(weight.clone().narrow(1, layer * width, width));
    let latent = (SIZES.garment_latent + SIZES.vertex_latent) as f32;
    let (first, later) = (1.0 / latent.sqrt(), 1.0 / (latent + width as f32).sqrt());
    for weight in [siren.modulator.vertex.val(), siren.modulator.garment.val()] {
        assert!((0.8 * first..=first).contains(&of_layer(&weight, 0)));
        assert!((0.8 * later..=later).contains(&of_layer(&weight, 2)));
    }
    assert!((0.25..=1.0 / 3.0).contains(&largest(siren.sine[0].weight.val())));
    let hidden = (6.0 / width as f32).sqrt();
    assert!((0.9 * hidden..=hidden).contains(&largest(siren.sine[1].weight.val())));
}
