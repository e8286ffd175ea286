//! What lies on the wrong side or crosses: garment vertices inside the body, outer layers below inner ones, and triangles
//! that intersect, decided exactly.

mod contours;
mod intersections;
mod order;
mod penetration;
mod report;
pub mod resolve;
mod self_collision;
#[cfg(test)]
mod tests;
mod triangle_pair;

pub use contours::{Contour, contours, self_contours};
pub use intersections::{TriangleTree, self_triangle_pairs, triangle_pairs};
pub use order::{ORDER_RADIUS, OrderViolations, order_violations};
pub use penetration::{Penetration, penetration, penetration_by};
pub use report::{IntersectionReport, Intersections, LayerIntersections};
pub use self_collision::self_collision;
pub use triangle_pair::{Triangle, intersection_segment, mesh_triangles_intersect, triangles_intersect};
