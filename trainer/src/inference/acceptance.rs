//! What becomes of the networks' drape: from linear blend skinning over it to a state of less energy.
//!
//! Every state on the path is accepted garment by garment, as far as it lowers the energy
//! ([`crate::inference::descent`]), in the form that drapes are measured by ([`crate::inference::reference`]):
//!
//! 1. skinning by the initial weights W, of the start (with shape transfer) or of the rest garments: whichever has less energy;
//! 2. the networks' drape: Δx and ΔW together; where a garment does not take it, Δx with W, and then ΔW as far as it helps
//!    (networks that were trained with canonical holding slide waistbands by ΔW).
//!
//! So no outfit ends above either skinning, and no garment above what it began with.

use super::descent::{BACKTRACKING, Descent, WHOLE_STEP};
use super::draped::{Draped, to_device};
use super::on_body::OnBody;
use burn::tensor::Tensor;
use clothcombo_model::{BodyTensors, DrapeState, Mode, OutfitTensors, linear_blend_skinning};

/// The state that the networks' drape `proposed` leads to, whose skin weights are `skin_weights` `[ΣV, J]`.
pub(crate) fn accepted(
    on_body: &OnBody<'_>,
    proposed: &Draped,
    skin_weights: &Tensor<2>,
    mode: Mode,
) -> Draped {
    let OnBody { scene, outfit, body, start, .. } = on_body;
    let energy = &scene.bodies[0].energy;
    // The losses of the pairs count where garments interact.
    let energy = match mode {
        Mode::Single => energy.without_layers(),
        Mode::Layered => (**energy).clone(),
    };
    let energy = energy.continuous().pulled_back(&scene.skinning_transforms());
    let skinnings = [start, &outfit.rest].map(|x| skinned(x.clone(), outfit.skin_weights.clone(), body));
    let mut descent = Descent::from_best(&energy, skinnings);
    take_networks(&mut descent, proposed, skin_weights, outfit, body);
    descent.into_state()
}

/// Moves from skinning to the networks' drape.
fn take_networks(
    descent: &mut Descent<'_>,
    proposed: &Draped,
    skin_weights: &Tensor<2>,
    outfit: &OutfitTensors,
    body: &BodyTensors,
) {
    let device = &skin_weights.device();
    let shares = descent.advance(proposed, &WHOLE_STEP);
    let stayed = |garment: usize| shares[garment] == 0.0;
    if !(0..shares.len()).any(stayed) {
        return;
    }
    let without = skinned(to_device(&proposed.canonical, device), outfit.skin_weights.clone(), body);
    descent.advance_some(&without, &BACKTRACKING, stayed);
    let canonical = to_device(&descent.state().canonical, device);
    let with = skinned(canonical, skin_weights.clone(), body);
    descent.advance_some(&with, &BACKTRACKING, stayed);
}

/// Linear blend skinning of `canonical` `[ΣV, 3]` (m) by `weights` `[ΣV, J]`.
pub(crate) fn skinned(canonical: Tensor<2>, weights: Tensor<2>, body: &BodyTensors) -> Draped {
    let posed = linear_blend_skinning(canonical.clone(), weights, body.bones.clone());
    Draped::of(&DrapeState { canonical, posed })
}
