//! The energy of a scene as a function of posed positions alone.

use super::EquilibriumError;
use crate::energy::{BodyMemory, Creases, CurvatureSink, SceneEnergy, Term};
use crate::vec3::norm_squared;
use std::sync::{Mutex, MutexGuard};

/// A scene to be brought into equilibrium.
#[derive(Debug)]
pub struct Problem<'a> {
    energy: &'a SceneEnergy<f64>,
    /// The scene with one of its terms each, for the relative gradient.
    single_terms: Vec<SceneEnergy<f64>>,
    /// The faces of the body near every contact point where it was last looked up, and the sides of creases that it has been on.
    memory: Mutex<BodyMemory>,
}

impl<'a> Problem<'a> {
    /// The scene as it stands.
    ///
    /// # Errors
    /// When the scene does not pass its check, or a garment is held at canonical positions
    /// ([`SceneEnergy::pulled_back`] avoids that).
    pub fn new(energy: &'a SceneEnergy<f64>) -> Result<Self, EquilibriumError> {
        energy.check()?;
        if energy.needs_canonical() {
            return Err(EquilibriumError::Canonical);
        }
        let single_terms = Term::ALL.into_iter().filter_map(|term| energy.only(term)).collect();
        Ok(Self { energy, single_terms, memory: Mutex::default() })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.energy.vertex_count()
    }

    /// The scene.
    pub(super) fn energy(&self) -> &'a SceneEnergy<f64> {
        self.energy
    }

    /// Weighted sum of all energies at `posed` `[ΣV, 3]` (m).
    ///
    /// # Panics
    /// If `posed` does not have one entry per vertex.
    pub fn value(&self, posed: &[[f64; 3]]) -> f64 {
        self.energy.value(posed, &[]).total
    }

    /// The same, with its gradient `[ΣV, 3]`.
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn value_and_gradient(&self, posed: &[[f64; 3]]) -> (f64, Vec<[f64; 3]>) {
        self.evaluate(self.energy, posed)
    }

    /// `Σ_t |w_t ∇E_t|` over the terms (N): what a gradient is compared with (see [`super`]).
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn force_scale(&self, posed: &[[f64; 3]]) -> f64 {
        self.single_terms.iter().map(|energy| norm(&self.evaluate(energy, posed).1)).sum()
    }

    /// Relative gradient at `posed` (see [`super`]); 0 where no force acts at all.
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn relative_gradient(&self, posed: &[[f64; 3]]) -> f64 {
        let (_, gradient) = self.value_and_gradient(posed);
        // Of the sides that are known, and of those around, which may replace some of them.
        let known = self.residual(posed, &gradient);
        self.look_around(posed);
        relative(known.min(self.residual(posed, &gradient)), self.force_scale(posed))
    }

    /// Norm of the `gradient` at `posed`, just evaluated, that is left where the forces of all known sides of creases
    /// are combined.
    pub(super) fn residual(&self, posed: &[[f64; 3]], gradient: &[[f64; 3]]) -> f64 {
        let mut left = gradient.to_vec();
        self.creases(posed, [ON_CREASE, SEEN_HERE]).balance(&mut left);
        norm(&left)
    }

    /// Forgets what former positions were near to.
    pub(super) fn forget(&self) {
        self.memory().clear();
    }

    /// Finds the creases that points in contact at `posed`, just evaluated, lie on.
    pub(super) fn look_around(&self, posed: &[[f64; 3]]) {
        self.energy.look_around(posed, &mut self.memory(), ON_CREASE);
    }

    /// Where contact with the body at `posed`, just evaluated, is known to have sides `within` a band (m) beyond the
    /// nearest, seen no farther than a reach (m) away.
    pub(super) fn creases(&self, posed: &[[f64; 3]], within: [f64; 2]) -> Creases<'_> {
        self.energy.creases(posed, &self.memory(), within)
    }

    /// Passes a positive semidefinite approximation of the Hessian with respect to posed positions to `sink`.
    pub(super) fn curvature(&self, posed: &[[f64; 3]], sink: &mut dyn CurvatureSink) {
        self.energy.curvature(posed, &[], sink, Some(&mut self.memory()));
    }

    fn evaluate(&self, energy: &SceneEnergy<f64>, posed: &[[f64; 3]]) -> (f64, Vec<[f64; 3]>) {
        let value = energy.evaluate_near(posed, &mut self.memory());
        (value.total, value.posed_gradient)
    }

    fn memory(&self) -> MutexGuard<'_, BodyMemory> {
        self.memory.lock().expect("no evaluation panics")
    }
}

/// Distances that differ by less (m) are equal: the point is on a crease.
pub(super) const ON_CREASE: f64 = 1e-5;

/// No farther than this (m) from where it was seen a side is taken to be where its tangent plane is: over this length a
/// limb of 3 cm radius bends away by [`ON_CREASE`].
const SEEN_HERE: f64 = 8e-4;

/// `|g|/scale`, 0 for no force at all.
pub(super) fn relative(gradient_norm: f64, scale: f64) -> f64 {
    if gradient_norm == 0.0 { 0.0 } else { gradient_norm / scale }
}

/// Euclidean norm over all coordinates.
pub(super) fn norm(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|x| norm_squared(*x)).sum::<f64>().sqrt()
}
