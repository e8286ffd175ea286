//! Speed against error: time per drape against energy above the converged minimum and distance to it.

use super::estimate::Estimate;
use super::subject::Subject;
use super::table::{Table, number};
use crate::dataset::{HeldOut, PreparedScene};
use crate::evaluation::certificates::Dressing;
use crate::evaluation::equilibrium_error::mean_distance;
use crate::evaluation::median_ms;
use crate::inference::reference::ReferenceScene;
use crate::inference::refine;
use crate::inference::tensor_store::DrapeError;
use crate::picture::{Line, LinePanel};
use crate::system::single_threaded::map_single_threaded;
use clothcombo_physics::contact::resolve::ResolveSettings;
use clothcombo_physics::energy::Term;
use clothcombo_physics::equilibrium::{Problem, SolverSettings, solve};
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;
use std::ops::ControlFlow;
use std::time::Instant;

/// Iterations of the solver from LBS.
const SOLVER: [usize; 5] = [10, 30, 100, 300, 1000];
/// Steps of the refinement of the networks' drape.
const REFINEMENT: [usize; 3] = [10, 30, 100];
/// Repetitions of a fast method last this long [s].
const SECONDS: f64 = 0.05;

/// One method on one scene.
#[derive(Clone, Debug, Serialize)]
pub struct Sample {
    /// Its name.
    pub method: String,
    /// Wall time of a drape [ms].
    pub ms: f64,
    /// Weighted sum of all energies [J].
    pub energy: f64,
    /// Above the minimum [J].
    pub excess: f64,
    /// The same in percent of what LBS of the rest garment has above it.
    pub excess_percent: f64,
    /// Mean distance of the vertices to the minimiser [mm].
    pub distance_mm: f64,
    /// Strain [J].
    pub strain: f64,
}

/// One method over all scenes.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Its name.
    pub method: String,
    /// Wall time of a drape [ms].
    pub ms: Estimate,
    /// Energy above the minimum [J].
    pub excess: Estimate,
    /// The same in percent of what LBS of the rest garment has above it.
    pub excess_percent: Estimate,
    /// Mean distance of the vertices to the minimiser [mm].
    pub distance_mm: Estimate,
    /// Strain [J].
    pub strain: Estimate,
    /// Whether no other method is both faster and nearer to the minimum in energy, by medians.
    pub on_front: bool,
}

/// All methods.
#[derive(Clone, Debug, Serialize)]
pub struct Pareto {
    /// Number of scenes.
    pub scenes: usize,
    /// How many of the reference solutions converged (relative gradient within the solver's tolerance).
    pub converged: usize,
    /// All methods.
    pub points: Vec<Point>,
    /// Every scene.
    pub samples: Vec<Vec<Sample>>,
}

/// A state of the garments, how long it took, and its energy.
struct State {
    method: String,
    ms: f64,
    positions: Vec<[f64; 3]>,
    energy: f64,
}

/// Asks all methods for `scenes` scenes of one garment. The networks are timed with all cores, one scene at a time; the solver
/// and the refinement on one core per scene.
///
/// # Errors
/// When a scene cannot be draped, or has no finite energy.
pub fn ask(
    subject: &Subject,
    question: usize,
    scenes: usize,
    settings: &ResolveSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Pareto, Report> {
    let all: Vec<usize> = (0..subject.dataset.garments.len()).collect();
    let mut drapes = Vec::with_capacity(scenes);
    for index in 0..scenes {
        let draw = subject.draw([question, index], &all, 1, HeldOut::Windows);
        let scene = subject.prepare(draw)?;
        let fast = fast_methods(subject, &scene, settings)?;
        drapes.push((scene, fast));
    }
    let solved = map_single_threaded(drapes, None, |(scene, fast)| {
        let found = solved(subject, &scene, fast);
        done();
        found
    })?;
    let converged = solved.iter().filter(|(_, converged)| *converged).count();
    let samples: Vec<Vec<Sample>> = solved.into_iter().map(|(samples, _)| samples).collect();
    Ok(Pareto { scenes, converged, points: points(&samples), samples })
}

/// Skinning, networks, networks with post-process; energies are measured later.
fn fast_methods(
    subject: &Subject,
    scene: &PreparedScene,
    settings: &ResolveSettings,
) -> Result<Vec<State>, Report> {
    let networks = subject.networks();
    let wide = |positions: &[[f32; 3]]| positions.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
    let state = |method: &str, ms: f64, positions: Vec<[f64; 3]>| State {
        method: method.to_owned(),
        ms,
        positions,
        energy: f64::NAN,
    };
    let rest_ms = median_ms(SECONDS, || networks.skin_rest(scene))?;
    let skin_ms = median_ms(SECONDS, || networks.skin(scene))?;
    let mut states = vec![
        state("LBS of rest", rest_ms, wide(&networks.skin_rest(scene)?.posed)),
        state("LBS", skin_ms, wide(&networks.skin(scene)?.posed)),
    ];
    let measured = |corrections: usize| {
        let networks = subject.networks_with(corrections);
        // The garment is embedded in the first, unmeasured drape, as for the next frame of a motion.
        let ms = median_ms(SECONDS, || networks.drape(scene))?;
        Ok::<_, DrapeError>((ms, networks.drape(scene)?))
    };
    let all = subject.model.correction_steps;
    for corrections in 0..all {
        let (ms, draped) = measured(corrections)?;
        let name = match corrections {
            0 => "network, uncorrected".to_owned(),
            1 => "network, 1 correction".to_owned(),
            _ => format!("network, {corrections} corrections"),
        };
        states.push(state(&name, ms, wide(&draped.posed)));
    }
    let (network_ms, draped) = measured(all)?;
    states.push(state("network", network_ms, wide(&draped.posed)));
    let dressing = Dressing::new(&subject.dataset, &subject.config.losses, Some(&networks));
    let before = dressing.of(scene, &draped.posed);
    // Once: it may take seconds.
    let clock = Instant::now();
    let mut resolved = before.resolved(settings)?.positions;
    let post_ms = 1e3 * clock.elapsed().as_secs_f64();
    let resolved = resolved.pop().ok_or_else(|| miette!("a scene without a garment"))?;
    states.push(state("network + post-process", network_ms + post_ms, resolved));
    Ok(states)
}

/// Adds refinement and solver to the fast methods, and measures all of them against the lowest state found; also whether
/// that state is an equilibrium.
fn solved(
    subject: &Subject,
    scene: &PreparedScene,
    mut states: Vec<State>,
) -> Result<(Vec<Sample>, bool), Report> {
    let reference = ReferenceScene::new(&subject.config.losses, scene).into_diagnostic()?;
    let problem = Problem::new(&reference.energy).into_diagnostic()?;
    states.iter_mut().for_each(|s| s.energy = problem.value(&s.positions));
    let find = |name: &str| states.iter().find(|s| s.method == name).expect("it is a fast method");
    let (network, lbs) = (find("network"), find("LBS"));
    let (network_start, network_ms, skin_ms) = (network.positions.clone(), network.ms, lbs.ms);
    for steps in REFINEMENT {
        let clock = Instant::now();
        let (positions, done) = refine(&reference.energy, &network_start, steps).into_diagnostic()?;
        let ms = network_ms + 1e3 * clock.elapsed().as_secs_f64();
        states.push(State {
            method: format!("network + {steps} steps"),
            ms,
            positions,
            energy: done.energy_after,
        });
    }
    let settings = SolverSettings::default();
    let mut passed: Vec<State> = Vec::new();
    let from_lbs = solve(&problem, &reference.skinned_start, &settings, &mut |progress| {
        let step = progress.step;
        if SOLVER.get(passed.len()).is_some_and(|&next| step.iteration >= next) {
            passed.push(State {
                method: String::new(),
                ms: skin_ms + step.milliseconds,
                positions: progress.positions.to_vec(),
                energy: step.energy,
            });
        }
        ControlFlow::Continue(())
    })
    .into_diagnostic()?;
    // A solver that is done early has nothing better to offer for more iterations.
    while passed.len() < SOLVER.len() {
        let last = from_lbs.last();
        passed.push(State {
            method: String::new(),
            ms: skin_ms + last.milliseconds,
            positions: from_lbs.positions.clone(),
            energy: last.energy,
        });
    }
    for (state, iterations) in passed.iter_mut().zip(SOLVER) {
        state.method = format!("solver, {iterations} iterations");
    }
    states.append(&mut passed);
    let from_network =
        solve(&problem, &network_start, &settings, &mut |_| ControlFlow::Continue(())).into_diagnostic()?;
    let minimum = if from_network.energy() < from_lbs.energy() { &from_network } else { &from_lbs };
    let worst = find_energy(&states, "LBS of rest") - minimum.energy();
    let samples = states
        .into_iter()
        .map(|s| Sample {
            distance_mm: 1e3 * mean_distance(&s.positions, &minimum.positions),
            excess: s.energy - minimum.energy(),
            excess_percent: if worst > 0.0 { 100.0 * (s.energy - minimum.energy()) / worst } else { 0.0 },
            strain: reference.energy.raw(&s.positions, &s.positions).garments[0][Term::Strain].unwrap_or(0.0),
            method: s.method,
            ms: s.ms,
            energy: s.energy,
        })
        .collect();
    Ok((samples, minimum.relative_gradient <= settings.tolerance))
}

fn find_energy(states: &[State], method: &str) -> f64 {
    states.iter().find(|s| s.method == method).map_or(f64::NAN, |s| s.energy)
}

fn points(samples: &[Vec<Sample>]) -> Vec<Point> {
    let Some(first) = samples.first() else { return Vec::new() };
    let over = |i: usize, f: fn(&Sample) -> f64| {
        Estimate::of(&samples.iter().map(|scene| f(&scene[i])).collect::<Vec<f64>>())
    };
    let mut points: Vec<Point> = (0..first.len())
        .map(|i| Point {
            method: first[i].method.clone(),
            ms: over(i, |s| s.ms),
            excess: over(i, |s| s.excess),
            excess_percent: over(i, |s| s.excess_percent),
            distance_mm: over(i, |s| s.distance_mm),
            strain: over(i, |s| s.strain),
            on_front: false,
        })
        .collect();
    let places: Vec<[f64; 2]> = points.iter().map(|p| [p.ms.spread.median, p.excess.spread.median]).collect();
    for (point, own) in points.iter_mut().zip(&places) {
        point.on_front = !places.iter().any(|other| other[0] < own[0] && other[1] < own[1]);
    }
    points
}

impl Pareto {
    /// As a table.
    pub fn table(&self) -> Table {
        let mut table = Table::new(
            format!("Speed against error over {} scenes of one garment", self.scenes),
            &[
                "method",
                "time [ms]",
                "excess energy [J]",
                "excess [% of LBS of rest]",
                "distance [mm]",
                "strain [J]",
                "on the front",
            ],
        )
        .with_note(format!(
            "Medians [95 % interval of the mean]. Excess and distance: to the lowest state that the solver found from LBS or \
             from the network, {} of {} of them equilibria. Networks on {} threads, solver and refinement on one.",
            self.converged,
            self.scenes,
            rayon::current_num_threads()
        ));
        let cell = |e: &Estimate| {
            format!("{} [{}, {}]", number(e.spread.median), number(e.interval[0]), number(e.interval[1]))
        };
        for p in &self.points {
            let mut row = vec![p.method.clone()];
            row.extend([&p.ms, &p.excess, &p.excess_percent, &p.distance_mm, &p.strain].map(cell));
            row.push(if p.on_front { "yes" } else { "no" }.to_owned());
            table.rows.push(row);
        }
        table
    }

    /// As charts: excess energy and distance over time, both medians.
    pub fn panels(&self) -> Vec<LinePanel> {
        let families: [(&str, fn(&str) -> bool); 3] = [
            ("LBS", |m| m.starts_with("LBS")),
            ("network, post-process, refinement", |m| m.starts_with("network")),
            ("solver from LBS", |m| m.starts_with("solver")),
        ];
        let panel = |title: &str, value: fn(&Point) -> f64| LinePanel {
            title: title.to_owned(),
            lines: families
                .iter()
                .map(|(name, belongs)| {
                    let family = self.points.iter().filter(|p| belongs(&p.method));
                    let mut points: Vec<_> = family.map(|p| (p.ms.spread.median, value(p))).collect();
                    // More steps may take no longer; a line that turns back is drawn with spikes.
                    points.sort_by(|a, b| a.0.total_cmp(&b.0));
                    Line { name: (*name).to_owned(), points }
                })
                .collect(),
        };
        vec![
            panel("excess energy [%] over time [ms]", |p| p.excess_percent.spread.median),
            panel("distance [mm] over time [ms]", |p| p.distance_mm.spread.median),
        ]
    }
}
