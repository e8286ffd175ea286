//! Distance queries: nearest vertex (kd-tree), closest surface point (bounding-volume tree), and their oracles.

pub mod brute_force;
mod closest_point;
mod closest_vertex;
mod pseudo_normal;
mod ray_intersections;
mod surface;
mod union;
mod winding_number;

pub use closest_point::{ClosestPoint, Feature, SurfacePoint};
pub(crate) use closest_point::{box_distance_squared, closest_on_triangle};
pub use closest_vertex::{KdScalar, VertexIndex};
pub use surface::{Distance, Gap, Surface};
pub use union::{FaceSide, UnionDistance};
pub use winding_number::{winding_number, winding_numbers};
