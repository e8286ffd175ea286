//! Meshes in the making: from polygon soup to manifold pieces, cut along fields, remeshed, measured.

mod clean;
mod distance_grid;
mod editable;
mod isosurface;
mod labelled_triangles;
mod manifold;
mod measures;
mod push_out;
mod remesh;
mod triangle;

pub use clean::{
    AREA_SHARE, CleanFaces, WELD_SHARE, Welded, bounds, clean_faces, compact, diagonal, fan, triangulate,
    weld,
};
pub(crate) use distance_grid::DistanceGrid;
pub use editable::EditableMesh;
pub(crate) use isosurface::{Lattice, extract};
pub use labelled_triangles::LabelledTriangles;
pub use manifold::{Joined, SplitMesh, join_faces, orient, outward_area, outwardness, split_fans};
pub use measures::{MeshDefects, MeshMeasures};
pub use push_out::{Contact, contact, one_rings, push_out};
pub use remesh::{Quality, RemeshTarget, remesh};
pub use triangle::{smallest_sine, triangle_normal};
