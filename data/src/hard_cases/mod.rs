//! Hard cases: garments, bodies and placements that break naive cloth energies, each with a name and a promise.
//!
//! One suite for everything that has to survive them: the tests of the energies, `clothcombo bench stability`, and the
//! stability evaluation of trained networks, which reads shape, pose and garments of the same scenes. Needs no files: the
//! built-in mannequin is a body as good as any, and [`HardCases::new`] takes any other.
//!
//! Every case is a whole scene, most of them with two layers in contact with each other and with the body, so that every
//! term has something to say. Positions are rounded to `f32`: both precisions see the same scene.

mod assess;
mod bodies;
mod broken;
mod places;
mod poses;
mod rest_shapes;
mod scene;
mod wardrobe;

pub use assess::{CaseReport, Outcome, TermReport};
pub use scene::{HardGarment, HardScene};

use crate::asset::{Body, BodyError};
use crate::generate::GarmentError;
use clothcombo_physics::{EnergyError, MeshError};
use serde::Serialize;
use thiserror::Error;
use wardrobe::Wardrobe;

/// What a case promises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Expectation {
    /// Every value is finite and every gradient below its bound ([`clothcombo_physics::energy::gradient_bound`]).
    Bounded,
    /// Loading fails with a message that holds this text: it names the element at fault.
    Refused(&'static str),
}

/// Why a case has no scene or no energies.
#[derive(Debug, Error)]
pub enum HardCaseError {
    /// A mesh is refused.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Energies are refused.
    #[error(transparent)]
    Energy(#[from] EnergyError),
    /// A body is refused.
    #[error(transparent)]
    Body(#[from] BodyError),
}

/// A case: what it is, what it promises, and how its scene is made.
#[derive(Debug, Clone, Copy)]
pub struct HardCase {
    /// Unique name, in lower-case words.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// The promise.
    pub expectation: Expectation,
    build: fn(&Wardrobe<'_>) -> Result<HardScene, HardCaseError>,
}

impl HardCase {
    const fn bounded(
        name: &'static str,
        description: &'static str,
        build: fn(&Wardrobe<'_>) -> Result<HardScene, HardCaseError>,
    ) -> Self {
        Self { name, description, expectation: Expectation::Bounded, build }
    }
}

/// The suite for one body.
#[derive(Debug)]
pub struct HardCases<'a> {
    wardrobe: Wardrobe<'a>,
}

impl<'a> HardCases<'a> {
    /// Cuts the garments that the cases wear.
    ///
    /// # Errors
    /// [`GarmentError`] if the body is no T-posed human body with the SMPL joints.
    pub fn new(body: &'a Body) -> Result<Self, GarmentError> {
        Ok(Self { wardrobe: Wardrobe::new(body)? })
    }

    /// All cases, the same for every body.
    pub fn all() -> impl Iterator<Item = &'static HardCase> {
        [rest_shapes::CASES, poses::CASES, places::CASES, bodies::CASES, broken::CASES].into_iter().flatten()
    }

    /// The scene of a case on this body.
    ///
    /// # Errors
    /// For cases that promise it, what loading says.
    pub fn scene(&self, case: &HardCase) -> Result<HardScene, HardCaseError> {
        (case.build)(&self.wardrobe)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;

    #[test]
    fn names_are_unique_and_scenes_hold_what_both_precisions_can_represent() {
        let body = mannequin();
        let cases = HardCases::new(&body).expect("a human body");
        let mut names: Vec<&str> = HardCases::all().map(|case| case.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        for case in HardCases::all() {
            let Ok(scene) = cases.scene(case) else {
                assert!(matches!(case.expectation, Expectation::Refused(_)), "{}", case.name);
                continue;
            };
            let garments = scene.garments.iter().flat_map(|g| g.canonical.iter().chain(&g.posed));
            for p in scene.body.positions().iter().chain(garments) {
                assert_eq!(p.map(|x| f64::from(x as f32)), *p, "{}", case.name);
            }
            for g in &scene.garments {
                let count = g.garment.rest.vertex_count();
                assert_eq!((g.canonical.len(), g.posed.len()), (count, count), "{}", case.name);
            }
        }
    }
}
