//! Garments are prepared and embedded. Whatever depends on a garment alone is computed once: per process by content, and per
//! machine with a cache.

use super::draper::Draper;
use super::embedded::EmbeddedGarment;
use super::phase_times::{PhaseTimes, elapsed};
use super::source::GivenGarment;
use super::tensor_store::garment_tensors;
use burn::tensor::{Tensor, TensorData};
use clothcombo_data::cache::{
    Key, KeyBuilder, StoredEmbedding, embedding_key, get_embedding, mesh_key, put_embedding,
};
use clothcombo_model::{GarmentEmbedding, GarmentTensors};
use clothcombo_physics::contact::resolve::RestGarment;
use miette::{IntoDiagnostic, Report};
use std::sync::Arc;
use std::time::Instant;

impl Draper {
    /// The garment as the networks need it, made if it was not met before.
    pub(super) fn embed(&self, source: &GivenGarment) -> Result<EmbeddedGarment, Report> {
        let garment = &source.garment;
        let mesh = mesh_key(&garment.rest);
        let key = KeyBuilder::new("embedded").key(mesh).text(garment.category.name());
        let key = key.number(u64::from(garment.holding)).text(&garment.material.to_string()).finish();
        if let Some(found) = self.embedded.get(key) {
            return Ok(found);
        }
        let clock = Instant::now();
        let preprocessor = &self.preprocessor;
        let binding = preprocessor.binding(garment, mesh);
        let prepared = Arc::new(preprocessor.finish(garment.clone(), binding, &self.joints)?);
        let rest = Arc::new(RestGarment::of_material(&garment.rest, prepared.energies.material()));
        let operators = preprocessor.operators(&garment.name, &garment.rest, mesh)?;
        let tensors = garment_tensors(&prepared, &operators, &self.dimensions(), &self.settings.device)
            .into_diagnostic()?;
        let preparation = elapsed(clock);
        let clock = Instant::now();
        let (embedding, was_known) = self.embedding(&tensors, mesh);
        let milliseconds = PhaseTimes { preparation, embedding: elapsed(clock), ..PhaseTimes::default() };
        let found = EmbeddedGarment { prepared, rest, tensors, embedding, was_known, milliseconds };
        self.embedded.insert(key, found.clone());
        Ok(found)
    }

    /// The embedding of a garment, and whether it came from the cache.
    fn embedding(&self, tensors: &GarmentTensors, mesh: Key) -> (GarmentEmbedding, bool) {
        let Some(cache) = self.preprocessor.cache() else { return (self.model.encode(tensors), false) };
        let key = embedding_key(mesh, self.trained.checksum(), self.preprocessor.eigen_count);
        let (vertices, width) = (tensors.vertex_count(), self.trained.config.model.embedding);
        if let Some(StoredEmbedding { vertex, garment }) = get_embedding(cache, key, vertices)
            && garment.len() == width
        {
            let upload = |values: Vec<f32>, rows: usize| {
                Tensor::from_data(TensorData::new(values, [rows, width]), &self.settings.device)
            };
            return (
                GarmentEmbedding { vertex: upload(vertex, vertices), garment: upload(garment, 1) },
                true,
            );
        }
        let embedding = self.model.encode(tensors);
        let [vertex, garment] =
            [&embedding.vertex, &embedding.garment].map(|tensor| tensor.clone().into_data());
        if let (Ok(vertex), Ok(garment)) = (vertex.as_slice::<f32>(), garment.as_slice::<f32>()) {
            let stored = StoredEmbedding { vertex: vertex.to_vec(), garment: garment.to_vec() };
            self.preprocessor.store(|cache| put_embedding(cache, key, &stored));
        }
        (embedding, false)
    }
}
