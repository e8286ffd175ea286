//! What an energy of one garment is.

use std::fmt::Debug;

use super::{CurvatureSink, EnergySettings, Weighted};
use crate::query::Gap;

/// The height before skinning as an affine function of a posed position: the second row of `T₀⁻¹`, `y = r·(x̂, 1)`.
pub type HeightRow = [f64; 4];

/// One garment at one moment, as its energies see it.
#[derive(Debug, Clone, Copy)]
pub struct GarmentState<'a, T> {
    /// Posed positions `[V, 3]` (m).
    pub posed: &'a [[T; 3]],
    /// Canonical positions, before skinning `[V, 3]` (m).
    pub canonical: &'a [[T; 3]],
    /// Canonical positions that the holding energy measures against `[V, 3]` (m).
    pub holding_reference: &'a [[T; 3]],
    /// Reads the heights of the holding energy off posed positions `[V]`; `None`: off canonical ones.
    pub pull_back: Option<&'a [HeightRow]>,
    /// Thickness of the garments below each vertex `[V]` (m); empty: there are none.
    pub thickness_below: &'a [T],
    /// Signed distance of every contact point to the body, those of the vertices first; empty when no active term needs it.
    pub gaps: &'a [Gap<T>],
    /// Constants of the scene.
    pub settings: &'a EnergySettings,
}

/// An energy of one garment.
pub trait GarmentTerm<T>: Debug + Send + Sync {
    /// Its raw value; adds `weight·∂E/∂positions` to the target, positions being canonical for
    /// the holding energy without [`GarmentState::pull_back`], else posed.
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64;

    /// Adds a positive semidefinite approximation of its second derivatives; nothing for a term that is linear or whose
    /// second derivative has either sign everywhere.
    fn curvature(&self, _state: &GarmentState<'_, T>, _sink: &mut dyn CurvatureSink) {}
}
