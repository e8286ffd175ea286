//! How far a drape is from the equilibrium of its scene: energy above the minimum, and distance to the minimiser.
//!
//! The reference is the state of lowest energy that the static solver of `clothcombo_physics` finds from linear blend
//! skinning with shape transfer and, if there are networks, from their drape and from what the post-process makes of
//! it. All methods are measured by one function of posed positions ([`crate::inference::reference`]).

use crate::inference::Draped;
use crate::inference::reference::{ReferenceScene, wide};
use crate::run::validation::Method;
use clothcombo_physics::energy::Term;
use clothcombo_physics::equilibrium::{
    EquilibriumError, Problem, Progress, Solution, SolverSettings, Stop, solve,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Two minima differ when their energies do by more than this share of what the solver gained.
const SAME_MINIMUM: f64 = 1e-3;

/// How far a state is from the minimum.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StateError {
    /// Weighted sum of all energies (J).
    pub energy: f64,
    /// Above the minimum (J).
    pub excess: f64,
    /// The same in percent of what a baseline has above it.
    pub excess_percent: f64,
    /// Mean distance of the vertices to the minimiser (mm).
    pub distance_mm: f64,
}

impl StateError {
    /// Of `positions` with `energy`; the baseline has `baseline_excess` above `minimum`.
    pub fn new(energy: f64, positions: &[[f64; 3]], minimum: &Solution, baseline_excess: f64) -> Self {
        let excess = energy - minimum.energy();
        Self {
            energy,
            excess,
            excess_percent: if baseline_excess > 0.0 { 100.0 * excess / baseline_excess } else { 0.0 },
            distance_mm: 1e3 * mean_distance(positions, &minimum.positions),
        }
    }
}

/// One method on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct MethodError {
    /// Name of the method.
    pub method: String,
    /// Percent are of the excess of LBS + shape transfer.
    #[serde(flatten)]
    pub error: StateError,
    /// What every energy adds to the sum (J), by its name.
    pub terms: TermEnergies,
}

/// Weighted energies (J) by their names; those that a scene does not have are left out.
pub type TermEnergies = BTreeMap<&'static str, f64>;

/// One run of the solver.
#[derive(Clone, Debug, Serialize)]
pub struct SolverRun {
    /// Where it started.
    pub start: &'static str,
    /// Energy at the end (J).
    pub energy: f64,
    /// What every energy adds to it (J).
    pub terms: TermEnergies,
    /// Why it stopped there.
    pub stop: &'static str,
    /// Relative gradient at the end.
    pub relative_gradient: f64,
    /// Gradient at the end over that at the start.
    pub gradient_ratio: f64,
    /// Accepted steps.
    pub iterations: usize,
    /// Evaluations of value and gradient.
    pub evaluations: usize,
    /// Wall time (s).
    pub seconds: f64,
}

/// What one scene shows.
#[derive(Clone, Debug, Serialize)]
pub struct SceneError {
    /// Number of the scene.
    pub scene: usize,
    /// Garments, inner → outer.
    pub garments: Vec<String>,
    /// Their vertices.
    pub vertices: usize,
    /// All methods.
    pub methods: Vec<MethodError>,
    /// All runs of the solver; the first is from LBS + shape transfer.
    pub runs: Vec<SolverRun>,
    /// Which run ended lowest: the reference.
    pub reference: usize,
    /// Whether the runs ended in minima of different energy.
    pub minima_differ: bool,
    /// Strain of every garment, inner → outer; of a scene of several garments only.
    pub layers: Vec<LayerStrain>,
}

/// What networks make of a scene, `[ΣV, 3]` (m) each.
pub struct Drapes {
    /// Single garments.
    pub single_garments: Vec<[f64; 3]>,
    /// After untangling.
    pub layered: Vec<[f64; 3]>,
    /// After the post-process, if it was run.
    pub resolved: Option<Vec<[f64; 3]>>,
}

impl Drapes {
    /// Of networks, and what the post-process made of it.
    pub fn new(single_garments: &Draped, layered: &Draped, resolved: Option<Vec<[f64; 3]>>) -> Self {
        let [single_garments, layered] = [single_garments, layered].map(|draped| wide(&draped.posed));
        Self { single_garments, layered, resolved }
    }
}

/// Strain of one garment of an outfit (J).
#[derive(Clone, Debug, Serialize)]
pub struct LayerStrain {
    /// As a single garment, in the equilibrium that was found.
    pub single_garment: f64,
    /// In the reference of the outfit.
    pub outfit: f64,
    /// Draped by the networks, as a single garment and in the outfit.
    pub network: Option<[f64; 2]>,
}

impl SceneError {
    /// The run that made the reference.
    pub fn reference_run(&self) -> &SolverRun {
        &self.runs[self.reference]
    }

    /// Whether the networks end above skinning, with or without shape transfer, by more than the rounding of positions in f32;
    /// `None` without networks.
    pub fn is_above_skinning(&self) -> Option<bool> {
        let energy = |name: &str| Some(self.methods.iter().find(|m| m.method == name)?.error.energy);
        let (network, skinning) = (energy(NETWORK)?, energy(START)?.min(energy(Method::Lbs.name())?));
        Some(network - skinning > ROUNDING * skinning.abs().max(1.0))
    }
}

/// Relative difference of energies at positions that were rounded to f32 (measured: at most 4e-7).
const ROUNDING: f64 = 1e-5;

const NETWORK: &str = Method::Network.name();
/// Name of the skinning that the networks start from in reports.
pub const START: &str = Method::LbsWithShapeTransfer.name();

/// Solves `scene` from LBS + shape transfer and from `network`'s drape, and measures every method against the lower end.
///
/// # Errors
/// When the scene cannot be solved at all: its skinning is singular, or its energy is not finite at a start.
pub fn scene_error(
    number: usize,
    scene: &ReferenceScene,
    network: Option<&Drapes>,
    settings: &SolverSettings,
    observer: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<SceneError, EquilibriumError> {
    let problem = Problem::new(&scene.energy)?;
    let mut states =
        vec![(Method::Lbs.name(), scene.skinned_rest.clone()), (START, scene.skinned_start.clone())];
    states.extend(network.map(|drapes| (NETWORK, drapes.layered.clone())));
    let resolved = network.and_then(|drapes| drapes.resolved.clone());
    states.extend(resolved.map(|resolved| ("network + post-process", resolved)));

    let mut solutions: Vec<(&'static str, Solution)> = Vec::new();
    for (method, start) in &states[1..] {
        solutions.push((method, solve(&problem, start, settings, observer)?));
    }
    let reference = lowest(&solutions);
    let minimum = &solutions[reference].1;
    let gained = solutions[0].1.history[0].energy - minimum.energy();

    let measure = |(method, positions): &(&str, Vec<[f64; 3]>)| {
        let (energy, terms) = problem.terms(positions);
        MethodError {
            method: (*method).to_owned(),
            error: StateError::new(energy, positions, minimum, gained),
            terms,
        }
    };
    let methods = states.iter().map(measure).collect();
    let differ = |s: &Solution| s.energy() - minimum.energy() > SAME_MINIMUM * gained;
    Ok(SceneError {
        scene: number,
        garments: scene.garments.clone(),
        vertices: problem.vertex_count(),
        methods,
        minima_differ: solutions.iter().any(|(_, s)| differ(s)),
        reference,
        runs: solutions.iter().map(|(start, s)| solver_run(&problem, start, s)).collect(),
        layers: layer_strains(scene, &minimum.positions, network, settings, observer)?,
    })
}

/// Which solution has the lowest energy.
fn lowest(solutions: &[(&'static str, Solution)]) -> usize {
    let energies = solutions.iter().map(|(_, s)| s.energy());
    energies.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).expect("there is a run from skinning").0
}

/// Strain of every garment in the outfit at `minimum`, and as a single garment in the equilibrium found for it.
fn layer_strains(
    scene: &ReferenceScene,
    minimum: &[[f64; 3]],
    network: Option<&Drapes>,
    settings: &SolverSettings,
    observer: &mut dyn FnMut(&Progress<'_>) -> ControlFlow<()>,
) -> Result<Vec<LayerStrain>, EquilibriumError> {
    if scene.energy.garments.len() < 2 {
        return Ok(Vec::new());
    }
    let single_garments = scene.energy.without_layers();
    let problem = Problem::new(&single_garments)?;
    let mut solutions = vec![(START, solve(&problem, &scene.skinned_start, settings, observer)?)];
    if let Some(drapes) = network {
        solutions.push((NETWORK, solve(&problem, &drapes.single_garments, settings, observer)?));
    }
    let strain = |positions: &[[f64; 3]]| -> Vec<f64> {
        let raw = single_garments.raw(positions, positions).garments;
        raw.iter().map(|terms| terms[Term::Strain].unwrap_or(0.0)).collect()
    };
    let [outfit, single_garment] = [minimum, &solutions[lowest(&solutions)].1.positions].map(strain);
    let drapes = network.map(|drapes| [&drapes.single_garments, &drapes.layered].map(|d| strain(d)));
    let layer = |g: usize| LayerStrain {
        single_garment: single_garment[g],
        outfit: outfit[g],
        network: drapes.as_ref().map(|drapes| drapes.each_ref().map(|strains| strains[g])),
    };
    Ok((0..outfit.len()).map(layer).collect())
}

fn solver_run(problem: &Problem<'_>, start: &'static str, solution: &Solution) -> SolverRun {
    let (first, last) = (&solution.history[0], solution.last());
    SolverRun {
        start,
        energy: last.energy,
        terms: problem.terms(&solution.positions).1,
        stop: solution.stop.name(),
        relative_gradient: solution.relative_gradient,
        gradient_ratio: match first.gradient_norm > 0.0 {
            true => last.gradient_norm / first.gradient_norm,
            false => 0.0,
        },
        iterations: solution.iterations(),
        evaluations: last.evaluations,
        seconds: 1e-3 * last.milliseconds,
    }
}

/// Whether a run ended in an equilibrium.
pub fn converged(run: &SolverRun) -> bool {
    run.stop == Stop::Converged.name()
}

/// Mean distance of two states of the same vertices (m).
pub fn mean_distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let sum: f64 =
        a.iter().zip(b).map(|(a, b)| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()).sum();
    sum / a.len().max(1) as f64
}
