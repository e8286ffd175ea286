//! The networks at inference: a prepared scene in, positions on the host out.

use crate::evaluate::Draped;
use crate::scene::{Library, LibraryGarment, PreparedBody, PreparedScene};
use burn::tensor::{Device, Tensor, TensorData};
use clothcombo_model::{
    BodyTensors, ClothCombo, Dimensions, Embeddings, GarmentArrays, GarmentEmbedding, GarmentTensors,
    ModelError, OutfitTensors, linear_blend_skinning,
};
use std::cell::RefCell;
use std::collections::HashMap;

/// The constant tensors of a wardrobe on one device.
pub struct WardrobeTensors {
    garments: Vec<GarmentTensors>,
    dimensions: Dimensions,
    device: Device,
}

impl WardrobeTensors {
    /// Uploads every garment of `library`.
    ///
    /// # Errors
    /// When a garment's numbers are not finite.
    pub fn new(library: &Library, dimensions: Dimensions, device: &Device) -> Result<Self, ModelError> {
        let device = device.clone().inner();
        let upload = |g: &LibraryGarment| {
            let rest: Vec<f32> = g.garment.rest.positions().iter().flatten().map(|v| *v as f32).collect();
            let o = &g.operators;
            GarmentTensors::new(
                &GarmentArrays {
                    rest: &rest,
                    mass: &o.mass,
                    eigenvalues: &o.eigenvalues,
                    eigenvectors: &o.eigenvectors,
                    gradient_x_basis: &o.gradient_x_basis,
                    gradient_y_basis: &o.gradient_y_basis,
                    skin_weights: &g.skin_weights,
                },
                dimensions.joints,
                &device,
            )
        };
        let garments = library.garments.iter().map(upload).collect::<Result<_, _>>()?;
        Ok(Self { garments, dimensions, device })
    }

    /// One garment.
    pub fn garment(&self, index: usize) -> &GarmentTensors {
        &self.garments[index]
    }

    /// The outfit of a scene.
    ///
    /// # Errors
    /// When the scene has no garment.
    pub fn outfit(&self, scene: &PreparedScene) -> Result<OutfitTensors, ModelError> {
        let garments: Vec<_> = scene.garments.iter().map(|&g| &self.garments[g]).collect();
        OutfitTensors::new(&garments, &scene.contacts)
    }

    /// One body of a scene, and the start positions of the garments on it `[ΣV, 3]`.
    ///
    /// # Errors
    /// When its numbers are not finite.
    pub fn body(&self, body: &PreparedBody) -> Result<(BodyTensors, Tensor<2>), ModelError> {
        let tensors = BodyTensors::new(&body.shape, &body.pose, &body.bones, &self.dimensions, &self.device)?;
        let start = TensorData::new(body.start.as_flattened().to_vec(), [body.start.len(), 3]);
        Ok((tensors, Tensor::from_data(start, &self.device)))
    }

    /// Embeds each distinct garment of `scene` once and packs them in its order. `known` keeps embeddings between calls;
    /// it must be emptied when the weights change.
    ///
    /// # Errors
    /// When outfit and embeddings disagree.
    pub fn embed(
        &self,
        model: &ClothCombo,
        scene: &PreparedScene,
        outfit: &OutfitTensors,
        known: &mut HashMap<usize, GarmentEmbedding>,
    ) -> Result<Embeddings, ModelError> {
        let mut packed = Vec::with_capacity(scene.garments.len());
        for &g in &scene.garments {
            packed.push(known.entry(g).or_insert_with(|| model.encode(&self.garments[g])).clone());
        }
        model.pack(outfit, &packed)
    }
}

/// The networks ready for inference; garments are embedded once.
pub struct Networks<'a> {
    model: ClothCombo,
    tensors: &'a WardrobeTensors,
    embeddings: RefCell<HashMap<usize, GarmentEmbedding>>,
}

/// What the networks make of a scene's first body.
pub struct NetworkDrape {
    /// Every garment draped alone.
    pub single: Draped,
    /// After untangling.
    pub layered: Draped,
}

impl<'a> Networks<'a> {
    /// Wraps a model without automatic differentiation.
    pub fn new(model: ClothCombo, tensors: &'a WardrobeTensors) -> Self {
        Self { model, tensors, embeddings: RefCell::default() }
    }

    /// Drapes the garments of `scene` on its first body.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn drape(&self, scene: &PreparedScene) -> Result<NetworkDrape, ModelError> {
        let outfit = self.tensors.outfit(scene)?;
        let embeddings =
            self.tensors.embed(&self.model, scene, &outfit, &mut self.embeddings.borrow_mut())?;
        let (body, start) = self.tensors.body(&scene.bodies[0])?;
        let single = self.model.drape_single(&outfit, &embeddings, &body, start);
        let layered = self.model.untangle(&outfit, &embeddings, &single, &body);
        Ok(NetworkDrape {
            single: draped(single.canonical, single.posed),
            layered: draped(layered.canonical, layered.posed),
        })
    }

    /// Linear blend skinning of the start state, which has learned nothing.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin(&self, scene: &PreparedScene) -> Result<Draped, ModelError> {
        let (_, start) = self.tensors.body(&scene.bodies[0])?;
        self.skin_from(scene, start)
    }

    /// Linear blend skinning of the rest garments, whatever the body's shape: the paper's baseline.
    ///
    /// # Errors
    /// When the scene's numbers are not finite.
    pub fn skin_rest(&self, scene: &PreparedScene) -> Result<Draped, ModelError> {
        let rest = self.tensors.outfit(scene)?.rest;
        self.skin_from(scene, rest)
    }

    fn skin_from(&self, scene: &PreparedScene, start: Tensor<2>) -> Result<Draped, ModelError> {
        let outfit = self.tensors.outfit(scene)?;
        let (body, _) = self.tensors.body(&scene.bodies[0])?;
        let posed = linear_blend_skinning(start.clone(), outfit.skin_weights, body.bones);
        Ok(draped(start, posed))
    }
}

fn draped(canonical: Tensor<2>, posed: Tensor<2>) -> Draped {
    Draped { canonical: to_host(canonical), posed: to_host(posed) }
}

fn to_host(positions: Tensor<2>) -> Vec<[f32; 3]> {
    let data = positions.into_data();
    let values = data.as_slice::<f32>().expect("positions are f32");
    values.as_chunks::<3>().0.to_vec()
}
