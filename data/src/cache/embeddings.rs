//! Records of embeddings that trained networks made of garments.

use super::{ArrayCache, CacheError, Key, KeyBuilder};

/// The key of the embedding of a mesh by the networks whose parameters have the checksum `model`.
pub fn embedding_key(mesh: Key, model: &str, eigen_count: usize) -> Key {
    KeyBuilder::new("embedding").key(mesh).text(model).number(eigen_count as u64).finish()
}

/// An embedding as it is stored: V vertices, width d.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredEmbedding {
    /// Of every vertex, `[V, d]` row-major.
    pub vertex: Vec<f32>,
    /// Of the garment, `[d]`.
    pub garment: Vec<f32>,
}

/// Stores an embedding.
///
/// # Errors
/// [`CacheError`] when the folder is full or cannot be written to.
pub fn put_embedding(cache: &ArrayCache, key: Key, embedding: &StoredEmbedding) -> Result<(), CacheError> {
    let StoredEmbedding { vertex, garment } = embedding;
    cache.put(key, &[("vertex", vertex.as_slice().into()), ("garment", garment.as_slice().into())])
}

/// Reads the embedding of a mesh of `vertices` vertices; `None` if it is not stored.
pub fn get_embedding(cache: &ArrayCache, key: Key, vertices: usize) -> Option<StoredEmbedding> {
    let found = cache.get(key, |record| {
        Ok(StoredEmbedding {
            vertex: record.array("vertex")?.to_vec(),
            garment: record.array("garment")?.to_vec(),
        })
    })?;
    // The bytes are those that were stored; any other size is another program's record.
    (found.vertex.len() == vertices * found.garment.len()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::mesh_key;
    use clothcombo_physics::mesh::shapes::grid;

    #[test]
    fn an_embedding_comes_back_and_belongs_to_one_mesh_and_one_model() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 20).unwrap();
        let mesh = mesh_key(&grid(0.1, 0.1, 2, 2));
        let key = embedding_key(mesh, "abc", 16);
        let embedding =
            StoredEmbedding { vertex: (0..27).map(|i| i as f32).collect(), garment: vec![0.5; 3] };
        assert_eq!(get_embedding(&cache, key, 9), None);
        put_embedding(&cache, key, &embedding).unwrap();
        assert_eq!(get_embedding(&cache, key, 9), Some(embedding));
        assert_eq!(get_embedding(&cache, key, 8), None);
        assert_ne!(embedding_key(mesh, "abd", 16), key);
        assert_ne!(embedding_key(mesh, "abc", 17), key);
        assert_ne!(embedding_key(mesh_key(&grid(0.1, 0.1, 2, 3)), "abc", 16), key);
    }
}
