//! Warnings about inputs that can be draped.

use super::Draper;
use super::error::DraperError;
use super::source::GivenGarment;
use clothcombo_data::asset::{Garment, Pose, infeasible_pair};
use clothcombo_data::check::{impossible_turn, not_radians, not_upright};

pub(super) fn warn_about_shape(shape: &[f64], [low, high]: [f64; 2]) {
    if let Some(value) = shape.iter().find(|value| !(low..=high).contains(*value)) {
        tracing::warn!("shape parameter {value}: the model was trained with {low} to {high}");
    }
}

/// Warns of garments that cannot lie over those under them.
pub fn warn_about_order(sources: &[GivenGarment]) {
    let order: Vec<&Garment> = sources.iter().map(|source| &source.garment).collect();
    if let Some([inner, outer]) = infeasible_pair(&order) {
        tracing::warn!(
            "{} does not fit over {}, which hangs between the legs: they will intersect at the crotch",
            outer.name,
            inner.name
        );
    }
}

impl Draper {
    /// Logs which garments are not made of what the model was trained on.
    pub fn log_materials(&self, sources: &[GivenGarment]) {
        let trained = &self.trained.config.losses.material;
        let differ = |source: &&GivenGarment| !source.garment.material.is_empty();
        for source in sources.iter().filter(differ) {
            tracing::info!(
                "{} is made of {}; the networks, which see only the thickness below a garment, were trained with thickness={}, density={}, lambda={}, \
                 mu={}, bending_stiffness={}",
                source.garment.name,
                source.garment.material,
                trained.thickness,
                trained.density,
                trained.lambda,
                trained.mu,
                trained.bending_stiffness
            );
        }
    }
}

/// Logs what fitting assumed and repaired; warns where it has doubts.
pub fn log_repairs(source: &GivenGarment) {
    let Some(fit) = &source.fit else { return };
    let name = &source.garment.name;
    tracing::info!("{name} fitted: {}", fit.assumptions().join("; "));
    for repair in &fit.repairs {
        tracing::info!("{name} repaired: {} ({})", repair.kind.text(), repair.count);
    }
    for doubt in &fit.doubts {
        tracing::warn!("{name}: {doubt}");
    }
    if let Some(misfit) = fit.misfit() {
        tracing::warn!("{name} does not fit this body: {misfit} Look at the picture.");
    }
}

/// Warns about poses that no person takes.
pub(super) fn check_poses(poses: &[Pose], of: &str) -> Result<(), DraperError> {
    if let Some(why) = not_radians(poses) {
        return Err(DraperError::NotRadians { of: of.to_owned(), why });
    }
    for warning in [impossible_turn(poses), not_upright(poses)].into_iter().flatten() {
        tracing::warn!("{of}: {warning}");
    }
    Ok(())
}
