//! A case: its name, its invariant, and how its scene is made.

use super::fixture::Fixture;
use super::scene::{CaseError, CaseScene};
use serde::Serialize;

/// What must hold for a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Expectation {
    /// Every value is finite and every gradient below its bound ([`clothcombo_physics::energy::gradient_bound`]).
    Bounded,
    /// Loading fails with a message that holds this text: it names the element at fault.
    Refused(&'static str),
}

/// How the scene of a case is made.
pub(super) type BuildScene = fn(&Fixture<'_>) -> Result<CaseScene, CaseError>;

/// A case.
#[derive(Debug, Clone, Copy)]
pub struct DegenerateCase {
    /// Unique name, in lower-case words.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// What must hold.
    pub expectation: Expectation,
    pub(super) build: BuildScene,
}

/// A case whose energies are bounded.
pub(super) const fn bounded(
    name: &'static str,
    description: &'static str,
    build: BuildScene,
) -> DegenerateCase {
    DegenerateCase { name, description, expectation: Expectation::Bounded, build }
}

/// A case that loading refuses with a message that holds `text`.
pub(super) const fn refused(
    name: &'static str,
    description: &'static str,
    text: &'static str,
    build: BuildScene,
) -> DegenerateCase {
    DegenerateCase { name, description, expectation: Expectation::Refused(text), build }
}
