//! A body measured for the generator, and the distance to its surface.

use super::error::GarmentError;
use super::measures::BodyMeasures;
use crate::asset::Body;
use crate::mesh::DistanceGrid;
use clothcombo_physics::query::Surface;
use std::ops::Deref;

/// Node spacing of the distance grid (m).
const GRID_STEP: f64 = 0.012;
/// Largest distance the grid tells (m).
const GRID_BAND: f64 = 0.06;

/// A body measured for garments.
#[derive(Debug)]
pub(super) struct BodyFit {
    measures: BodyMeasures,
    pub distance: DistanceGrid,
    pub surface: Surface<f64>,
}

impl Deref for BodyFit {
    type Target = BodyMeasures;

    fn deref(&self) -> &BodyMeasures {
        &self.measures
    }
}

impl BodyFit {
    pub fn new(body: &Body) -> Result<Self, GarmentError> {
        let measures = BodyMeasures::new(body)?;
        let distance = DistanceGrid::new(&body.template, &body.faces, GRID_STEP, GRID_BAND);
        let surface = Surface::new(body.template.clone(), body.faces.clone());
        Ok(Self { measures, distance, surface })
    }
}
