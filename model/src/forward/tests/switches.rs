//! The switches of [`ModelConfig`] between this project's form and the paper's.

use super::*;
use crate::config::{Graph, SkinningJoints};

/// The scene of `contacts` with the same parameters under another configuration.
fn scene_with(contacts: &[(usize, usize)], change: impl FnOnce(&mut ModelConfig)) -> Scene {
    let mut config = config();
    change(&mut config);
    let mut scene = scene(contacts);
    scene.model = ClothCombo::new(&config, &DIMENSIONS, 3, &device()).expect("valid sizes");
    scene
}

fn full(contacts: &[(usize, usize)]) -> Scene {
    scene_with(contacts, |config| config.graph = Graph::Full)
}

#[test]
fn the_full_graph_connects_garments_without_contact() {
    let near = scene(&OutfitTensors::all_pairs(3)).drape(&model(3).valid());
    for contacts in [&[][..], &[(0, 2)]] {
        let scene = full(contacts);
        let found = scene.drape(&scene.model.valid());
        assert_eq!(values(&found.last().posed), values(&near.last().posed));
        let moved = values(&(found.last().canonical.clone() - found.single.canonical));
        for range in scene.outfit.ranges() {
            let of = &moved[3 * range.start..3 * range.end];
            assert!(of.iter().any(|value| value.abs() > 1e-5), "a garment stays where it is");
        }
        assert!(scene.embeddings(&scene.model).untangling_product.is_some());
    }
}

/// D_m with the concatenated latent [0, 0, z_s], z_v.
#[test]
fn the_full_graph_displaces_a_single_garment_without_force() {
    let outfit_of = |scene: Scene| {
        let garment = scene.garments[0].clone();
        let outfit = OutfitTensors::new(&[&garment], &[]).expect("one garment");
        Scene { garments: vec![garment], outfit, ..scene }
    };
    let scene = outfit_of(full(&[]));
    let model = scene.model.valid();
    let found = scene.drape(&model);
    let single = found.single.canonical.clone();
    let zero = found.draping_embedding.zeros_like();
    let latent = Tensor::cat(vec![zero.clone(), zero, found.draping_embedding.clone()], 1);
    let displacement = model.untangling.displacement.forward(
        single.clone(),
        model.untangling.vertex_product(scene.embeddings(&model).vertex),
        latent,
        &scene.outfit.packing,
    );
    assert!(values(&displacement).iter().any(|value| value.abs() > 1e-5));
    let expected = single + displacement * config().untangling_scale;
    assert_close(&found.last().canonical, &expected, 1e-6);

    // No edge, no force network; everything else of the untangling phase learns.
    let gradients = parameter_gradients(&scene.model, scene.loss(&scene.model));
    for (name, gradient) in gradients {
        assert_eq!(gradient.is_empty(), name.starts_with("untangling.force"), "{name}");
    }

    let near = outfit_of(super::scene(&[]));
    assert!(near.drape(&near.model.valid()).layered.is_none());
}

#[test]
fn skinning_on_all_joints_corrects_joints_that_the_garment_does_not_use() {
    for zero_sum in [false, true] {
        let with = |joints: SkinningJoints| {
            scene_with(&[], |config| {
                config.skinning_joints = joints;
                config.zero_sum_skinning = zero_sum;
            })
        };
        let scene = with(SkinningJoints::All);
        let found = scene.drape(&scene.model.valid()).skin_weights;
        let mut unmasked = with(SkinningJoints::Bound);
        unmasked.outfit.joint_mask = unmasked.outfit.joint_mask.ones_like();
        let expected = unmasked.drape(&unmasked.model.valid()).skin_weights;
        assert_eq!(values(&found), values(&expected));
        for (garment, range) in
            scene.garments.iter().zip(scene.outfit.ranges()).filter(|(_, r)| r.start != 41)
        {
            let weights = found.clone().narrow(0, range.start, range.len());
            let outside = weights * (garment.joint_mask.clone() * -1.0 + 1.0);
            assert!(values(&outside).iter().any(|value| value.abs() > 1e-3));
        }
        if zero_sum {
            let sums = found.sum_dim(1);
            assert_close(&sums, &sums.ones_like(), 1e-5);
        }
    }
}

/// The plain form: z̄_v written into every row of z_v.
#[test]
fn without_vertex_embedding_every_network_sees_the_garment_embedding_instead() {
    let contacts = OutfitTensors::all_pairs(3);
    let ablated = scene_with(&contacts, |config| config.vertex_embedding = false);
    let whole = super::scene(&contacts);

    let states = |scene: &Scene, embeddings: Embeddings| {
        let states = scene.drape_on(&scene.model, &embeddings, &scene.body);
        let layered = states.layered.expect("three garments that can touch").posed;
        [states.single.posed, states.skin_weights, layered]
    };
    let found = states(&ablated, ablated.embeddings(&ablated.model));
    let plain = whole.garments.iter().map(|garment| {
        let mut embedding = whole.model.encode(garment);
        embedding.vertex = embedding.garment.clone().repeat_dim(0, garment.vertex_count());
        embedding
    });
    let embeddings = whole
        .model
        .pack(&whole.outfit, &plain.collect::<Vec<_>>(), Mode::Layered)
        .expect("matching embeddings");
    let expected = states(&whole, embeddings);
    let with_vertex_embedding = states(&whole, whole.embeddings(&whole.model));
    for ((found, expected), other) in found.iter().zip(&expected).zip(with_vertex_embedding) {
        assert_close(&found.clone().inner(), &expected.clone().inner(), 1e-5);
        let difference = crate::testing::relative_difference(&found.clone().inner(), &other.inner());
        assert!(difference > 1e-4, "z_v changes nothing: {difference:e}");
    }
    let [found, expected] = [(&ablated, found), (&whole, expected)].map(|(scene, states)| {
        let sum = states.into_iter().map(loss).reduce(|a, b| a + b).expect("three states");
        parameter_gradients(&scene.model, sum)
    });
    assert_gradients_close(&found, &expected, 2e-5);
}
