//! Garments and bodies are checked before anything is draped; what is unusual about them is logged.

use super::bodies::{Bodies, BodyState, check_body_mesh};
use super::draper::Draper;
use super::embedded::MAX_DRAPED_VERTICES;
use super::source::GivenGarment;
use clothcombo_data::asset::{Garment, Pose, PosedBody, infeasible_pair};
use clothcombo_data::check::{impossible_turn, not_radians, not_upright};
use miette::{IntoDiagnostic, Report, miette};

/// Most garments of an outfit.
pub const MAX_GARMENTS: usize = 12;
/// Shape parameters are standard deviations: with a larger one there is no body any more.
pub const MOST_SHAPE: f64 = 20.0;

impl Draper {
    /// Whether `garments` can be an outfit: what [`outfit`](Self::outfit) would say, at once. Logs what fitting assumed and
    /// repaired and what they are made of; warns where they hardly fit the body or each other.
    ///
    /// # Errors
    /// When they are too many or too large.
    pub fn check_garments(&self, garments: &[GivenGarment]) -> Result<(), Report> {
        check_sizes(garments)?;
        garments.iter().for_each(log_repairs);
        self.log_materials(garments);
        warn_about_order(garments);
        Ok(())
    }

    /// Whether `bodies` can be dressed; what is unusual about them is logged as a warning.
    ///
    /// # Errors
    /// When shape, pose or surface do not fit the body model, or angles cannot be in radians.
    pub fn check_bodies(&self, bodies: &Bodies) -> Result<(), Report> {
        let of = &bodies.report.pose;
        // The frames of a motion are alike in what may be wrong with them.
        if let Some(state) = bodies.states.first() {
            self.posed(state)?;
            state.surface.as_deref().map_or(Ok(()), |given| check_body_mesh(self.body(), of, given))?;
        }
        let [low, high] = self.trained.config.data.shape_range;
        if let Some(value) = bodies.report.shape.iter().find(|value| !(low..=high).contains(*value)) {
            tracing::warn!("shape parameter {value}: the model was trained with {low} to {high}");
        }
        let poses: Vec<Pose> = bodies.states.iter().map(|state| state.pose.clone()).collect();
        if let Some(why) = not_radians(&poses) {
            return Err(miette!(
                help = "convert them to radians; `clothcombo check` looks at motion files",
                "{of}: {why}"
            ));
        }
        for warning in [impossible_turn(&poses), not_upright(&poses)].into_iter().flatten() {
            tracing::warn!("{of}: {warning}");
        }
        Ok(())
    }

    /// The shape with all its parameters, and the body model's own surface.
    pub(super) fn posed(&self, body: &BodyState) -> Result<(Vec<f64>, PosedBody), Report> {
        let mut shape = body.shape.clone();
        check_finite("shape", &shape)?;
        if let Some(value) = shape.iter().find(|x| x.abs() > MOST_SHAPE) {
            return Err(miette!(
                "shape parameter {value} makes no body: at most {MOST_SHAPE}, models are trained with about 2"
            ));
        }
        // Longer ones are refused by the body, by name.
        shape.resize(shape.len().max(self.body().shape_count), 0.0);
        check_finite("pose", body.pose.rotations.as_flattened().iter().chain(&body.place))?;
        let posed = self.body().posed(&shape, &body.pose).into_diagnostic()?;
        Ok((shape, posed))
    }

    /// Logs which garments are not made of what the model was trained on.
    fn log_materials(&self, garments: &[GivenGarment]) {
        let trained = &self.trained.config.losses.material;
        for Garment { name, material, .. } in garments.iter().map(|source| &source.garment) {
            if !material.is_empty() {
                tracing::info!(
                    "{name} is made of {material}; the networks, which see only the thickness below a garment, were trained \
                     with thickness={}, density={}, lambda={}, mu={}, bending_stiffness={}",
                    trained.thickness,
                    trained.density,
                    trained.lambda,
                    trained.mu,
                    trained.bending_stiffness
                );
            }
        }
    }
}

fn check_finite<'a>(what: &str, numbers: impl IntoIterator<Item = &'a f64>) -> Result<(), Report> {
    match numbers.into_iter().all(|x| x.is_finite()) {
        true => Ok(()),
        false => Err(miette!("the {what} holds a number that is not finite")),
    }
}

/// Whether `garments` are few and small enough to be an outfit.
pub(super) fn check_sizes(garments: &[GivenGarment]) -> Result<(), Report> {
    let count = garments.len();
    if count == 0 || count > MAX_GARMENTS {
        return Err(miette!("{count} garments; an outfit has 1 to {MAX_GARMENTS}"));
    }
    for Garment { name, rest, .. } in garments.iter().map(|source| &source.garment) {
        let vertices = rest.vertex_count();
        if vertices > MAX_DRAPED_VERTICES {
            return Err(miette!(
                help = "decimate it first: the networks see no detail of a millimetre",
                "garment '{name}' has {vertices} vertices, more than {MAX_DRAPED_VERTICES} can be draped at once"
            ));
        }
    }
    Ok(())
}

/// Warns of garments that cannot lie over those under them.
fn warn_about_order(garments: &[GivenGarment]) {
    let order: Vec<&Garment> = garments.iter().map(|source| &source.garment).collect();
    if let Some([inner, outer]) = infeasible_pair(&order) {
        tracing::warn!(
            "{} does not fit over {}, which hangs between the legs: they will intersect at the crotch",
            outer.name,
            inner.name
        );
    }
}

/// Logs what fitting assumed and repaired; warns where it has doubts.
fn log_repairs(source: &GivenGarment) {
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
