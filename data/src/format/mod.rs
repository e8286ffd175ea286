//! File formats. Each reader names file, element or line, and what to do, when it refuses something.

pub mod atomic;
pub mod bvh;
mod gltf;
pub mod mesh;
pub mod npz;
pub mod obj;
mod ply;
mod stl;

pub use bvh::{Bvh, BvhError};
pub use mesh::{MeshFileError, MeshFormat, PolygonMesh, load_mesh, load_tri_mesh};
pub use npz::{Array, NpzError, NpzFile, NpzWriter};
pub use obj::{ObjError, ObjMesh};
