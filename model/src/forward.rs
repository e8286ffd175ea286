//! The forward pass: from the embeddings of an outfit and a body to draped positions.

use burn::tensor::Tensor;
use tracing::trace_span;

use crate::cloth_combo::{ClothCombo, Embeddings};
use crate::correction::Conditioning;
use crate::linear_blend_skinning::linear_blend_skinning;
use crate::mode::Mode;
use crate::tensors::{BodyTensors, ContactFeatureTensors, OutfitTensors};

/// Positions of the garments of an outfit.
#[derive(Clone, Debug)]
pub struct DrapeState {
    /// Canonical (T-pose) positions x `[ΣV,3]` (m).
    pub canonical: Tensor<2>,
    /// Posed positions `[ΣV,3]` (m).
    pub posed: Tensor<2>,
}

/// All states that the networks take an outfit through on one body, in order.
#[derive(Clone, Debug)]
pub struct DrapeStates {
    /// What displacements are added to `[ΣV,3]` (m).
    pub start: Tensor<2>,
    /// x_s and V_s, after single draping.
    pub single: DrapeState,
    /// x_m and V_m, after untangling; absent where a pass ends before, or where [untangling does not
    /// act](crate::Untangling::acts_on).
    pub layered: Option<DrapeState>,
    /// After every correction step.
    pub corrected: Vec<DrapeState>,
    /// Corrected skin weights W + ΔW `[ΣV,J]`.
    pub skin_weights: Tensor<2>,
    /// Draping embeddings z_s `[M,width]`.
    pub draping_embedding: Tensor<2>,
}

impl DrapeStates {
    /// The last state.
    pub fn last(&self) -> &DrapeState {
        self.corrected.last().or(self.layered.as_ref()).unwrap_or(&self.single)
    }

    /// Exchanges the last state, from which the next correction step starts.
    pub fn replace_last(&mut self, state: DrapeState) {
        *self.corrected.last_mut().or(self.layered.as_mut()).unwrap_or(&mut self.single) = state;
    }
}

impl ClothCombo {
    /// Drapes an outfit on a body, up to the end of `mode`.
    ///
    /// `start` `[ΣV,3]` (m) is what the displacement is added to: the rest positions, or those moved with the body's shape.
    pub fn forward(
        &self,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        body: &BodyTensors,
        start: Tensor<2>,
        mode: Mode,
    ) -> DrapeStates {
        let span = trace_span!("draping").entered();
        let draping_embedding = self.draping.embed(embeddings.garment.clone(), body);
        let mut products = [embeddings.draping_product.clone(), embeddings.skinning_product.clone()];
        if let Some(surroundings) = &self.surroundings {
            products = surroundings.add_to(&surroundings.codes(body), outfit, products);
        }
        let [draping_product, skinning_product] = products;
        let displacement = self.draping.displace(
            outfit.rest.clone(),
            draping_product,
            draping_embedding.clone(),
            &outfit.packing,
        );
        let canonical = displacement + start.clone();
        drop(span);
        let span = trace_span!("skinning").entered();
        let skin_weights = self.skinning.weights(outfit, skinning_product, draping_embedding.clone());
        let single = posed(canonical, &skin_weights, body);
        drop(span);
        let layered = (mode == Mode::Layered && self.untangling.acts_on(outfit)).then(|| {
            let _span = trace_span!("untangling").entered();
            let product = embeddings.untangling_product.clone();
            let product =
                product.unwrap_or_else(|| self.untangling.vertex_product(embeddings.vertex.clone()));
            let (canonical, draping) = (single.canonical.clone(), draping_embedding.clone());
            let displacement = self.untangling.displace(outfit, canonical.clone(), draping, product);
            posed(canonical + displacement, &skin_weights, body)
        });
        DrapeStates { start, single, layered, corrected: Vec::new(), skin_weights, draping_embedding }
    }

    /// Takes one more correction step, from the last of `states`, whose contact features are `features`. The correction
    /// networks take turns.
    ///
    /// Only the parameters of the network whose turn it is get a gradient: the state, its features and everything that led
    /// there count as given, whatever device they come from.
    ///
    /// # Panics
    /// Without correction networks.
    pub fn correct(
        &self,
        outfit: &OutfitTensors,
        embeddings: &Embeddings,
        body: &BodyTensors,
        states: &mut DrapeStates,
        features: ContactFeatureTensors,
    ) {
        let _span = trace_span!("corrections").entered();
        let network = &self.corrections[states.corrected.len() % self.corrections.len()];
        let [vertex, draping, skin_weights] =
            [&embeddings.vertex, &states.draping_embedding, &states.skin_weights].map(|t| t.clone().detach());
        let given = Conditioning { vertex: &vertex, draping: &draping, packing: &outfit.packing };
        let displacement = states.last().canonical.clone().detach() - states.start.clone();
        let canonical = network.correct(displacement, features, &given) + states.start.clone();
        states.corrected.push(posed(canonical, &skin_weights, body));
    }
}

/// Linear blend skinning of canonical positions.
fn posed(canonical: Tensor<2>, skin_weights: &Tensor<2>, body: &BodyTensors) -> DrapeState {
    let posed = linear_blend_skinning(canonical.clone(), skin_weights.clone(), body.bones.clone());
    DrapeState { canonical, posed }
}

#[cfg(test)]
mod tests;
