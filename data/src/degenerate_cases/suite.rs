//! All cases on one body.

use super::bodies::BODY_CASES;
use super::broken::BROKEN_CASES;
use super::case::DegenerateCase;
use super::fixture::Fixture;
use super::places::PLACE_CASES;
use super::poses::POSE_CASES;
use super::rest_shapes::REST_CASES;
use super::scene::{CaseError, CaseScene};
use crate::asset::Body;
use crate::generate::GarmentError;

/// The suite for one body.
#[derive(Debug)]
pub struct DegenerateCases<'a> {
    fixture: Fixture<'a>,
}

impl<'a> DegenerateCases<'a> {
    /// Cuts the garments of the cases.
    ///
    /// # Errors
    /// [`GarmentError`] if the body is no T-posed human body with the SMPL joints.
    pub fn new(body: &'a Body) -> Result<Self, GarmentError> {
        Ok(Self { fixture: Fixture::new(body)? })
    }

    /// All cases, the same for every body.
    pub fn all() -> impl Iterator<Item = &'static DegenerateCase> {
        [REST_CASES, POSE_CASES, PLACE_CASES, BODY_CASES, BROKEN_CASES].into_iter().flatten()
    }

    /// The scene of a case on this body.
    ///
    /// # Errors
    /// For cases that loading refuses, what it says.
    pub fn scene(&self, case: &DegenerateCase) -> Result<CaseScene, CaseError> {
        (case.build)(&self.fixture)
    }
}

#[cfg(test)]
mod tests {
    use super::super::case::Expectation;
    use super::*;
    use crate::generate::mannequin;

    #[test]
    fn names_are_unique_and_scenes_hold_what_both_precisions_can_represent() {
        let body = mannequin();
        let cases = DegenerateCases::new(&body).expect("a human body");
        let mut names: Vec<&str> = DegenerateCases::all().map(|case| case.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        for case in DegenerateCases::all() {
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
