//! File formats. Each reader names file, element or line, and what to do, when it refuses something.

pub mod atomic;
mod error;
mod file_face;
pub mod folder;
mod foreign;
mod gltf;
mod load_mesh;
pub mod mat;
pub mod npz;
pub mod obj;
mod ply;
mod point_cache;
mod polygon_mesh;
mod scalar;
mod stl;
pub mod toml_file;

pub use error::FileError;
pub use file_face::FileFace;
pub use foreign::way_out;
pub use gltf::{SceneMesh, encode_glb, save_glb};
pub use load_mesh::{MeshFormat, is_mesh_path, load_body_mesh, load_mesh, load_tri_mesh, parse_mesh};
pub use mat::{MatFile, MatValue};
pub use npz::{Array, NpzFile, NpzWriter};
pub use obj::ObjMesh;
pub use point_cache::PointFrames;
pub use polygon_mesh::{MAX_ELEMENTS, MAX_FILE_BYTES, PolygonMesh, read_limited as read_mesh_file};
