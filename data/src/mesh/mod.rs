//! Meshes in the making: from polygon soup to manifold pieces, cut along fields, remeshed, measured.

mod attachment;
mod clean;
mod distance_grid;
mod editable;
mod isosurface;
mod labelled_triangles;
mod manifold;
mod measures;
mod push_out;
mod remesh;
mod seams;
mod thickness;
mod triangle;

pub use attachment::{Attachment, attach};
pub use clean::{
    AREA_SHARE, CleanFaces, Cuts, Triangulated, WELD_SHARE, Welded, bounds, clean_faces, compact, diagonal,
    fan, triangulate, weld,
};
pub(crate) use distance_grid::DistanceGrid;
pub use editable::EditableMesh;
pub(crate) use isosurface::{Lattice, extract};
pub use labelled_triangles::LabelledTriangles;
pub use manifold::{Joined, SplitMesh, join_faces, orient, outward_area, outwardness, split_fans};
pub use measures::{MeshDefects, MeshMeasures};
pub use push_out::{BodyClearance, contact, gaps_to, one_rings, push_out};
pub use remesh::{Quality, RemeshTarget, remesh};
pub use seams::{COINCIDE_SHARE, JoinedSheet, Seam, join_seams, open_seams};
#[cfg(test)]
pub(crate) use thickness::tests::solidified;
pub use thickness::{outer_sheet, sheets, thickness};
pub use triangle::{smallest_sine, triangle_normal};
