//! The eight energies that train the networks, each a plain function of positions with a hand-derived gradient.
//!
//! | term | acts on | formula (sum over) |
//! |---|---|---|
//! | [`strain`] | posed garment | `area·thickness·(λ/2 tr(G)² + μ tr(G²))` (triangles) |
//! | [`bending`] | posed garment | `k/2·α²` (interior edges) |
//! | [`gravity`] | posed garment | `m·g·y` (vertices) |
//! | [`body_collision`] | posed garment, body | `max(ε − d, 0)³` (vertices, and points between them) |
//! | [`repulsion`] | posed garment | `−log d²` (close vertex pairs that share no edge), over `N` |
//! | [`holding`] | posed garment, pulled back; paper: canonical garment | `(y − y_ref)²` (top tenth of the vertices) |
//! | [`layer_collision`] | two posed garments | `max(ε − d, 0)³` (the same points of the outer one, distance to the inner garment) |
//! | [`layer_distance`] | two posed garments, body | `max(d_inner − d_outer, 0)³` (pairs over one body vertex) |
//!
//! Weights never live in a term: [`SceneEnergy`] multiplies them in. Elements are evaluated in `f64` whatever the scalar of
//! the positions (only the pair loop of the repulsion and the distances to vertices work in the caller's scalar), and sums are
//! `f64` and run in a fixed order: results are bit-identical for any number of threads.
//!
//! A ninth term is one new file, its name in [`Term`], its weight in the configuration, a bound of its gradient for the
//! suite of degenerate cases, and one line where [`GarmentEnergies`] (or, for a pair of garments, [`SceneEnergy`])
//! lists what it evaluates; `scene_sum.rs` names it with the terms of garments or of pairs, and whether it reads distances to
//! the body. The compiler asks for all of these. The finite-difference test walks the list.

pub mod bending;
pub mod body_collision;
mod cell_grid;
mod contact_points;
mod creases;
mod curvature;
mod difference_quotient;
mod elements;
mod error;
mod garment;
mod garment_term;
pub mod gradient_bound;
pub mod gradient_check;
pub mod gravity;
pub mod holding;
pub mod layer_collision;
pub mod layer_distance;
mod material;
mod pair_kernel;
pub mod repulsion;
mod scene;
mod scene_curvature;
mod scene_sum;
mod settings;
pub mod strain;
mod term;
#[cfg(test)]
pub(crate) mod tests;

pub use contact_points::{ContactPoints, ContactSamples};
pub(crate) use creases::{Creases, reach as crease_reach};
pub use curvature::CurvatureSink;
pub use elements::Weighted;
pub use error::EnergyError;
pub use garment::GarmentEnergies;
pub use garment_term::{GarmentState, GarmentTerm};
pub use material::Material;
pub use scene::{SceneEnergy, SceneGarment, SceneLayers};
pub(crate) use scene_sum::BodyMemory;
pub use scene_sum::{SceneValue, weighted};
pub use settings::{EnergySettings, LayerContact, LayerGate};
pub use term::{Term, TermMap};
