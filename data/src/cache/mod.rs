//! What is expensive to compute, kept on disk under the hash of everything it was computed from.
//!
//! A key is the BLAKE3 hash of the inputs and of the version of the computation: a changed mesh, setting or version is another
//! key, so nothing ever has to be invalidated. Records appear whole (temporary name, then rename) and are never changed
//! afterwards, so any number of processes and machines may share one folder; two that compute the same record write the
//! same bytes. Records are memory-mapped and every array is checked against its own hash when it is read.

mod bindings;
mod embeddings;
mod operators;
mod poses;
mod record;
mod store;

pub use bindings::{binding_key, body_key, get_binding, get_largest_weights, put_binding};
pub use embeddings::{StoredEmbedding, embedding_key, get_embedding, put_embedding};
pub use operators::{get_operators, mesh_key, operators_key, put_operators};
pub use poses::{get_poses, put_poses};
pub use record::{Element, Record, StoredArray};
pub use store::{ArrayCache, CacheError, Key, KeyBuilder};
