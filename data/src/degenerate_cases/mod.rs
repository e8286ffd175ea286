//! Degenerate cases: garments, bodies and placements that break naive cloth energies, each with a name and an invariant.
//!
//! One suite for everything that has to survive them: the tests of the energies and `clothcombo bench stability`. Needs no
//! files: the built-in mannequin is a body as good as any, and [`DegenerateCases::new`] takes any other.
//!
//! Every case is a whole scene, most of them with two layers in contact with each other and with the body, so that every
//! term has something to say. Positions are rounded to `f32`: both precisions see the same scene.

mod assess;
mod bodies;
mod broken;
mod case;
mod fixture;
mod places;
mod poses;
mod rest_shapes;
mod scene;
mod suite;

pub use assess::{CaseOutcome, CaseReport, TermReport};
pub use case::{DegenerateCase, Expectation};
pub use scene::{CaseError, CaseGarment, CaseScene};
pub use suite::DegenerateCases;
