//! Triangle meshes: validated storage, normals, topology, and analytic shapes for tests.

mod disjoint_sets;
mod normals;
pub mod shapes;
mod stretch;
mod topology;
mod tri_mesh;
mod volume;

pub use disjoint_sets::DisjointSets;
pub use normals::vertex_normals;
pub use stretch::vertex_stretch;
pub use topology::{Hinge, Topology};
pub use tri_mesh::{MeshError, TriMesh};
pub use volume::{is_closed, is_inside_out, signed_volume};
