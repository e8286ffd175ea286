//! File formats. Each reader names file, element or line, and what to do, when it refuses something.

pub mod atomic;
mod error;
mod gltf;
mod load_mesh;
pub mod mat;
pub mod npz;
pub mod obj;
pub mod pc16;
mod ply;
mod polygon_mesh;
mod stl;

pub use error::{FileError, LineError};
pub use gltf::{GlbError, SceneMesh, encode_glb, save_glb};
pub use load_mesh::{MESH_EXTENSIONS, MeshFormat, is_mesh_path, load_mesh, load_tri_mesh, parse_mesh};
pub use mat::{MatError, MatFile, MatValue};
pub use npz::{Array, NpzError, NpzFile, NpzWriter};
pub use obj::ObjMesh;
pub use pc16::{PointCache, PointCacheError};
pub use polygon_mesh::{MAX_ELEMENTS, MAX_FILE_BYTES, MeshFileError, PolygonMesh};
