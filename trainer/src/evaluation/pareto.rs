//! Speed against error: time per drape against energy above the converged minimum, distance to it and intersections.

use super::equilibrium_error::StateError;
use super::page::Picture;
use super::timing::{REPETITION_SECONDS, median_ms};
use super::{Estimate, Evaluator, Metric, Section, Table, drape_by};
use crate::dataset::PreparedScene;
use crate::inference::Draped;
use crate::inference::reference::{ReferenceScene, wide};
use crate::inference::tensor_store::DrapeError;
use crate::inference::{RefineSteps, refine};
use crate::picture::chart::{Chart, ChartGrid, ChartLine};
use crate::picture::png_bytes;
use crate::run::report::table::{Column, median_with_interval, plain};
use crate::run::validation::Method;
use crate::system::single_threaded::map_single_threaded;
use clothcombo_model::Mode;
use clothcombo_physics::energy::Term;
use clothcombo_physics::equilibrium::{Problem, SolverSettings, Stop, solve};
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::time::Instant;

/// Steps of the solver from LBS + shape transfer.
const SOLVER: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];
/// Steps of the refinement after networks and post-process.
const REFINEMENT: [usize; 4] = [1, 2, 4, 8];
/// Garments of an outfit.
const OUTFIT_LAYERS: usize = 3;
/// Random stream of the scenes; outfits have the next.
const PARETO_STREAM: usize = 7;
/// Networks and post-process.
const RESOLVED: &str = "network + post-process";
/// How the methods of a line begin, and what it is called.
const METHOD_FAMILIES: [(&str, &str); 4] = [
    ("LBS", "LBS"),
    (RESOLVED, "network, post-process, refinement"),
    ("network", "network"),
    ("solver", "solver from LBS + shape transfer"),
];
/// One method on one scene.
#[derive(Serialize)]
struct MethodSample {
    method: String,
    /// Wall time of a drape (ms).
    milliseconds: f64,
    /// Percent are of the excess of LBS.
    #[serde(flatten)]
    error: StateError,
    /// Strain of all garments (J).
    strain: f64,
    /// Exact pairs of triangles with the body.
    body_pairs: f64,
    /// The same between garments.
    layer_pairs: f64,
}

/// What is estimated of a method.
const METHOD_METRICS: [Metric<MethodSample>; 7] = [
    ("milliseconds", |s| s.milliseconds),
    ("excess", |s| s.error.excess),
    ("excess_percent", |s| s.error.excess_percent),
    ("distance_mm", |s| s.error.distance_mm),
    ("strain", |s| s.strain),
    ("body_pairs", |s| s.body_pairs),
    ("layer_pairs", |s| s.layer_pairs),
];

/// A state of the garments, and how long it took.
struct TimedState {
    method: String,
    milliseconds: f64,
    positions: Vec<[f64; 3]>,
}

/// Scenes of one garment and of an outfit draped by all methods. The networks are timed with all threads, one scene at
/// a time; the solver and the refinement on one thread per scene.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let [scenes, outfits] = evaluator.counts.pareto;
    let single_garments = Comparison::new(evaluator, PARETO_STREAM, 1, scenes)?;
    let outfits = Comparison::new(evaluator, PARETO_STREAM + 1, OUTFIT_LAYERS, outfits)?;
    let tables = vec![
        single_garments.table("Speed against error, one garment"),
        outfits.table(&format!("Speed against error, {OUTFIT_LAYERS} garments")),
    ];
    let mut charts = single_garments.charts("one garment");
    charts.extend(outfits.charts(&format!("{OUTFIT_LAYERS} garments")));
    let legend = ChartLine::legend(
        &METHOD_FAMILIES.map(|(_, name)| ChartLine { name: name.to_owned(), points: Vec::new() }),
    );
    let charts = ChartGrid { title: "Speed against error".to_owned(), legend, charts };
    let numbers = json!({ "single_garments": single_garments, "outfits": outfits });
    let mut section = Section::new("pareto", "Speed against error", "", numbers, tables);
    section.pictures.push(Picture {
        file: "pareto.png".into(),
        caption: "Medians; down and to the left is better.".into(),
        png: png_bytes(&charts.draw()).into_diagnostic()?,
        html: Some(charts.html()),
    });
    Ok(vec![section])
}

/// All methods on scenes of equally many garments.
#[derive(Serialize)]
struct Comparison {
    scenes: usize,
    /// How many of the reference solutions are equilibria.
    converged: usize,
    /// How often each reason ended the solver there.
    stops: BTreeMap<&'static str, usize>,
    /// One per method, with estimates over all scenes.
    points: Vec<Value>,
    samples: Vec<Vec<MethodSample>>,
}

impl Comparison {
    fn new(evaluator: &Evaluator<'_>, stream: usize, layers: usize, scenes: usize) -> Result<Self, Report> {
        let draped = |index: usize| {
            let scene = evaluator.model.prepare(&evaluator.model.sample_outfit([stream, index], layers))?;
            let states = fast_methods(evaluator, &scene)?;
            Ok::<_, Report>((scene, states))
        };
        let draped = (0..scenes).map(draped).collect::<Result<Vec<_>, _>>()?;
        let solved = map_single_threaded(draped, |(scene, states)| {
            let solved = solved(evaluator, &scene, states);
            evaluator.scene_done();
            solved
        })?;
        let (samples, reasons): (Vec<_>, Vec<Stop>) = solved.into_iter().unzip();
        let mut stops = BTreeMap::new();
        reasons.iter().for_each(|stop| *stops.entry(stop.name()).or_default() += 1);
        let converged = reasons.iter().filter(|stop| **stop == Stop::Converged).count();
        Ok(Self { scenes, converged, stops, points: points(&samples), samples })
    }

    fn table(&self, title: &str) -> Table {
        let columns: [Column<'_>; 9] = [
            ("method", "/method", plain),
            ("time [ms]", "/milliseconds", median_with_interval),
            ("excess energy [J]", "/excess", median_with_interval),
            ("excess [% of LBS]", "/excess_percent", median_with_interval),
            ("distance [mm]", "/distance_mm", median_with_interval),
            ("strain [J]", "/strain", median_with_interval),
            ("pairs with the body", "/body_pairs", median_with_interval),
            ("pairs between garments", "/layer_pairs", median_with_interval),
            // No other method is both faster and nearer to the minimum in energy, by medians.
            ("on the front", "/on_front", plain),
        ];
        Table::new(title, &self.points, &columns).with_note(format!(
            "Medians [95 % interval of the mean] of {} scenes. Excess and distance: to the lowest state that the solver found from \
             LBS + shape transfer or from the network, {} of {} of them equilibria. Networks on {} threads, solver and refinement on \
             one.",
            self.scenes,
            self.converged,
            self.scenes,
            rayon::current_num_threads()
        ))
    }

    /// Excess energy, distance and intersections over time, all medians.
    fn charts(&self, of: &str) -> Vec<Chart> {
        let family_of = |name: &str| METHOD_FAMILIES.iter().position(|(prefix, _)| name.starts_with(prefix));
        let chart = |quantity: &str, value: &dyn Fn(&Value) -> f64| {
            let line = |index: usize| {
                let family = self.points.iter().filter(|p| family_of(&plain(&p["method"])) == Some(index));
                let mut points: Vec<_> = family.map(|p| (median(p, "milliseconds"), value(p))).collect();
                // More steps may take no longer; a line that turns back is drawn with spikes.
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                ChartLine { name: METHOD_FAMILIES[index].1.to_owned(), points }
            };
            let lines: Vec<ChartLine> = (0..METHOD_FAMILIES.len()).map(line).collect();
            Chart::of_lines(of, ["time (ms)", quantity], &lines)
        };
        vec![
            chart("excess energy (% of LBS)", &|p| median(p, "excess_percent")),
            chart("distance (mm)", &|p| median(p, "distance_mm")),
            chart("intersecting pairs", &|p| median(p, "body_pairs") + median(p, "layer_pairs")),
        ]
    }
}

/// Skinning, networks, networks with post-process.
fn fast_methods(evaluator: &Evaluator<'_>, scene: &PreparedScene) -> Result<Vec<TimedState>, Report> {
    let Evaluator { networks, post_process, settings, .. } = evaluator;
    // The garment is embedded in the first, unmeasured drape, as for the next frame of a motion.
    let timed = |method: &str, drape: &dyn Fn() -> Result<Draped, DrapeError>| {
        let milliseconds = median_ms(REPETITION_SECONDS, drape)?;
        let positions = wide(&drape()?.posed);
        Ok::<_, DrapeError>(TimedState { method: method.to_owned(), milliseconds, positions })
    };
    let by = |method: Method| timed(method.name(), &|| Ok(drape_by(networks, &[method], scene)?.remove(0)));
    let mut states = vec![by(Method::Lbs)?, by(Method::LbsWithShapeTransfer)?];
    states.push(timed("network, forward pass", &|| networks.forward(scene, Mode::Layered))?);
    let network = by(Method::Network)?;
    let draped = networks.drape(scene)?;
    // Once: it may take seconds.
    let clock = Instant::now();
    let resolved = post_process.of(scene, &draped.posed).resolved(settings)?.positions.concat();
    let milliseconds = network.milliseconds + 1e3 * clock.elapsed().as_secs_f64();
    states.push(network);
    states.push(TimedState { method: RESOLVED.into(), milliseconds, positions: resolved });
    Ok(states)
}

/// Adds refinement and solver to the fast methods, and measures all of them against the lowest state found; also why the
/// solver stopped there.
fn solved(
    evaluator: &Evaluator<'_>,
    scene: &PreparedScene,
    mut states: Vec<TimedState>,
) -> Result<(Vec<MethodSample>, Stop), Report> {
    let reference = ReferenceScene::new(&evaluator.model.config.losses, scene).into_diagnostic()?;
    let problem = Problem::new(&reference.energy).into_diagnostic()?;
    let fast = |method: &str| {
        let state = states.iter().find(|state| state.method == method).expect("it is a fast method");
        (state.positions.clone(), state.milliseconds)
    };
    let (lbs, _) = fast(Method::Lbs.name());
    let (_, start_milliseconds) = fast(Method::LbsWithShapeTransfer.name());
    let (network, _) = fast(Method::Network.name());
    let (resolved, resolved_milliseconds) = fast(RESOLVED);
    for steps in REFINEMENT {
        let clock = Instant::now();
        let (positions, _) =
            refine(&reference.energy, &resolved, RefineSteps::AtMost(steps)).into_diagnostic()?;
        let milliseconds = resolved_milliseconds + 1e3 * clock.elapsed().as_secs_f64();
        states.push(TimedState {
            method: format!("{RESOLVED} + {}", counted_steps(steps)),
            milliseconds,
            positions,
        });
    }
    let settings = SolverSettings::default();
    let mut iterations = SOLVER.into_iter().peekable();
    let mut add = |iterations: usize, milliseconds: f64, positions: &[[f64; 3]]| {
        states.push(TimedState {
            method: format!("solver, {}", counted_steps(iterations)),
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
    let sample = |TimedState { method, milliseconds, positions }: TimedState| {
        let raw = reference.energy.raw(&positions, &positions).garments;
        let packed: Vec<[f32; 3]> = positions.iter().map(|p| p.map(|x| x as f32)).collect();
        let certificate = evaluator.post_process.of(scene, &packed).certificate().into_diagnostic()?;
        Ok::<_, Report>(MethodSample {
            method,
            milliseconds,
            error: StateError::new(problem.value(&positions), &positions, minimum, excess_of_lbs),
            strain: raw.iter().map(|terms| terms[Term::Strain].unwrap_or(0.0)).sum(),
            body_pairs: certificate.body_triangle_pairs as f64,
            layer_pairs: certificate.layer_triangle_pairs as f64,
        })
    };
    Ok((states.into_iter().map(sample).collect::<Result<_, _>>()?, minimum.stop))
}

fn counted_steps(steps: usize) -> String {
    format!("{steps} {}", if steps == 1 { "step" } else { "steps" })
}

/// One per method, with estimates over all scenes.
fn points(samples: &[Vec<MethodSample>]) -> Vec<Value> {
    let point = |method: usize| {
        let scenes: Vec<&MethodSample> = samples.iter().map(|scene| &scene[method]).collect();
        let mut point = json!(Estimate::of_metrics(&scenes, &METHOD_METRICS));
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
