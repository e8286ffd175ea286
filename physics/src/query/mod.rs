//! Queries on points and surfaces: nearest vertex (kd-tree), closest surface point and intersecting triangles
//! (bounding-volume tree), winding numbers of closed surfaces.

#[cfg(test)]
pub(crate) mod brute_force;
mod closest_point;
mod closest_vertex;
pub(crate) mod near_faces;
mod pseudo_normal;
mod ray_intersections;
mod surface;
pub(crate) mod triangle_pair;
mod triangle_point;
pub(crate) mod triangle_tree;
mod union;

pub use closest_point::{ClosestPoint, SurfacePoint};
pub use closest_vertex::VertexIndex;
pub use surface::{Distance, Gap, Surface};
pub use triangle_point::Feature;
pub(crate) use triangle_point::closest_on_triangle;
pub use union::{FaceSide, UnionDistance};
