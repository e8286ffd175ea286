//! File formats. Each reader names file, element or line, and what to do, when it refuses something.

pub mod atomic;
pub mod bvh;
pub mod npz;
pub mod obj;

pub use bvh::{Bvh, BvhError};
pub use npz::{Array, NpzError, NpzFile, NpzWriter};
pub use obj::{ObjError, ObjMesh};
