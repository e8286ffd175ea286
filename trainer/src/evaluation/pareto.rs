//! Speed against error: time per drape against energy above the converged minimum and distance to it.

use super::equilibrium_error::StateError;
use super::page::Picture;
use super::table::{Column, median_with_interval, plain};
use super::{Estimate, Evaluator, Metric, ModelUnderTest, Section, Table, drape_by, median_ms};
use crate::dataset::PreparedScene;
use crate::inference::networks::Networks;
use crate::inference::reference::{ReferenceScene, wide};
use crate::inference::tensor_store::DrapeError;
use crate::inference::{RefineSteps, refine};
use crate::picture::chart::{Chart, ChartGrid, Line};
use crate::picture::png_bytes;
use crate::run::validation::Method;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_physics::energy::Term;
use clothcombo_physics::equilibrium::{Problem, SolverSettings, solve};
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use serde_json::{Value, json};
use std::ops::ControlFlow;
use std::time::Instant;

/// Steps of the solver from LBS + shape transfer.
const SOLVER: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Steps of the refinement of the networks' drape.
const REFINEMENT: [usize; 4] = [1, 2, 4, 8];
/// Repetitions of a fast method last this long (s).
const SECONDS: f64 = 0.05;

/// One method on one scene.
#[derive(Serialize)]
struct MethodSample {
    method: String,
    /// Wall time of a drape (ms).
    milliseconds: f64,
    /// Percent are of the excess of LBS.
    #[serde(flatten)]
    error: StateError,
    /// Strain (J).
    strain: f64,
}

/// What is estimated of a method.
const METRICS: [Metric<MethodSample>; 5] = [
    ("milliseconds", |s| s.milliseconds),
    ("excess", |s| s.error.excess),
    ("excess_percent", |s| s.error.excess_percent),
    ("distance_mm", |s| s.error.distance_mm),
    ("strain", |s| s.strain),
];

/// A state of the garments, and how long it took.
struct State {
    method: String,
    milliseconds: f64,
    positions: Vec<[f64; 3]>,
}

/// Scenes of one garment draped by all methods. The networks are timed with all threads, one scene at a time; the solver and the
/// refinement on one thread per scene.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let Evaluator { model, counts, .. } = *evaluator;
    let draped = |index: usize| {
        let scene = model.prepare(&model.sample_outfit([7, index], 1))?;
        let states = fast_methods(evaluator, &scene)?;
        Ok::<_, Report>((scene, states))
    };
    let draped = (0..counts.pareto).map(draped).collect::<Result<Vec<_>, _>>()?;
    let solved = map_single_threaded(draped, None, |(scene, states)| {
        let solved = solved(model, &scene, states);
        evaluator.scene_done();
        solved
    })?;
    let (samples, are_equilibria): (Vec<_>, Vec<bool>) = solved.into_iter().unzip();
    let converged = are_equilibria.into_iter().filter(|is_equilibrium| *is_equilibrium).count();
    let points = points(&samples);
    let table = table(&points, counts.pareto).with_note(format!(
        "Medians [95 % interval of the mean]. Excess and distance: to the lowest state that the solver found from LBS + shape \
         transfer or from the network, {converged} of {} of them equilibria. Networks on {} threads, solver and refinement on one.",
        counts.pareto,
        rayon::current_num_threads()
    ));
    let charts = charts(&points);
    let numbers = json!({
        "scenes": counts.pareto,
        // How many of the reference solutions did (relative gradient within the solver's tolerance).
        "converged": converged,
        "points": points,
        "samples": samples,
    });
    let mut section = Section::new("pareto", "Speed against error", "", numbers, vec![table]);
    section.pictures.push(Picture {
        file: "pareto.png".into(),
        caption: "Medians; down and to the left is better.".into(),
        png: png_bytes(&charts.draw()).into_diagnostic()?,
        svg: Some(charts.svg()),
    });
    Ok(vec![section])
}

/// Skinning, networks, networks with post-process.
fn fast_methods(evaluator: &Evaluator<'_>, scene: &PreparedScene) -> Result<Vec<State>, Report> {
    let Evaluator { model, networks, post_process, settings, .. } = evaluator;
    // The garment is embedded in the first, unmeasured drape, as for the next frame of a motion.
    let timed = |name: String, method: Method, networks: &Networks<'_>| -> Result<State, DrapeError> {
        let milliseconds = median_ms(SECONDS, || drape_by(networks, &[method], scene))?;
        let positions = wide(&drape_by(networks, &[method], scene)?[0].posed);
        Ok(State { method: name, milliseconds, positions })
    };
    let mut states = Vec::new();
    for method in [Method::Lbs, Method::LbsWithShapeTransfer] {
        states.push(timed(method.name().to_owned(), method, networks)?);
    }
    for corrections in 0..model.model.correction_steps {
        let name = match corrections {
            0 => "network, uncorrected".to_owned(),
            1 => "network, 1 correction".to_owned(),
            _ => format!("network, {corrections} corrections"),
        };
        states.push(timed(name, Method::Network, &networks.with_correction_steps(corrections))?);
    }
    let network = timed(Method::Network.name().to_owned(), Method::Network, networks)?;
    let draped = networks.drape(scene)?;
    // Once: it may take seconds.
    let clock = Instant::now();
    let resolved = post_process.of(scene, &draped.posed).resolved(settings)?.positions.concat();
    let milliseconds = network.milliseconds + 1e3 * clock.elapsed().as_secs_f64();
    states.push(network);
    states.push(State { method: "network + post-process".into(), milliseconds, positions: resolved });
    Ok(states)
}

/// Adds refinement and solver to the fast methods, and measures all of them against the lowest state found; also whether
/// that state is an equilibrium.
fn solved(
    model: &ModelUnderTest,
    scene: &PreparedScene,
    mut states: Vec<State>,
) -> Result<(Vec<MethodSample>, bool), Report> {
    let reference = ReferenceScene::new(&model.config.losses, scene).into_diagnostic()?;
    let problem = Problem::new(&reference.energy).into_diagnostic()?;
    let of = |method: Method| {
        let state = states.iter().find(|state| state.method == method.name()).expect("it is a fast method");
        (state.positions.clone(), state.milliseconds)
    };
    let (lbs, _) = of(Method::Lbs);
    let (_, start_milliseconds) = of(Method::LbsWithShapeTransfer);
    let (network, network_milliseconds) = of(Method::Network);
    for steps in REFINEMENT {
        let clock = Instant::now();
        let (positions, _) =
            refine(&reference.energy, &network, RefineSteps::AtMost(steps)).into_diagnostic()?;
        let milliseconds = network_milliseconds + 1e3 * clock.elapsed().as_secs_f64();
        states.push(State {
            method: format!("network + {steps} {}", if steps == 1 { "step" } else { "steps" }),
            milliseconds,
            positions,
        });
    }
    let settings = SolverSettings::default();
    let mut iterations = SOLVER.into_iter().peekable();
    let mut add = |iterations: usize, milliseconds: f64, positions: &[[f64; 3]]| {
        states.push(State {
            method: format!("solver, {iterations} {}", if iterations == 1 { "step" } else { "steps" }),
            milliseconds: start_milliseconds + milliseconds,
            positions: positions.to_vec(),
        });
    };
    let from_start = solve(&problem, &reference.skinned_start, &settings, &mut |progress| {
        if let Some(reached) = iterations.next_if(|&next| progress.step.iteration >= next) {
            add(reached, progress.step.milliseconds, progress.positions);
        }
        ControlFlow::Continue(())
    })
    .into_diagnostic()?;
    // A solver that is done early has nothing better to offer for more iterations.
    iterations.for_each(|more| add(more, from_start.last().milliseconds, &from_start.positions));
    let from_network =
        solve(&problem, &network, &settings, &mut |_| ControlFlow::Continue(())).into_diagnostic()?;
    let minimum = if from_network.energy() < from_start.energy() { &from_network } else { &from_start };
    let excess_of_lbs = problem.value(&lbs) - minimum.energy();
    let sample = |State { method, milliseconds, positions }: State| MethodSample {
        method,
        milliseconds,
        error: StateError::new(problem.value(&positions), &positions, minimum, excess_of_lbs),
        strain: reference.energy.raw(&positions, &positions).garments[0][Term::Strain].unwrap_or(0.0),
    };
    let is_equilibrium = minimum.relative_gradient <= settings.tolerance;
    Ok((states.into_iter().map(sample).collect(), is_equilibrium))
}

/// One per method, with estimates over all scenes.
fn points(samples: &[Vec<MethodSample>]) -> Vec<Value> {
    let point = |method: usize| {
        let scenes: Vec<&MethodSample> = samples.iter().map(|scene| &scene[method]).collect();
        let mut point = json!(Estimate::of_metrics(&scenes, &METRICS));
        point["method"] = json!(scenes[0].method);
        point
    };
    let mut points: Vec<Value> = (0..samples.first().map_or(0, Vec::len)).map(point).collect();
    let of_point = |point: &Value| ["milliseconds", "excess"].map(|metric| median(point, metric));
    let medians: Vec<[f64; 2]> = points.iter().map(of_point).collect();
    for (point, own) in points.iter_mut().zip(&medians) {
        let is_beaten = medians.iter().any(|other| other[0] < own[0] && other[1] < own[1]);
        point["on_front"] = json!(!is_beaten);
    }
    points
}

fn median(point: &Value, metric: &str) -> f64 {
    point[metric]["median"].as_f64().unwrap_or(f64::NAN)
}

fn table(points: &[Value], scenes: usize) -> Table {
    let columns: [Column<'_>; 7] = [
        ("method", "/method", plain),
        ("time [ms]", "/milliseconds", median_with_interval),
        ("excess energy [J]", "/excess", median_with_interval),
        ("excess [% of LBS]", "/excess_percent", median_with_interval),
        ("distance [mm]", "/distance_mm", median_with_interval),
        ("strain [J]", "/strain", median_with_interval),
        // No other method is both faster and nearer to the minimum in energy, by medians.
        ("on the front", "/on_front", plain),
    ];
    Table::new(format!("Speed against error over {scenes} scenes of one garment"), points, &columns)
}

/// Excess energy and distance over time, both medians.
fn charts(points: &[Value]) -> ChartGrid {
    let families = [
        ("LBS", "LBS"),
        ("network", "network, post-process, refinement"),
        ("solver", "solver from LBS + shape transfer"),
    ];
    let chart = |title: &str, metric: &str| {
        let line = |(prefix, name): (&str, &str)| {
            let family = points.iter().filter(|point| plain(&point["method"]).starts_with(prefix));
            let mut points: Vec<_> =
                family.map(|point| (median(point, "milliseconds"), median(point, metric))).collect();
            // More steps may take no longer; a line that turns back is drawn with spikes.
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            Line { name: name.to_owned(), points }
        };
        Chart::of_lines(title, &families.map(line))
    };
    ChartGrid {
        title: "Speed against error".to_owned(),
        legend: Vec::new(),
        charts: vec![
            chart("excess energy (%) over time (ms)", "excess_percent"),
            chart("distance (mm) over time (ms)", "distance_mm"),
        ],
    }
}
