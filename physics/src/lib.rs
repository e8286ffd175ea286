//! Meshes, surface operators, closest-point queries and the physical energies of learned garment draping.
//!
//! The crate knows no files and no networks. Everything is SI (metres, kilograms, seconds, joules), positions are
//! `[T; 3]` with `T` either `f32` or `f64` (trait [`Real`]), and every sum has a fixed order, so that results do not
//! depend on the number of threads.
//!
//! | module | what it holds |
//! |---|---|
//! | [`mesh`] | validated triangle mesh, normals, topology, analytic test shapes |
//! | [`operators`] | the DiffusionNet precompute: mass, Laplacian, gradients, eigenbasis |
//! | [`energy`] | the eight energies, their gradients, and the weighted sum over a scene |
//! | [`contact`] | penetration of the body, order of layers, exact intersections and their contours |
//! | [`equilibrium`] | static drape: direct minimisation of the same energies from any start |
//! | [`query`] | nearest vertex, closest surface point, winding numbers, triangle intersections |
//! | [`transform`] | affine maps, as skinning blends them |
//! | `autodiff` | the energies as one differentiable burn operation (feature `autodiff`) |

#[cfg(feature = "autodiff")]
pub mod autodiff;
pub mod contact;
pub mod energy;
pub mod equilibrium;
pub mod mesh;
pub mod operators;
pub mod query;
pub mod real;
mod rows;
pub mod transform;
pub mod vec3;

pub use energy::{EnergyError, EnergySettings, GarmentEnergies, SceneEnergy, SceneValue, Term, TermMap};
pub use mesh::{Hinge, MeshError, Topology, TriMesh, vertex_normals};
pub use operators::{OperatorError, SurfaceOperators};
pub use query::{Distance, Gap, Surface, VertexIndex};
pub use real::Real;
