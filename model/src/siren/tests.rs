use super::*;
use crate::ops::tensor_form;
use crate::testing::{
    assert_close, assert_gradients_close, change_parameter, device, parameter_gradients, seeded, uniform,
    weighting,
};

const SIZES: SirenSizes = SirenSizes {
    layers: 4,
    width: 10,
    garment_latent: 5,
    vertex_latent: 7,
    omega_first: 30.0,
    omega_hidden: 1.0,
};

/// Small enough to cross few of the gates' kinks.
const STEP: f32 = 2.5e-4;

struct Case {
    siren: ModulatedSiren,
    coordinates: Tensor<2>,
    vertex: Tensor<2>,
    garment: Tensor<2>,
    segments: Segments,
}

fn case() -> Case {
    let device = device();
    Case {
        siren: seeded(11, |start| ModulatedSiren::new(&SIZES, start)),
        coordinates: uniform(60, 3, 0.8, 1, &device),
        vertex: uniform(60, 7, 2.0, 2, &device),
        garment: uniform(3, 5, 2.0, 3, &device),
        segments: Segments::new([20, 33, 7]),
    }
}

impl Case {
    fn split(&self) -> Tensor<2> {
        self.of(&self.siren)
    }

    fn of(&self, siren: &ModulatedSiren) -> Tensor<2> {
        let product = siren.modulator.vertex_product(self.vertex.clone());
        siren.forward(self.coordinates.clone(), product, self.garment.clone(), &self.segments)
    }

    /// The network as published: [previous gate, garment row, vertex row] concatenated and multiplied with whole weights.
    fn concatenated(&self) -> Tensor<2> {
        let modulator = &self.siren.modulator;
        let rows = tensor_form::broadcast(self.garment.clone(), &self.segments);
        let latent = Tensor::cat(vec![rows, self.vertex.clone()], 1);
        let mut gate: Option<Tensor<2>> = None;
        let mut features = self.coordinates.clone();
        for (layer, sine) in self.siren.sine.iter().enumerate() {
            let columns = layer * SIZES.width..(layer + 1) * SIZES.width;
            let block = |weight: Tensor<2>| {
                let rows = weight.dims()[0];
                weight.slice([0..rows, columns.clone()])
            };
            let mut weight = vec![block(modulator.garment.val()), block(modulator.vertex.val())];
            let mut input = vec![latent.clone()];
            if let Some(previous) = gate {
                weight.insert(0, modulator.hidden[layer - 1].val());
                input.insert(0, previous);
            }
            let bias: Tensor<2> = modulator.bias.val().slice([columns.clone()]).unsqueeze();
            let sum = Tensor::cat(input, 1).matmul(Tensor::cat(weight, 0)) + bias;
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

fn loss(output: Tensor<2>) -> Tensor<1> {
    let weights = weighting(output.dims(), &output.device());
    (output * weights).sum()
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

#[test]
fn gradients_match_finite_differences() {
    let case = case();
    let gradients = parameter_gradients(&case.siren, loss(case.split()));
    let parameters = [
        "modulator.vertex",
        "modulator.garment",
        "modulator.bias",
        "modulator.hidden.1",
        "sine.0.weight",
        "sine.2.bias",
        "output.weight",
    ];
    for name in parameters {
        let (_, gradient) = gradients.iter().find(|(found, _)| found == name).expect("documented name");
        let index = (0..gradient.len()).max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()));
        let index = index.expect("not empty");
        let value = |change: f32| -> f64 {
            let changed = change_parameter(case.siren.clone(), name, index, change).valid();
            f64::from(loss(case.of(&changed)).into_scalar::<f32>())
        };
        let slope = (value(STEP) - value(-STEP)) / f64::from(2.0 * STEP);
        let found = f64::from(gradient[index]);
        assert!((slope - found).abs() < 2e-2 * found.abs(), "{name}[{index}]: {found} {slope}");
    }
}

#[test]
fn weights_start_within_the_bounds_of_the_concatenated_layers() {
    let siren = case().siren.valid();
    let width = SIZES.width;
    let columns = |weight: &Tensor<2>, block: usize| {
        let rows = weight.dims()[0];
        let block = weight.clone().slice([0..rows, block * width..(block + 1) * width]);
        crate::testing::values(&block).into_iter().fold(0.0f32, |largest, value| largest.max(value.abs()))
    };
    let latent = (SIZES.garment_latent + SIZES.vertex_latent) as f32;
    let (first, later) = (1.0 / latent.sqrt(), 1.0 / (latent + width as f32).sqrt());
    for weight in [siren.modulator.vertex.val(), siren.modulator.garment.val()] {
        assert!((0.8 * first..=first).contains(&columns(&weight, 0)));
        assert!((0.8 * later..=later).contains(&columns(&weight, 2)));
    }
    let largest = |weight: Tensor<2>| {
        crate::testing::values(&weight).into_iter().fold(0.0f32, |largest, value| largest.max(value.abs()))
    };
    assert!((0.25..=1.0 / 3.0).contains(&largest(siren.sine[0].weight.val())));
    let hidden = (6.0 / width as f32).sqrt();
    assert!((0.9 * hidden..=hidden).contains(&largest(siren.sine[1].weight.val())));
}
