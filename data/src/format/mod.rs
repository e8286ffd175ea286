//! File formats. Each reader names file, element or line, and what to do, when it refuses something.

pub mod atomic;
pub mod bvh;
mod gltf;
pub mod mat;
pub mod mesh;
pub mod npz;
pub mod obj;
pub mod pc16;
mod ply;
mod stl;

pub use bvh::{Bvh, BvhError};
pub use gltf::{GlbError, SceneMesh, encode_glb, save_glb};
pub use mat::{MatError, MatFile, MatValue};
pub use mesh::{MeshFileError, MeshFormat, PolygonMesh, load_mesh, load_tri_mesh};
pub use npz::{Array, NpzError, NpzFile, NpzWriter};
pub use obj::{ObjError, ObjMesh};
pub use pc16::{PointCache, PointCacheError};
