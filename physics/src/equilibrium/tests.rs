//! The solver against analytic answers, a dense oracle, and its own invariants.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::filtered_steps::contact_mesh;
use super::{EquilibriumError, Problem, Progress, Solution, SolverSettings, Stop, solve};
use crate::contact::step_filter::StepFilter;
use crate::energy::tests::scenes::{jittered, paper_weights, scene_garment};
use crate::energy::{EnergySettings, LayerContact, SceneEnergy, SceneLayers, Term, TermMap};
use crate::mesh::{TriMesh, shapes};
use crate::query::{Distance, Surface};
use crate::transform::{IDENTITY, Transform};
use crate::vec3;

fn settings() -> EnergySettings {
    EnergySettings {
        distance: Distance::ClosestPoint,
        repulsion_continuous: true,
        ..EnergySettings::default()
    }
}

/// One garment on a body.
fn scene(
    rest: &TriMesh,
    body: &TriMesh,
    settings: EnergySettings,
    weights: TermMap<f64>,
) -> SceneEnergy<f64> {
    let scene = SceneEnergy {
        body: Arc::new(Surface::from_mesh(body)),
        garments: vec![scene_garment(rest, &settings, weights, true)],
        layers: Vec::new(),
        settings,
    };
    scene.pulled_back(&vec![IDENTITY; rest.vertex_count()])
}

fn weights(of: &[(Term, f64)]) -> TermMap<f64> {
    let mut map = TermMap::filled(0.0);
    for (term, weight) in of {
        map[*term] = *weight;
    }
    map
}

/// A body out of reach.
fn far_body() -> TriMesh {
    shapes::mapped(&shapes::icosphere(0.1, 1), |[x, y, z]| [x + 100.0, y, z])
}

fn run(problem: &Problem<'_>, start: &[[f64; 3]], settings: &SolverSettings) -> Solution {
    solve(problem, start, settings, &mut |_| ControlFlow::Continue(())).expect("a valid problem")
}

fn assert_monotone(solution: &Solution) {
    for pair in solution.history.windows(2) {
        assert!(pair[1].energy < pair[0].energy, "{pair:?}");
        assert_eq!(pair[1].iteration, pair[0].iteration + 1);
    }
}

/// A skirt that slides down a cone until it is wide enough to carry it, as a problem of every term that a single garment
/// has. Without friction a sheet would slide off a ball; this cannot.
fn skirt_on_cone(around: usize, along: usize) -> (SceneEnergy<f64>, TriMesh) {
    let cone = shapes::mapped(&shapes::tube(1.0, 0.8, 96, 30), |[x, y, z]| {
        let radius = 0.22 - 0.2 * y;
        [radius * x, y, radius * z]
    });
    let tube = shapes::mapped(&shapes::tube(0.13, 0.15, around, along), |[x, y, z]| [x, y + 0.5, z]);
    let rest = jittered(&tube, 0.002, 7);
    let mut weights = paper_weights();
    weights[Term::BodyCollision] = STIFF_CONTACT;
    weights[Term::Holding] = 0.0;
    (scene(&rest, &cone, settings(), weights), rest)
}

/// Weight of the collisions (J/m³).
const STIFF_CONTACT: f64 = 2e4;

/// Which share of the weight of the garment `rest` at `positions` the contact with `surface` carries.
fn carried_share(surface: &Surface<f64>, positions: &[[f64; 3]], rest: &TriMesh) -> f64 {
    let EnergySettings { material, gravity_acceleration, body_collision_epsilon, .. } = settings();
    let weight = rest.area() * material.thickness * material.density * gravity_acceleration;
    let carried = |p: &[f64; 3]| {
        let gap = surface.gap(*p, Distance::ClosestPoint);
        let excess = (body_collision_epsilon - gap.gap).max(0.0);
        STIFF_CONTACT * 3.0 * excess * excess * gap.gradient[1]
    };
    positions.iter().map(carried).sum::<f64>() / weight
}

#[test]
fn a_strip_under_its_own_weight_stretches_as_the_material_says() {
    // Held at the top (with λ = 0 and weightless bending, so that columns of cloth stretch independently).
    let mut settings = settings();
    settings.material.lambda = 0.0;
    settings.material.density = 4260.0;
    let (height, rows) = (0.5, 40);
    let rest = shapes::grid(0.1, height, 8, rows);
    let weights = weights(&[(Term::Strain, 1.0), (Term::Gravity, 1.0), (Term::Holding, 1e7)]);
    let settings = EnergySettings { holding_fraction: 9.0 / rest.vertex_count() as f64, ..settings };
    let energy = scene(&rest, &far_body(), settings, weights);
    let problem = Problem::new(&energy).unwrap();
    let tight = SolverSettings { tolerance: 1e-7, ..SolverSettings::default() };
    let solution = run(&problem, rest.positions(), &tight);
    assert_eq!(solution.stop, Stop::Converged, "{}", solution.relative_gradient);
    assert_monotone(&solution);

    // A column below height y weighs ρtgy per metre of width; its stretch s obeys s·2μt·½(s² − 1) = ρtgy (StVK with λ = 0).
    let material = settings.material;
    let stretch = |y: f64| {
        let load = material.density * settings.gravity_acceleration * y / material.mu;
        let mut s = 1.0;
        for _ in 0..60 {
            s -= (s * s * s - s - load) / (3.0 * s * s - 1.0);
        }
        s
    };
    let samples = 4000;
    let length: f64 = (0..samples).map(|i| stretch((i as f64 + 0.5) / samples as f64 * height)).sum::<f64>()
        * height
        / samples as f64;
    let ys = solution.positions.iter().map(|p| p[1]);
    let found = ys.clone().fold(f64::MIN, f64::max) - ys.fold(f64::MAX, f64::min);
    assert!(length > 1.03 * height, "the load must show: {length}");
    assert!((found / length - 1.0).abs() < 1e-3, "{found} {length}");
}

#[test]
fn a_lone_triangle_finds_its_rest_shape_again() {
    let rest = TriMesh::new(vec![[0.0; 3], [0.3, 0.0, 0.0], [0.1, 0.25, 0.0]], vec![[0, 1, 2]]).unwrap();
    let energy = scene(&rest, &far_body(), settings(), weights(&[(Term::Strain, 1.0)]));
    let problem = Problem::new(&energy).unwrap();
    let start = [[0.02, 0.01, 0.0], [0.45, 0.0, 0.1], [0.0, 0.2, -0.1]];
    // With a single term the relative gradient is 1 everywhere: only the bound on iterations or a stall can end it.
    let solution = run(&problem, &start, &SolverSettings { iterations: 60, ..SolverSettings::default() });
    assert!(solution.energy() < 1e-18 * solution.history[0].energy.max(1.0), "{}", solution.energy());
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let length = |p: &[[f64; 3]]| vec3::norm(vec3::sub(p[i], p[j]));
        assert!((length(&solution.positions) - length(rest.positions())).abs() < 1e-7);
    }
}

#[test]
fn a_skirt_comes_to_rest_on_a_cone() {
    let (energy, rest) = skirt_on_cone(30, 8);
    let problem = Problem::new(&energy).unwrap();
    let solution = run(&problem, rest.positions(), &SolverSettings::default());
    assert_eq!(solution.stop, Stop::Converged, "{:?} {}", solution.last(), solution.relative_gradient);
    assert!(solution.relative_gradient <= 1e-4);
    assert!((problem.relative_gradient(&solution.positions) - solution.relative_gradient).abs() < 1e-12);
    assert_monotone(&solution);
    assert_eq!(problem.value(&solution.positions), solution.energy());
    // In equilibrium the cone carries the weight of the skirt, which has come down and is not inside.
    let carried = carried_share(&energy.body, &solution.positions, &rest);
    assert!((carried - 1.0).abs() < 5e-3, "{carried}");
    let gaps = solution.positions.iter().map(|p| energy.body.gap(*p, Distance::ClosestPoint));
    assert!(gaps.into_iter().all(|gap| gap.gap > -1e-3));
    let lowest = |p: &[[f64; 3]]| p.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
    assert!(lowest(&solution.positions) < lowest(rest.positions()) - 0.02);

    // From the minimum there is nothing to do.
    let again = run(&problem, &solution.positions, &SolverSettings::default());
    assert_eq!((again.stop, again.iterations()), (Stop::Converged, 0));
    assert_eq!(again.positions, solution.positions);
}

#[test]
fn a_sheet_comes_to_rest_in_a_valley() {
    // Two slopes meet in a crease, over which the distance is not smooth.
    let valley = shapes::mapped(&shapes::grid(0.6, 0.6, 12, 12), |[x, y, _]| {
        [x - 0.3, 0.5 * (x - 0.3).abs(), 0.3 - y]
    });
    let flat = shapes::mapped(&shapes::grid(0.1, 0.05, 12, 6), |[x, y, _]| [x - 0.05, 0.0, 0.02 - y]);
    let rest = jittered(&flat, 0.0005, 3);
    let mut weights = paper_weights();
    weights[Term::BodyCollision] = STIFF_CONTACT;
    weights[Term::Holding] = 0.0;
    let energy = scene(&rest, &valley, settings(), weights);
    let problem = Problem::new(&energy).unwrap();
    let start: Vec<_> = rest.positions().iter().map(|[x, y, z]| [*x, y + 0.03, *z]).collect();
    let solution = run(&problem, &start, &SolverSettings::default());
    assert_eq!(solution.stop, Stop::Converged, "{:?} {}", solution.last(), solution.relative_gradient);
    assert_monotone(&solution);
    // The slopes, equally steep, carry the weight of the sheet.
    let carried = carried_share(&energy.body, &solution.positions, &rest);
    assert!((carried - 1.0).abs() < 2e-2, "{carried}");
}

#[test]
fn cloth_comes_to_rest_on_other_cloth() {
    // A small sheet 5 mm over a larger one, which hangs in a hollow.
    let hollow = shapes::mapped(&shapes::grid(0.6, 0.6, 24, 24), |[x, y, _]| {
        let [x, z] = [x - 0.3, 0.3 - y];
        [x, x * x + z * z, z]
    });
    let sheet = |size: f64, height: f64, seed| {
        let flat = shapes::grid(size, size, 10, 10);
        jittered(&shapes::mapped(&flat, |[x, y, _]| [x - 0.5 * size, height, 0.5 * size - y]), 0.0005, seed)
    };
    let (inner, outer) = (sheet(0.16, 0.008, 3), sheet(0.08, 0.013, 4));
    let mut weights = paper_weights();
    (weights[Term::BodyCollision], weights[Term::LayerCollision]) = (STIFF_CONTACT, STIFF_CONTACT);
    (weights[Term::Holding], weights[Term::LayerDistance]) = (0.0, 0.0);
    let settings = EnergySettings { layer_contact: LayerContact::ClosestPoint, ..settings() };
    let mut energy = scene(&inner, &hollow, settings, weights);
    energy.garments.extend(scene(&outer, &hollow, settings, weights).garments);
    energy.layers.push(SceneLayers { inner: 0, outer: 1, weights });
    let problem = Problem::new(&energy).unwrap();
    let start = [inner.positions(), outer.positions()].concat();
    let solution = run(&problem, &start, &SolverSettings::default());
    // Not to the last digit: the solver only knows the nonsmooth points of the contact with the body.
    assert!(solution.relative_gradient < 1e-3, "{:?} {}", solution.last(), solution.relative_gradient);
    assert_monotone(&solution);
    // The lower sheet carries the upper one.
    let (lower, upper) = solution.positions.split_at(inner.vertex_count());
    let lower = Surface::new(lower.to_vec(), inner.faces().into());
    assert!(upper.iter().all(|p| lower.gap(*p, Distance::ClosestPoint).gap > 0.0));
    let carried = carried_share(&lower, upper, &outer);
    assert!((carried - 1.0).abs() < 2e-2, "{carried}");
}

#[test]
fn the_number_of_threads_leaves_no_trace() {
    let (energy, rest) = skirt_on_cone(48, 14);
    let problem = Problem::new(&energy).unwrap();
    let settings = SolverSettings { iterations: 15, ..SolverSettings::default() };
    let with_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| run(&problem, rest.positions(), &settings))
    };
    let one = with_threads(1);
    assert_eq!(one.iterations(), 15);
    for threads in [2, 4] {
        let other = with_threads(threads);
        assert!(other.positions == one.positions, "{threads} threads");
        assert_eq!(other.energy().to_bits(), one.energy().to_bits());
    }
}

#[test]
fn a_translated_scene_has_the_translated_answer() {
    let (energy, rest) = skirt_on_cone(18, 5);
    // Not along y: heights count from the origin.
    let shift = [0.5, 0.0, -0.25];
    let body = Surface::new(
        energy.body.positions.iter().map(|p| vec3::add(*p, shift)).collect(),
        energy.body.faces.clone(),
    );
    let moved_energy = SceneEnergy { body: Arc::new(body), ..energy.clone() };
    let moved_start: Vec<_> = rest.positions().iter().map(|p| vec3::add(*p, shift)).collect();
    let here = run(&Problem::new(&energy).unwrap(), rest.positions(), &SolverSettings::default());
    let there = run(&Problem::new(&moved_energy).unwrap(), &moved_start, &SolverSettings::default());
    assert_eq!((here.stop, there.stop), (Stop::Converged, Stop::Converged));
    // Rounding may turn the skirt a little on its polygonal cone; the energy hardly knows.
    let gained = here.history[0].energy - here.energy();
    assert!((here.energy() - there.energy()).abs() < 1e-3 * gained, "{} {}", here.energy(), there.energy());
}

#[test]
fn equals_a_dense_newton_method() {
    // A small curtain that hangs from its top: every force is smooth, so a dense Newton method converges too.
    let rest = jittered(&shapes::irregular_grid(0.12, 0.12, 3, 3, 0.2, 8), 0.004, 5);
    let mut weights = paper_weights();
    weights[Term::Repulsion] = 0.0;
    let settings = EnergySettings { holding_fraction: 0.25, ..settings() };
    let energy = scene(&rest, &far_body(), settings, weights);
    let problem = Problem::new(&energy).unwrap();
    let tight = SolverSettings { tolerance: 1e-7, ..SolverSettings::default() };
    let solution = run(&problem, rest.positions(), &tight);
    assert_eq!(solution.stop, Stop::Converged);

    let oracle = dense_newton(&problem, rest.positions());
    let (found, expected) = (solution.energy(), problem.value(&oracle));
    assert!((found - expected).abs() < 1e-9 * expected.abs().max(1e-3), "{found} {expected}");
}

/// Damped Newton with a dense Hessian from central differences of the gradient.
fn dense_newton(problem: &Problem<'_>, start: &[[f64; 3]]) -> Vec<[f64; 3]> {
    use faer::linalg::solvers::Solve;
    let mut positions = start.to_vec();
    let n = 3 * positions.len();
    for _ in 0..200 {
        let (value, gradient) = problem.value_and_gradient(&positions);
        let size = gradient.as_flattened().iter().map(|g| g * g).sum::<f64>().sqrt();
        if size < 1e-11 {
            break;
        }
        let mut hessian = faer::Mat::<f64>::zeros(n, n);
        for column in 0..n {
            let step = 1e-6;
            let at = |sign: f64| {
                let mut moved = positions.clone();
                moved.as_flattened_mut()[column] += sign * step;
                problem.value_and_gradient(&moved).1
            };
            let (plus, minus) = (at(1.0), at(-1.0));
            for row in 0..n {
                hessian[(row, column)] =
                    (plus.as_flattened()[row] - minus.as_flattened()[row]) / (2.0 * step);
            }
        }
        let symmetric = faer::Mat::from_fn(n, n, |r, c| 0.5 * (hessian[(r, c)] + hessian[(c, r)]));
        let lowest = symmetric.self_adjoint_eigenvalues(faer::Side::Lower).expect("finite")[0];
        let shift = (1e-6 - lowest).max(0.0);
        let shifted = faer::Mat::from_fn(n, n, |r, c| symmetric[(r, c)] + if r == c { shift } else { 0.0 });
        let rhs = faer::Mat::from_fn(n, 1, |r, _| -gradient.as_flattened()[r]);
        let direction = shifted.partial_piv_lu().solve(&rhs);
        let mut length = 1.0;
        for _ in 0..60 {
            let mut moved = positions.clone();
            for (x, d) in moved.as_flattened_mut().iter_mut().zip(0..n) {
                *x += length * direction[(d, 0)];
            }
            if problem.value(&moved) < value {
                positions = moved;
                break;
            }
            length *= 0.5;
        }
    }
    positions
}

#[test]
fn a_garment_is_held_at_the_height_that_its_skinning_says() {
    // Skinning turns the garment upside down and lifts it: held at its top, that is below when posed. It starts 2 cm too low.
    let rest = shapes::grid(0.2, 0.2, 4, 4);
    let weights = weights(&[(Term::Strain, 1.0), (Term::Holding, 1e3)]);
    let turned: Transform = [[1.0, 0.0, 0.0, 0.1], [0.0, -1.0, 0.0, 0.7], [0.0, 0.0, -1.0, 0.0]];
    let energy = scene(&rest, &far_body(), settings(), weights).pulled_back(&vec![turned; 25]);
    let problem = Problem::new(&energy).unwrap();
    let start: Vec<_> = rest.positions().iter().map(|[x, y, z]| [x + 0.1, 0.68 - y, -z]).collect();
    assert!((problem.value(&start) - 1e3 * 3.0 * 0.02 * 0.02).abs() < 1e-9);
    let solution = run(&problem, &start, &SolverSettings::default());
    assert_monotone(&solution);
    for (found, rest) in solution.positions.iter().zip(rest.positions()) {
        assert!((found[1] - (0.7 - rest[1])).abs() < 1e-4, "{found:?} {rest:?}");
    }

    let mut held = energy.clone();
    held.garments[0].pull_back = None;
    assert_eq!(Problem::new(&held).unwrap_err(), EquilibriumError::Canonical);
}

#[test]
fn a_filtered_step_makes_no_intersection() {
    let (mut falling, rest) = skirt_on_cone(24, 6);
    // Nothing but the filter keeps the skirt from falling through the cone; then it starts across the cone's surface.
    for (collision, by) in [(0.0, 0.0), (STIFF_CONTACT, 0.04)] {
        falling.garments[0].weights[Term::BodyCollision] = collision;
        let lowered: Vec<[f64; 3]> = rest.positions().iter().map(|[x, y, z]| [*x, y - by, *z]).collect();
        let problem = Problem::new(&falling).unwrap();
        let mesh = contact_mesh(&falling);
        let pairs = |cloth: &[[f64; 3]]| {
            StepFilter::new(&mesh, &[cloth, &falling.body.positions].concat()).intersections
        };
        let most_pairs = |margin: Option<f64>| {
            let settings = SolverSettings { iterations: 30, margin, ..SolverSettings::default() };
            let mut before = pairs(&lowered);
            let (start, mut is_kept) = (before.len(), true);
            let mut look = |progress: &Progress<'_>| {
                let now = pairs(progress.positions);
                is_kept &= now.iter().all(|pair| before.binary_search(pair).is_ok());
                before = now;
                ControlFlow::Continue(())
            };
            let solution = solve(&problem, &lowered, &settings, &mut look).unwrap();
            assert_monotone(&solution);
            assert!(solution.iterations() > 2, "{:?}", solution.stop);
            (start, is_kept, pairs(&solution.positions).len())
        };
        let (start, is_kept, end) = most_pairs(Some(5e-5));
        assert!(is_kept, "{start} {end}");
        if collision == 0.0 {
            assert_eq!((start, end), (0, 0));
            assert!(!most_pairs(None).1, "nothing was in the way");
        } else {
            assert!(start > 10 && end < start, "{start} {end}");
        }
    }
}

#[test]
fn what_nothing_holds_is_reported_as_escaped() {
    let rest = shapes::grid(0.1, 0.1, 2, 2);
    let energy = scene(&rest, &far_body(), settings(), weights(&[(Term::Strain, 1.0), (Term::Gravity, 1.0)]));
    let problem = Problem::new(&energy).unwrap();
    let solution = run(&problem, rest.positions(), &SolverSettings::default());
    assert_eq!(solution.stop, Stop::Escaped);
    let bounded = SolverSettings { escape_distance: None, iterations: 30, ..SolverSettings::default() };
    let solution = run(&problem, rest.positions(), &bounded);
    assert_eq!(solution.stop, Stop::Iterations);
    assert!(solution.history.iter().all(|s| s.displacement <= bounded.step_bound * (1.0 + 1e-12)));
}

#[test]
fn bad_input_is_named_and_the_observer_can_stop() {
    let (energy, rest) = skirt_on_cone(5, 4);
    let start = rest.positions().to_vec();
    let problem = Problem::new(&energy).unwrap();
    let go = &mut |_: &super::Progress<'_>| ControlFlow::Continue(());
    let mut nan = start.clone();
    nan[3][1] = f64::NAN;
    let default = SolverSettings::default();
    let error = solve(&problem, &nan, &default, go).unwrap_err();
    assert_eq!(error, EquilibriumError::StartPosition { vertex: 3 });
    let error = solve(&problem, &start[1..], &default, go).unwrap_err();
    assert!(matches!(error, EquilibriumError::Count { expected: 25, found: 24, .. }));
    let bad = SolverSettings { step_bound: 0.0, ..default };
    let error = solve(&problem, &start, &bad, go).unwrap_err();
    assert!(matches!(error, EquilibriumError::Setting { setting: "step_bound", .. }));
    let broken = Surface::new(vec![[f64::NAN; 3]; energy.body.positions.len()], energy.body.faces.clone());
    let broken = SceneEnergy { body: Arc::new(broken), ..energy.clone() };
    let error = solve(&Problem::new(&broken).unwrap(), &start, &default, go).unwrap_err();
    assert_eq!(error, EquilibriumError::StartEnergy);

    let mut seen = Vec::new();
    let solution = solve(&problem, &start, &default, &mut |progress| {
        seen.push(progress.step.energy);
        if progress.step.iteration == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!((solution.stop, solution.iterations(), seen.len()), (Stop::Cancelled, 3, 4));
    let still = SolverSettings { iterations: 0, ..default };
    assert_eq!(run(&problem, &start, &still).positions, start);
    let no_time = SolverSettings { time: Some(std::time::Duration::ZERO), ..default };
    assert_eq!(run(&problem, &start, &no_time).stop, Stop::Time);
}

#[test]
fn the_continuous_repulsion_has_the_printed_forces() {
    let rest = shapes::irregular_grid(0.3, 0.3, 9, 9, 0.3, 2);
    let posed = jittered(&rest, 0.02, 3);
    let weights = weights(&[(Term::Repulsion, 1.0)]);
    let printed = EnergySettings { repulsion_continuous: false, ..settings() };
    let evaluate = |settings| scene(&rest, &far_body(), settings, weights).evaluate(posed.positions(), &[]);
    let (a, b) = (evaluate(settings()), evaluate(printed));
    assert!(a.total > 0.0 && a.total < b.total);
    for (a, b) in a.posed_gradient.iter().zip(&b.posed_gradient) {
        assert!(vec3::distance_squared(*a, *b) < 1e-24 * vec3::norm_squared(*b).max(1e-6));
    }
}
