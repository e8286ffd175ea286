//! Does the invariant of a case hold? Every term, value and gradient, in both precisions, against quotients and bounds.

use super::case::{DegenerateCase, Expectation};
use super::scene::{CaseError, CaseScene};
use super::suite::DegenerateCases;
use clothcombo_physics::energy::gradient_bound::gradient_bound;
use clothcombo_physics::energy::gradient_check::{
    GRADIENT_TOLERANCE, GradientCheck, check_gradient, largest_entry, raw_value, with_only,
};
use clothcombo_physics::energy::{EnergySettings, SceneEnergy, Term, TermMap};
use clothcombo_physics::{Real, TriMesh};
use serde::Serialize;

/// Largest relative difference of a value in `f32` from that in `f64`, unless it is a cancellation.
pub const SINGLE_PRECISION: f64 = 1e-3;

/// Units in the last place of the largest coordinate by which `f32` may move a vertex: what a cancellation is held to.
const ULPS: f64 = 8.0;

/// Vertices from which fewer lines are compared.
const LARGE: usize = 5000;

/// How one term fares in one case.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct TermReport {
    /// Raw value.
    pub value: f64,
    /// Raw value in `f32`.
    pub value_f32: f64,
    /// Whether values and gradients are finite in both precisions.
    pub finite: bool,
    /// Largest entry of the gradient, in either precision.
    pub largest_gradient: f64,
    /// What it may be.
    pub gradient_bound: f64,
    /// Largest error of the gradient against difference quotients, relative to the largest entry.
    pub gradient_error: f64,
    /// Error of the quotients by their own estimate, on the same scale.
    pub quotient_resolution: f64,
    /// Lines compared.
    pub lines: usize,
    /// How many of them cross a kink and were compared on both sides.
    pub kinks: usize,
    /// `|value_f32 − value|`.
    pub f32_difference: f64,
    /// What a displacement of every vertex by a few `f32` roundings of the largest coordinate does to the value.
    pub f32_rounding: f64,
    /// Largest difference of the gradients, relative to the largest entry.
    pub f32_gradient_error: f64,
}

impl TermReport {
    /// `f32_difference` relative to the value; 0 if both are 0.
    pub fn f32_relative(&self) -> f64 {
        if self.f32_difference == 0.0 { 0.0 } else { self.f32_difference / self.value.abs() }
    }

    /// Whether the value in `f32` is a difference of nearly equal numbers: off by more than a thousandth, but by no more than
    /// the rounding of the positions explains.
    pub fn cancels(&self) -> bool {
        self.f32_relative() > SINGLE_PRECISION && self.f32_difference <= self.f32_rounding
    }

    /// What is wrong, if anything is.
    pub fn fault(&self) -> Option<String> {
        if !self.finite {
            return Some("not finite".into());
        }
        // A NaN is never within a limit, hence a fault.
        let within = |value: f64, limit: f64| value <= limit;
        if !within(self.largest_gradient, self.gradient_bound) {
            return Some(format!(
                "gradient {:.3e} above its bound {:.3e}",
                self.largest_gradient, self.gradient_bound
            ));
        }
        if !within(self.gradient_error, GRADIENT_TOLERANCE) {
            return Some(format!("gradient off its difference quotients by {:.1e}", self.gradient_error));
        }
        if !within(self.f32_relative(), SINGLE_PRECISION) && !self.cancels() {
            return Some(format!("f32 off by {:.1e}", self.f32_relative()));
        }
        None
    }
}

/// What became of a case.
#[derive(Debug)]
pub enum CaseOutcome {
    /// Every term was evaluated; `None` where the scene has no such term.
    Evaluated(Box<TermMap<Option<TermReport>>>),
    /// Loading refused it.
    Refused(CaseError),
}

/// A case and what became of it.
#[derive(Debug)]
pub struct CaseReport {
    /// The case.
    pub case: DegenerateCase,
    /// Vertices of all garments; 0 if there are none.
    pub vertices: usize,
    /// What became of it.
    pub outcome: CaseOutcome,
}

impl CaseReport {
    /// Every invariant that does not hold, with its term; empty if the case is good.
    pub fn faults(&self) -> Vec<String> {
        match (&self.outcome, self.case.expectation) {
            (CaseOutcome::Evaluated(terms), Expectation::Bounded) => {
                let faults =
                    terms.iter().filter_map(|(term, report)| Some((term, report.as_ref()?.fault()?)));
                faults.map(|(term, fault)| format!("{term}: {fault}")).collect()
            }
            (CaseOutcome::Refused(error), Expectation::Refused(text)) if error.to_string().contains(text) => {
                Vec::new()
            }
            (CaseOutcome::Refused(error), _) => vec![format!("refused: {error}")],
            (CaseOutcome::Evaluated(_), Expectation::Refused(text)) => {
                vec![format!("not refused with \"{text}\"")]
            }
        }
    }
}

impl DegenerateCases<'_> {
    /// Evaluates the given terms of a case; the others are left out of the report.
    pub fn assess(&self, case: &DegenerateCase, settings: &EnergySettings, terms: &[Term]) -> CaseReport {
        let evaluated =
            self.scene(case).and_then(|scene| Ok((scene.vertex_count(), assess(&scene, settings, terms)?)));
        let (vertices, outcome) = match evaluated {
            Ok((vertices, terms)) => (vertices, CaseOutcome::Evaluated(Box::new(terms))),
            Err(error) => (0, CaseOutcome::Refused(error)),
        };
        CaseReport { case: *case, vertices, outcome }
    }
}

fn assess(
    scene: &CaseScene,
    settings: &EnergySettings,
    terms: &[Term],
) -> Result<TermMap<Option<TermReport>>, CaseError> {
    let single = Evaluated::<f32>::new(scene, settings)?;
    let double = Evaluated::<f64>::new(scene, settings)?;
    let check = match scene.vertex_count() {
        n if n >= LARGE => GradientCheck { coordinates: 1, directions: 0, ..GradientCheck::default() },
        _ => GradientCheck { coordinates: 16, directions: 3, ..GradientCheck::default() },
    };
    let rest: Vec<&TriMesh> = scene.garments.iter().map(|g| &g.garment.rest).collect();
    Ok(TermMap::from_fn(|term| {
        if !terms.contains(&term) {
            return None;
        }
        let quotients = check_gradient(&double.energy, term, &double.posed, &double.canonical, &check)?;
        let (value, gradient) = double.term(term)?;
        let (value_f32, gradient_f32) = single.term(term)?;
        let largest = largest_entry(&gradient);
        let largest_f32 = largest_entry(&gradient_f32);
        let numbers = [value, value_f32, largest, largest_f32];
        let pairs = gradient.as_flattened().iter().zip(gradient_f32.as_flattened());
        let difference = pairs.map(|(a, b)| (a - f64::from(*b)).abs()).fold(0.0, f64::max);
        let is_canonical = with_only(&double.energy, term).needs_canonical();
        let positions = if is_canonical { &double.canonical } else { &double.posed };
        let extent = positions.as_flattened().iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        let slope: f64 = gradient.as_flattened().iter().map(|g| g.abs()).sum();
        Some(TermReport {
            value,
            value_f32,
            finite: numbers.iter().all(|x| x.is_finite()),
            largest_gradient: if largest_f32 > largest { largest_f32 } else { largest },
            gradient_bound: gradient_bound(&double.energy, &rest, term, &double.posed, &double.canonical),
            gradient_error: quotients.error,
            quotient_resolution: quotients.resolution,
            lines: quotients.lines,
            kinks: quotients.nonsmooth,
            f32_difference: (value_f32 - value).abs(),
            f32_rounding: ULPS * f64::from(f32::EPSILON) * extent * slope,
            f32_gradient_error: if difference == 0.0 { 0.0 } else { difference / largest },
        })
    }))
}

/// A scene in one precision.
struct Evaluated<T: Real> {
    energy: SceneEnergy<T>,
    posed: Vec<[T; 3]>,
    canonical: Vec<[T; 3]>,
}

impl<T: Real> Evaluated<T> {
    fn new(scene: &CaseScene, settings: &EnergySettings) -> Result<Self, CaseError> {
        let energy = scene.energy(settings, TermMap::filled(0.0))?;
        Ok(Self { energy, posed: scene.posed(), canonical: scene.canonical() })
    }

    /// Raw value and gradient of one term.
    fn term(&self, term: Term) -> Option<(f64, Vec<[T; 3]>)> {
        let energy = with_only(&self.energy, term);
        let value = energy.evaluate(&self.posed, &self.canonical);
        let raw = raw_value(&value, term)?;
        Some((raw, if energy.needs_canonical() { value.canonical_gradient } else { value.posed_gradient }))
    }
}
