//! What becomes of the networks' drape: from linear blend skinning over it and the correction steps to a state of less energy.
//!
//! Every state on the path is accepted garment by garment, as far as it lowers the energy
//! ([`crate::inference::descent`]), in the form that drapes are measured by ([`crate::inference::reference`]):
//!
//! 1. skinning by the initial weights W, of the start (with shape transfer) or of the rest garments: whichever has less energy;
//! 2. the networks' drape: Δx and ΔW together; where a garment does not take it, Δx with W, and then ΔW as far as it helps
//!    (networks that were trained with canonical holding slide waistbands by ΔW);
//! 3. the correction networks in turn, with the skin weights that every garment has by now, until no garment moves.
//!
//! So no outfit ends above either skinning, no garment above what it began with, and more steps never raise its energy: with no
//! correction step at all, too.

use super::contact_features::{LayerInteraction, contact_features};
use super::descent::{BACKTRACKING, Descent, WHOLE};
use super::draped::{Draped, to_device};
use super::on_body::OnBody;
use burn::tensor::{Tensor, TensorData};
use clothcombo_model::{
    BodyTensors, ClothCombo, DrapeState, DrapeStates, OutfitTensors, linear_blend_skinning,
};

/// The state that the networks' drape, the last of `states` and `uncorrected` on the host, and the correction steps of `model`
/// lead to. `watch` sees every state that was accepted, skinning first.
pub(crate) fn corrected(
    model: &ClothCombo,
    on_body: &OnBody<'_>,
    mut states: DrapeStates,
    uncorrected: Draped,
    interaction: LayerInteraction,
    watch: &mut dyn FnMut(&Descent<'_>),
) -> Draped {
    let OnBody { scene, outfit, embeddings, body, start } = on_body;
    let device = start.device();
    let energy = interaction.energy(scene).continuous().pulled_back(&scene.skinning_transforms());
    let skinnings = [start, &outfit.rest].map(|x| skinned(x.clone(), outfit.skin_weights.clone(), body));
    let mut descent = Descent::from_best(&energy, skinnings);
    watch(&descent);
    states.skin_weights = take_networks(&mut descent, &uncorrected, &states.skin_weights, outfit, body);
    watch(&descent);
    let networks = model.corrections.len();
    let mut idle = 0;
    for _ in 0..if networks > 0 { model.correction_steps } else { 0 } {
        states.replace_last(descent.state().upload(&device));
        let posed = &descent.state().posed;
        let features = contact_features(scene, &scene.bodies[0], interaction.contacts(scene), posed, &device);
        model.correct(outfit, embeddings, body, &mut states, features);
        let shares = descent.advance(&Draped::of(states.last()), &BACKTRACKING);
        watch(&descent);
        idle = if shares.iter().any(|share| *share > 0.0) { 0 } else { idle + 1 };
        if idle == networks {
            break;
        }
    }
    descent.into_state()
}

/// Moves from skinning to the networks' drape, and says which skin weights `[ΣV, J]` every garment has then.
fn take_networks(
    descent: &mut Descent<'_>,
    uncorrected: &Draped,
    skin_weights: &Tensor<2>,
    outfit: &OutfitTensors,
    body: &BodyTensors,
) -> Tensor<2> {
    let device = &skin_weights.device();
    let mut of_delta = descent.advance(uncorrected, &WHOLE);
    if of_delta.iter().all(|share| *share == 1.0) {
        return skin_weights.clone();
    }
    let initial = outfit.skin_weights.clone();
    let has_delta: Vec<bool> = of_delta.iter().map(|share| *share > 0.0).collect();
    let without = skinned(to_device(&uncorrected.canonical, device), initial.clone(), body);
    descent.advance_some(&without, &BACKTRACKING, |garment| !has_delta[garment]);
    let canonical = to_device(&descent.state().canonical, device);
    let with = skinned(canonical, skin_weights.clone(), body);
    let shares = descent.advance_some(&with, &BACKTRACKING, |garment| !has_delta[garment]);
    of_delta
        .iter_mut()
        .zip(shares)
        .filter(|(of_delta, _)| **of_delta == 0.0)
        .for_each(|(d, share)| *d = share);
    let rows: Vec<f32> =
        outfit.ranges().iter().zip(&of_delta).flat_map(|(rows, share)| vec![*share; rows.len()]).collect();
    let count = rows.len();
    let shares = Tensor::<2>::from_data(TensorData::new(rows, [count, 1]), device);
    initial.clone() + (skin_weights.clone() - initial) * shares
}

/// Linear blend skinning of `canonical` `[ΣV, 3]` (m) by `weights` `[ΣV, J]`.
pub(crate) fn skinned(canonical: Tensor<2>, weights: Tensor<2>, body: &BodyTensors) -> Draped {
    let posed = linear_blend_skinning(canonical.clone(), weights, body.bones.clone());
    Draped::of(&DrapeState { canonical, posed })
}
