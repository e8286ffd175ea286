//! When to stop, and how far to go in one step.

use std::time::Duration;

use super::EquilibriumError;

/// Settings of [`super::solve`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// Converged at or below this relative gradient (see [`super`]).
    pub tolerance: f64,
    /// Most iterations: accepted steps.
    pub iterations: usize,
    /// Most wall time; `None`: no limit. Looked at between iterations.
    pub time: Option<Duration>,
    /// No vertex moves farther than this in one step (m). Default 5 cm: a garment stays in its valley instead of jumping
    /// through the body.
    pub step_bound: f64,
    /// No vertex goes farther than this from its start (m), but for the step that leads there; `None`: no bound. Where
    /// the bound is passed the solver stops as [`super::Stop::Escaped`]. Default 1 m: what nothing holds falls for
    /// ever.
    pub escape_distance: Option<f64>,
    /// Steps make no triangles intersect, and leave elements this far apart (m), or half as far as they are; `None`:
    /// nobody looks.
    pub margin: Option<f64>,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-4,
            iterations: 500,
            time: None,
            step_bound: 0.05,
            escape_distance: Some(1.0),
            margin: None,
        }
    }
}

impl SolverSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// [`EquilibriumError::Setting`] names the first that is out of range.
    pub fn check(&self) -> Result<(), EquilibriumError> {
        let fail = |setting, value, expected| Err(EquilibriumError::Setting { setting, value, expected });
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return fail("tolerance", self.tolerance, "finite and not negative");
        }
        let escape = self.escape_distance.unwrap_or(1.0);
        let margin = self.margin.unwrap_or(1.0);
        for (setting, value) in
            [("step_bound", self.step_bound), ("escape_distance", escape), ("margin", margin)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return fail(setting, value, "finite and greater than 0");
            }
        }
        Ok(())
    }
}
