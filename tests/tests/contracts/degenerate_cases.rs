//! Every energy × every degenerate case: finite, bounded, the derivative of its value, the same in both precisions and for any
//! number of threads; or refused with the element at fault by name.

use clothcombo_data::degenerate_cases::{CaseOutcome, DegenerateCases, Expectation};
use clothcombo_data::generate::mannequin;
use clothcombo_physics::Real;
use clothcombo_physics::energy::{EnergySettings, SceneValue, Term, TermMap};

/// All terms as trained, and the one that is printed without its gate.
fn forms() -> [(&'static str, EnergySettings, &'static [Term]); 2] {
    [
        ("default", EnergySettings::default(), &Term::ALL),
        ("printed", EnergySettings::printed(), &[Term::LayerCollision]),
    ]
}

#[test]
fn every_case_keeps_its_promise() {
    let body = mannequin();
    let cases = DegenerateCases::new(&body).expect("a human body");
    let mut faults = Vec::new();
    // Per term: how often it spoke, largest error against quotients, of f32 values that do not cancel, of f32 gradients.
    let mut spoke = TermMap::filled(0);
    let mut worst = TermMap::filled([0.0f64; 3]);
    let (mut lines, mut kinks) = (0, 0);
    for (form, settings, terms) in forms() {
        for case in DegenerateCases::all() {
            let start = std::time::Instant::now();
            let report = cases.assess(case, &settings, terms);
            println!("{form:8} {:38} {:.2} s", case.name, start.elapsed().as_secs_f64());
            faults.extend(report.faults().into_iter().map(|fault| format!("{form}, {}: {fault}", case.name)));
            let CaseOutcome::Evaluated(terms) = report.outcome else { continue };
            for (term, report) in terms.iter() {
                let Some(report) = report else { continue };
                println!(
                    "{form:8} {:38} {term:16} value {:>10.3e} gradient {:>9.2e} of {:>9.2e}  quotients {:.1e} ({} of {} \
                     kinks)  f32 {:.1e}{} gradient {:.1e}",
                    case.name,
                    report.value,
                    report.largest_gradient,
                    report.gradient_bound,
                    report.gradient_error,
                    report.kinks,
                    report.lines,
                    report.f32_relative(),
                    if report.cancels() { " (cancels)" } else { "" },
                    report.f32_gradient_error,
                );
                spoke[term] += usize::from(report.largest_gradient > 0.0);
                let value = if report.cancels() { 0.0 } else { report.f32_relative() };
                let errors = [report.gradient_error, value, report.f32_gradient_error];
                worst[term] = std::array::from_fn(|i| worst[term][i].max(errors[i]));
                lines += report.lines;
                kinks += report.kinks;
            }
        }
    }
    for (term, [quotients, value, gradient]) in worst.iter() {
        println!("{term:16} quotients {quotients:.1e}  f32 value {value:.1e}  f32 gradient {gradient:.1e}");
    }
    println!("{kinks} of {lines} lines cross a kink");
    assert!(faults.is_empty(), "{} broken promises:\n{}", faults.len(), faults.join("\n"));
    // The suite means something: every term acts in most scenes, and few lines needed the check from both sides.
    let scenes = DegenerateCases::all().filter(|case| case.expectation == Expectation::Bounded).count();
    for (term, spoke) in spoke.iter() {
        assert!(*spoke * 2 > scenes, "{term} acts in {spoke} of {scenes} scenes only");
    }
    assert!(kinks * 10 < lines, "{kinks} of {lines} lines cross a kink");
}

fn with_threads<T: Real>(
    threads: usize,
    scene: &clothcombo_data::degenerate_cases::CaseScene,
) -> SceneValue<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
    let energy = scene.energy::<T>(&EnergySettings::default(), TermMap::filled(1.0)).expect("valid");
    pool.install(|| energy.evaluate(&scene.posed(), &scene.canonical()))
}

#[test]
fn the_number_of_threads_leaves_no_trace() {
    let body = mannequin();
    let cases = DegenerateCases::new(&body).expect("a human body");
    for case in DegenerateCases::all().filter(|case| case.expectation == Expectation::Bounded) {
        let scene = cases.scene(case).expect("a scene");
        let (single, double) = (with_threads::<f32>(1, &scene), with_threads::<f64>(1, &scene));
        for threads in [2, 4] {
            let bits = |value: &SceneValue<f64>| -> Vec<u64> {
                let gradients = value.posed_gradient.iter().chain(&value.canonical_gradient).flatten();
                let raw = value.garments.iter().chain(&value.layers);
                let raw = raw.flat_map(|raw| Term::ALL.map(|term| raw[term].unwrap_or(0.0)));
                gradients.copied().chain(raw).chain([value.total]).map(f64::to_bits).collect()
            };
            assert!(
                bits(&with_threads(threads, &scene)) == bits(&double),
                "{}, {threads} threads, f64",
                case.name
            );
            let widened = |value: SceneValue<f32>| SceneValue::<f64> {
                total: value.total,
                posed_gradient: value.posed_gradient.iter().map(|g| g.map(f64::from)).collect(),
                canonical_gradient: value.canonical_gradient.iter().map(|g| g.map(f64::from)).collect(),
                garments: value.garments,
                layers: value.layers,
            };
            let (again, once) = (widened(with_threads(threads, &scene)), widened(single.clone()));
            assert!(bits(&again) == bits(&once), "{}, {threads} threads, f32", case.name);
        }
    }
}
