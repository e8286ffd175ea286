//! What intersects, penetrates or lies in the wrong order: garment vertices inside the body, outer layers under inner ones, and
//! triangles that intersect, decided exactly. A [`Report`] counts all of it.

mod contours;
mod inner_surface;
mod layer_order;
mod penetration;
mod report;
pub mod resolve;
mod self_collision;
pub(crate) mod step_filter;
#[cfg(test)]
mod tests;

pub use crate::query::triangle_pair::{
    Triangle, intersection_segment, mesh_triangles_intersect, triangles_intersect,
};
pub use crate::query::triangle_tree::{TriangleTree, self_triangle_pairs, triangle_pairs};
pub use contours::{Contour, contours, self_contours};
pub use inner_surface::LayerTopology;
pub use layer_order::{LayerOrder, ORDER_RADIUS, OrderViolations};
pub use penetration::Penetration;
pub use report::{
    CountedBody, GarmentReport, Intersections, LayerReport, Report, ReportBody, ReportGarment, Selection,
    TrianglePairs, all_layers,
};
pub use self_collision::self_collision;
