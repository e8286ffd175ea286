use super::*;
use crate::testing::{
    HostGarment, assert_close, assert_gradients_close, change_parameter, device, parameter_gradients,
    uniform, values, weighting,
};
use crate::{Dimensions, GarmentTensors, Initializer, ModelConfig, ModelError};
use burn::module::{Module, ModuleVisitor, Param};

mod switches;

const DIMENSIONS: Dimensions = Dimensions { joints: 5, shape: 4, pose: 6 };

fn config() -> ModelConfig {
    ModelConfig {
        width: 12,
        embedding: 10,
        diffusion_blocks: 2,
        diffusion_width: 8,
        eigen_count: 9,
        siren_layers: 3,
        siren_width: 14,
        skinning_width: 11,
        // Large, so that every network shows in the output.
        displacement_scale: 1.0,
        untangling_scale: 1.0,
        skinning_scale: 0.5,
        ..ModelConfig::default()
    }
}

struct Scene {
    model: ClothCombo,
    garments: Vec<GarmentTensors>,
    outfit: OutfitTensors,
    body: BodyTensors,
}

fn bones(shift: f64) -> Vec<[[f64; 4]; 3]> {
    (0..DIMENSIONS.joints)
        .map(|joint| {
            let (sine, cosine) = (0.3 * joint as f64 + shift).sin_cos();
            [[cosine, -sine, 0.0, 0.1], [sine, cosine, 0.0, 0.05 * joint as f64], [0.0, 0.0, 1.0, -0.2]]
        })
        .collect()
}

fn body(shift: f64) -> BodyTensors {
    let shape: Vec<f32> = (0..DIMENSIONS.shape).map(|i| i as f32 - 1.5 + shift as f32).collect();
    let pose: Vec<f32> = (0..DIMENSIONS.pose).map(|i| 0.2 * i as f32 - 0.5 + shift as f32).collect();
    BodyTensors::new(&shape, &pose, &bones(shift), &[0.1; 30 * DIMENSIONS.joints], &DIMENSIONS, &device())
        .expect("valid body")
}

fn model(seed: u64) -> ClothCombo {
    ClothCombo::new(&config(), &DIMENSIONS, seed, &device()).expect("valid sizes")
}

fn scene(contacts: &[(usize, usize)]) -> Scene {
    let device = device();
    let used =
        [[true, true, false, true, false], [true, true, true, true, true], [false, true, false, false, true]];
    let garments: Vec<GarmentTensors> = used
        .iter()
        .zip([41, 30, 55])
        .enumerate()
        .map(|(index, (used, vertices))| {
            HostGarment::random(vertices, 9, used, index as u64).tensors(&device)
        })
        .collect();
    let outfit = OutfitTensors::new(&garments.iter().collect::<Vec<_>>(), contacts).expect("valid outfit");
    Scene { model: model(3), garments, outfit, body: body(0.0) }
}

impl Scene {
    fn embeddings(&self, model: &ClothCombo) -> Embeddings {
        let garments: Vec<_> = self.garments.iter().map(|garment| model.encode(garment)).collect();
        model.pack(&self.outfit, &garments, Mode::Layered).expect("matching embeddings")
    }

    fn drape(&self, model: &ClothCombo) -> DrapeStates {
        self.drape_on(model, &self.embeddings(model), &self.body)
    }

    fn drape_on(&self, model: &ClothCombo, embeddings: &Embeddings, body: &BodyTensors) -> DrapeStates {
        model.forward(&self.outfit, embeddings, body, self.outfit.rest.clone(), Mode::Layered)
    }

    fn loss(&self, model: &ClothCombo) -> Tensor<1> {
        loss(self.drape(model).last().posed.clone())
    }
}

fn loss(positions: Tensor<2>) -> Tensor<1> {
    let weights = weighting(positions.dims(), &positions.device());
    (positions * weights).sum()
}

#[test]
fn every_parameter_gets_a_gradient_and_it_matches_finite_differences() {
    let scene = scene(&OutfitTensors::all_pairs(3));
    let gradients = parameter_gradients(&scene.model, scene.loss(&scene.model));
    for (name, gradient) in &gradients {
        assert!(gradient.iter().any(|value| *value != 0.0), "{name} has no gradient");
        assert!(gradient.iter().all(|value| value.is_finite()), "{name}");
    }
    let parameters = [
        "garment_encoder.diffusion_net.last.weight",
        "draping.embedding.hidden.3.weight",
        "draping.displacement.modulator.garment",
        "skinning.coordinate",
        "skinning.output.bias",
        "untangling.force.first.weight",
        "untangling.displacement.modulator.vertex",
        "untangling.displacement.output.weight",
    ];
    for name in parameters {
        let (_, gradient) = gradients.iter().find(|(found, _)| found == name).expect("documented name");
        let index = (0..gradient.len()).max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()));
        let index = index.expect("not empty");
        let value = |change: f32| -> f64 {
            let changed = change_parameter(scene.model.clone(), name, index, change).valid();
            let posed = scene.drape(&changed).last().posed.clone();
            let weights = values(&weighting(posed.dims(), &posed.device()));
            values(&posed).iter().zip(weights).map(|(p, w)| f64::from(*p) * f64::from(w)).sum()
        };
        // Short steps lose digits of f32, long ones cross kinks of the gates: one of them must fit.
        let found = f64::from(gradient[index]);
        let slope = |step: f32| (value(step) - value(-step)) / f64::from(2.0 * step);
        let slopes = [1e-4, 5e-4, 2e-3].map(slope);
        let fits = slopes.iter().any(|slope| (slope - found).abs() < 2e-2 * found.abs());
        assert!(fits, "{name}[{index}]: {found} {slopes:?}");
    }
}

#[test]
fn a_packed_outfit_drapes_as_its_single_garments() {
    let scene = scene(&[]);
    let model = scene.model.valid();
    let packed = scene.drape(&model);
    for (garment, range) in scene.garments.iter().zip(scene.outfit.ranges()) {
        let outfit = OutfitTensors::new(&[garment], &[]).expect("one garment");
        let embeddings =
            model.pack(&outfit, &[model.encode(garment)], Mode::Single).expect("matching embeddings");
        let by_itself = model.forward(&outfit, &embeddings, &scene.body, outfit.rest.clone(), Mode::Single);
        let rows = |packed: &Tensor<2>| packed.clone().narrow(0, range.start, range.len());
        assert_close(&rows(&packed.single.posed), &by_itself.single.posed, 1e-5);
        assert_close(&rows(&packed.single.canonical), &by_itself.single.canonical, 1e-5);
        assert_close(&rows(&packed.skin_weights), &by_itself.skin_weights, 1e-5);
    }
}

#[test]
fn a_layered_pass_needs_no_embeddings_that_were_packed_for_it() {
    let scene = scene(&OutfitTensors::all_pairs(3));
    let model = scene.model.valid();
    let garments: Vec<_> = scene.garments.iter().map(|garment| model.encode(garment)).collect();
    let single = model.pack(&scene.outfit, &garments, Mode::Single).expect("matching embeddings");
    assert!(single.untangling_product.is_none());
    let [found, expected] =
        [single, scene.embeddings(&model)].map(|embeddings| scene.drape_on(&model, &embeddings, &scene.body));
    assert_eq!(values(&found.last().posed), values(&expected.last().posed));
}

#[test]
fn skin_weights_sum_to_one_and_stay_on_each_garments_joints() {
    let scene = scene(&[]);
    let skin_weights = scene.drape(&scene.model.valid()).skin_weights;
    let sums = skin_weights.clone().sum_dim(1);
    assert_close(&sums, &sums.ones_like(), 1e-5);
    for (garment, range) in scene.garments.iter().zip(scene.outfit.ranges()) {
        let weights = skin_weights.clone().narrow(0, range.start, range.len());
        let outside = weights.clone() * (garment.joint_mask.clone() * -1.0 + 1.0);
        assert_eq!(values(&outside).iter().filter(|value| **value != 0.0).count(), 0);
        let moved = weights - garment.skin_weights.clone();
        assert!(values(&moved).iter().any(|value| value.abs() > 1e-3), "the correction does nothing");
    }
}

#[test]
fn garments_that_touch_nothing_do_not_move_and_others_do() {
    let scene = scene(&[(0, 2)]);
    let states = scene.drape(&scene.model.valid());
    let moved = values(&(states.last().canonical.clone() - states.single.canonical));
    let ranges = scene.outfit.ranges();
    let of = |garment: usize| &moved[3 * ranges[garment].start..3 * ranges[garment].end];
    assert!(of(1).iter().all(|value| *value == 0.0));
    assert!(of(0).iter().any(|value| value.abs() > 1e-5) && of(2).iter().any(|value| value.abs() > 1e-5));
}

#[test]
fn without_contact_the_single_drape_is_the_last_state_and_untangling_gets_no_gradient() {
    let scene = scene(&[]);
    let states = scene.drape(&scene.model);
    assert!(states.layered.is_none());
    let gradients = parameter_gradients(&scene.model, loss(states.last().posed.clone()));
    for (name, gradient) in gradients {
        assert_eq!(gradient.is_empty(), name.starts_with("untangling"), "{name}");
    }
}

/// The force sums by loops over ordered pairs.
#[test]
fn forces_follow_the_layer_order() {
    let scene = scene(&[(0, 1), (2, 1)]);
    let model = scene.model.valid();
    let states = scene.drape(&model);
    let embedding = |garment: usize| states.draping_embedding.clone().narrow(0, garment, 1);
    let force =
        |i: usize, j: usize| model.untangling.force.forward(Tensor::cat(vec![embedding(i), embedding(j)], 1));
    let zero = || embedding(0).zeros_like();
    let latent = Tensor::cat(
        vec![
            Tensor::cat(vec![zero(), force(0, 1), embedding(0)], 1),
            Tensor::cat(vec![force(1, 0), force(1, 2), embedding(1)], 1),
            Tensor::cat(vec![force(2, 1), zero(), embedding(2)], 1),
        ],
        0,
    );
    let embeddings = scene.embeddings(&model);
    let product = model.untangling.vertex_product(embeddings.vertex);
    let single = states.single.canonical.clone();
    let displacement =
        model.untangling.displacement.forward(single.clone(), product, latent, &scene.outfit.packing);
    assert_close(&states.last().canonical, &(single + displacement * config().untangling_scale), 1e-5);
}

#[test]
fn a_frozen_first_stage_trains_the_untangling_alone_with_the_same_gradient() {
    let scene = scene(&OutfitTensors::all_pairs(3));
    let expected = parameter_gradients(&scene.model.untangling, scene.loss(&scene.model));
    let frozen = ClothCombo { untangling: scene.model.untangling.clone(), ..scene.model.valid() };
    let found = parameter_gradients(&scene.model.untangling, scene.loss(&frozen));
    assert_gradients_close(&found, &expected, 1e-5);
}

#[test]
fn scenes_that_share_embeddings_add_up() {
    let scene = scene(&OutfitTensors::all_pairs(3));
    let bodies = [body(0.0), body(0.4)];
    let drape = |embeddings: &Embeddings, body: &BodyTensors| {
        loss(scene.drape_on(&scene.model, embeddings, body).last().posed.clone())
    };
    let shared = scene.embeddings(&scene.model);
    let together = drape(&shared, &bodies[0]) + drape(&shared, &bodies[1]);
    let together = parameter_gradients(&scene.model, together);
    let apart =
        bodies.map(|body| parameter_gradients(&scene.model, drape(&scene.embeddings(&scene.model), &body)));
    let [first, second] = apart;
    let sum: Vec<_> = first
        .into_iter()
        .zip(second)
        .map(|((name, a), (_, b))| (name, a.iter().zip(&b).map(|(a, b)| a + b).collect()))
        .collect();
    assert_gradients_close(&together, &sum, 2e-5);
}

#[test]
fn the_seed_fixes_every_weight_whatever_draws_beside() {
    let make = |seed: u64| weights(&model(seed));
    let first = make(7);
    device().seed(1);
    assert_eq!(first, make(7), "burn's own generator has no part in it");
    let beside: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| make(7))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert!(beside.iter().all(|weights| *weights == first));
    assert_ne!(first, make(8));
}

fn weights(model: &ClothCombo) -> Vec<Vec<f32>> {
    struct Collect(Vec<Vec<f32>>);
    impl ModuleVisitor for Collect {
        fn visit_float<const D: usize>(&mut self, parameter: &Param<Tensor<D>>) {
            self.0.push(parameter.val().into_data().try_to_vec().expect("f32"));
        }
    }
    let mut collect = Collect(Vec::new());
    model.visit(&mut collect);
    collect.0
}

#[test]
fn clamping_keeps_parameter_identities_and_gradients() {
    let model = model(4);
    let name = "garment_encoder.diffusion_net.blocks.0.diffusion.time";
    let model = change_parameter(model, name, 1, -0.5);
    let before = model.garment_encoder.diffusion_net.blocks[0].diffusion.time.id;
    let model = model.clamp_diffusion_times();
    let time = &model.garment_encoder.diffusion_net.blocks[0].diffusion.time;
    assert_eq!(time.id, before);
    assert!(time.val().is_require_grad());
    let time: Vec<f32> = time.val().into_data().try_to_vec().expect("f32");
    assert_eq!(time, vec![1e-8; time.len()]);
}

#[test]
fn skinning_with_identity_and_with_one_rigid_transform() {
    let device = device().inner();
    let points = uniform(20, 3, 1.0, 1, &device);
    let weights = uniform(20, 3, 0.45, 2, &device) + 0.55;
    let weights = weights.clone() / weights.sum_dim(1);
    let repeat = |bone: [f32; 12]| Tensor::<2>::from_floats([bone, bone, bone], &device);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    assert_close(&linear_blend_skinning(points.clone(), weights.clone(), repeat(identity)), &points, 1e-6);
    // A quarter turn about z and a shift.
    let turn = [0.0, -1.0, 0.0, 0.5, 1.0, 0.0, 0.0, -0.25, 0.0, 0.0, 1.0, 2.0];
    let found = values(&linear_blend_skinning(points.clone(), weights, repeat(turn)));
    for (found, point) in found.chunks_exact(3).zip(values(&points).chunks_exact(3)) {
        let expected = [0.5 - point[1], point[0] - 0.25, point[2] + 2.0];
        for axis in 0..3 {
            assert!((found[axis] - expected[axis]).abs() < 1e-5);
        }
    }
}

#[test]
fn wrong_sizes_are_named() {
    let device = device();
    let host = HostGarment::random(8, 4, &[true, true], 0);
    let mut arrays = host.arrays();
    arrays.rest = &arrays.rest[..3];
    let error = GarmentTensors::new(&arrays, 2, &device).expect_err("too short");
    assert_eq!(error.to_string(), "rest positions has 3 elements, expected 24 ([V,3], V = number of masses)");

    let mut bad = vec![0.0f32; 24];
    bad[5] = f32::NAN;
    let mut arrays = host.arrays();
    arrays.rest = &bad;
    let error = GarmentTensors::new(&arrays, 2, &device).expect_err("NaN");
    assert!(matches!(error, ModelError::NotFinite { array: "rest positions", index: 5, .. }));

    let mut arrays = host.arrays();
    let massless = vec![0.0; 8];
    arrays.mass = &massless;
    assert!(matches!(GarmentTensors::new(&arrays, 2, &device), Err(ModelError::NoMass { .. })));

    assert!(matches!(OutfitTensors::new(&[], &[]), Err(ModelError::Outfit { .. })));
    let garment = host.tensors(&device);
    assert!(matches!(OutfitTensors::new(&[&garment], &[(0, 1)]), Err(ModelError::Outfit { garment: 1, .. })));
    assert!(matches!(OutfitTensors::new(&[&garment], &[(0, 0)]), Err(ModelError::Outfit { .. })));
    assert!(
        BodyTensors::new(
            &[0.0; 3],
            &[0.0; 6],
            &bones(0.0),
            &[0.1; 30 * DIMENSIONS.joints],
            &DIMENSIONS,
            &device
        )
        .is_err()
    );
    let config = ModelConfig { width: 0, ..config() };
    assert!(matches!(
        ClothCombo::new(&config, &DIMENSIONS, 0, &device),
        Err(ModelError::Config { key: "width", .. })
    ));
}

/// Contact features: irregular, and by the positions.
fn features(posed: &Tensor<2>) -> ContactFeatureTensors {
    let (rows, device) = (posed.dims()[0], posed.device());
    let positions = values(posed);
    let directions: [Vec<[f32; 3]>; ContactFeatureTensors::DIRECTIONS] = std::array::from_fn(|k| {
        let values = values(&uniform(rows, 3, 1.0, 11 + k as u64, &device));
        values.as_chunks::<3>().0.to_vec()
    });
    let mut features = values(&uniform(rows, ContactFeatureTensors::FEATURES, 2.0, 30, &device));
    for (row, position) in
        features.chunks_exact_mut(ContactFeatureTensors::FEATURES).zip(positions.chunks_exact(3))
    {
        row[0] = position[0].clamp(-5.0, 5.0);
    }
    ContactFeatureTensors::new(features, directions.each_ref().map(Vec::as_slice), &device)
        .expect("equal rows")
}

/// A scene whose model has two correction networks; their output layers start at zero or, `trained`, with other numbers.
fn scene_with_corrections(trained: bool) -> Scene {
    let mut scene = scene(&OutfitTensors::all_pairs(3));
    let config = ModelConfig { corrections: 2, correction_width: 7, ..config() };
    scene.model = scene.model.with_corrections(&config, &mut Initializer::new(5, &device()));
    if trained {
        for (seed, correction) in (8..).zip(&mut scene.model.corrections) {
            let [rows, columns] = correction.output.weight.dims();
            let weight = uniform(rows, columns, 0.5, seed, &device());
            correction.output.weight = Param::from_tensor(Tensor::from_inner(weight).require_grad());
        }
    }
    scene
}

impl Scene {
    /// The drape with every correction network's step.
    fn corrected(&self, model: &ClothCombo, embeddings: &Embeddings) -> DrapeStates {
        let mut states = self.drape_on(model, embeddings, &self.body);
        for _ in 0..model.corrections.len() {
            let features = features(&states.last().posed.clone().detach());
            model.correct(&self.outfit, embeddings, &self.body, &mut states, features);
        }
        states
    }
}

#[test]
fn untrained_corrections_correct_nothing() {
    let scene = scene_with_corrections(false);
    let states = scene.corrected(&scene.model, &scene.embeddings(&scene.model));
    let layered = states.layered.expect("three garments that can touch");
    assert_eq!(states.corrected.len(), 2);
    for state in states.corrected {
        assert_close(&state.canonical, &layered.canonical, 1e-6);
        assert_close(&state.posed, &layered.posed, 1e-6);
    }
}

#[test]
fn correction_networks_take_turns_from_the_last_state() {
    let scene = scene_with_corrections(true);
    let model = scene.model.valid();
    let embeddings = scene.embeddings(&model);
    let step = |states: &mut DrapeStates| {
        let features = features(&states.last().posed);
        model.correct(&scene.outfit, &embeddings, &scene.body, states, features);
        values(&states.last().posed)
    };
    let mut states = scene.drape_on(&model, &embeddings, &scene.body);
    let first = step(&mut states);
    let (second, of_first) = (step(&mut states), states.corrected[0].clone());
    assert!(second != first);
    // The third step is the first network's again, from wherever the state was put.
    states.replace_last(states.layered.clone().expect("three garments that can touch"));
    assert_eq!(step(&mut states), first);
    states.replace_last(of_first);
    assert_eq!(step(&mut states), second);
}

#[test]
fn a_correction_has_its_own_gradient_and_gives_nothing_back() {
    let scene = scene_with_corrections(true);
    let state = |model: &ClothCombo, k: usize| {
        scene.corrected(model, &scene.embeddings(model)).corrected.swap_remove(k)
    };
    for k in [0, 1] {
        let gradients = parameter_gradients(&scene.model, loss(state(&scene.model, k).posed));
        for (name, gradient) in &gradients {
            if !name.starts_with(&format!("corrections.{k}.")) {
                assert!(gradient.iter().all(|g| *g == 0.0), "{name} has a gradient from correction {k}");
                continue;
            }
            let index = (0..gradient.len()).max_by(|&a, &b| gradient[a].abs().total_cmp(&gradient[b].abs()));
            let index = index.expect("not empty");
            let value = |change: f32| -> f64 {
                let changed = change_parameter(scene.model.clone(), name, index, change).valid();
                let posed = state(&changed, k).posed;
                let weights = values(&weighting(posed.dims(), &posed.device()));
                values(&posed).iter().zip(weights).map(|(p, w)| f64::from(*p) * f64::from(w)).sum()
            };
            let found = f64::from(gradient[index]);
            // Short steps lose digits of f32, long ones curve: one of them must fit.
            let slopes = [2e-3, 1e-2, 5e-2].map(|step| (value(step) - value(-step)) / f64::from(2.0 * step));
            let fits = slopes.iter().any(|slope| (slope - found).abs() < 2e-2 * found.abs());
            assert!(found != 0.0 && fits, "{name}: {found} {slopes:?}");
        }
    }
}

#[test]
fn contact_features_have_one_row_per_vertex() {
    let directions = [[0.0; 3]; 4];
    let wrong = ContactFeatureTensors::new(
        vec![0.0; 3],
        [directions.as_slice(); ContactFeatureTensors::DIRECTIONS],
        &device(),
    );
    assert!(matches!(wrong, Err(ModelError::Length { array: "contact features", .. })));
}
