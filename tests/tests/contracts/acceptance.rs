//! What becomes of what the networks propose: no outfit ends above skinning.

use burn::module::{Module, Param};
use clothcombo_model::ClothCombo;
use clothcombo_tests::Untrained;
use clothcombo_trainer::dataset::{SceneSample, prepare};
use clothcombo_trainer::inference::descent::Descent;
use clothcombo_trainer::inference::networks::Networks;
use std::sync::Arc;

/// The model with networks that know nothing and move everything, by several centimetres.
fn wild(mut model: ClothCombo) -> ClothCombo {
    let outputs = [&mut model.draping.displacement.output, &mut model.untangling.displacement.output];
    for output in outputs {
        let bias = output.bias.val();
        output.bias = Param::from_tensor((bias + 0.7).detach());
    }
    model
}

#[test]
fn no_state_raises_the_energy_of_a_garment_and_all_outfits_end_below_skinning() {
    let folder = tempfile::tempdir().unwrap();
    let run = Untrained::new(folder.path(), &[]);
    let mut moved = 0;
    for (name, model) in [("untrained", run.model.clone()), ("wild", wild(run.model.clone()))] {
        let networks = Networks::new(model.valid(), &run.tensors);
        for step in 20..44 {
            let scene = run.scenes(step).remove(0);
            let energy = scene.bodies[0].energy.as_ref().clone().continuous();
            let energy = energy.pulled_back(&scene.skinning_transforms());
            let skinnings = [networks.skin(&scene), networks.skin_rest(&scene)].map(Result::unwrap);
            let totals = skinnings.each_ref().map(|state| Descent::new(&energy, state.clone()).total());
            // It begins with the better of two ways to skin.
            let start = Descent::from_best(&energy, skinnings);
            let drape = Descent::new(&energy, networks.drape(&scene).unwrap());
            let [before, after] = [&start, &drape].map(|state| state.energies());
            assert!(
                after.iter().zip(before).all(|(after, before)| after <= before),
                "{name} {before:?} {after:?}"
            );
            moved += usize::from(after != before);
            assert!(totals.iter().all(|total| drape.total() <= *total), "{name} {totals:?}");
        }
    }
    assert!(moved > 20, "{moved}");
}

#[test]
fn a_garment_drapes_in_an_outfit_that_it_does_not_touch_as_a_single_garment_does() {
    let folder = tempfile::tempdir().unwrap();
    let run = Untrained::new(folder.path(), &[]);
    let scene = run.scenes(run.step_with_contacts(20)).remove(0);
    let networks = Networks::new(wild(run.model.clone()).valid(), &run.tensors);
    let outfit = |garments: &[usize]| {
        let sample = SceneSample { garments: garments.to_vec(), ..scene.sample.clone() };
        let mut scene = prepare(&run.dataset, &run.config.losses, sample, 1.0).unwrap();
        // Without an edge nothing presses and nothing is judged together.
        scene.contacts.clear();
        let apart = scene.bodies[0].energy.without_layers();
        scene.bodies[0].energy = Arc::new(apart);
        scene
    };
    let pair = &scene.sample.garments[..2];
    let together = networks.drape(&outfit(pair)).unwrap();
    let rows = run.dataset.garments.garment(pair[0]).unwrap().vertex_count();
    for (garment, rows) in pair.iter().zip([0..rows, rows..together.posed.len()]) {
        let single = networks.drape(&outfit(&[*garment])).unwrap();
        let largest = |a: &[[f32; 3]], b: &[[f32; 3]]| {
            let pairs = a.as_flattened().iter().zip(b.as_flattened());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(largest(&single.posed, &together.posed[rows]) < 1e-5);
    }
}
