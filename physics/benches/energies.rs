//! Times of every energy, value alone and with its gradient, for garments of 1,000 to 50,000 vertices.
//!
//! `cargo bench -p clothcombo-physics --bench energies [-- FILTER]`; `RAYON_NUM_THREADS` sets the threads. Tables for the
//! documentation, beside PyTorch, come from `scripts/bench_energies.sh`.

mod scenes;

use std::hint::black_box;
use std::time::Duration;

use clothcombo_physics::Term;
use criterion::{BenchmarkId, Criterion};
use scenes::{Growth, Scene};

fn bench(criterion: &mut Criterion, group: &str, scene: &Scene, terms: &[(&str, Vec<Term>)]) {
    let vertices = scene.dressed[0].rest.vertex_count();
    let mut group = criterion.benchmark_group(group);
    group.sample_size(10).measurement_time(Duration::from_secs(1)).warm_up_time(Duration::from_millis(200));
    for (name, terms) in terms {
        let energy = scene.energy(terms);
        group.bench_function(BenchmarkId::new(format!("{name}/value"), vertices), |bencher| {
            bencher.iter(|| black_box(energy.value(&scene.posed, &scene.canonical)));
        });
        group.bench_function(BenchmarkId::new(format!("{name}/gradient"), vertices), |bencher| {
            bencher.iter(|| black_box(energy.evaluate(&scene.posed, &scene.canonical)));
        });
    }
    group.finish();
}

fn each(terms: Vec<Term>) -> Vec<(&'static str, Vec<Term>)> {
    terms.into_iter().map(|term| (term.name(), vec![term])).collect()
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    for (growth, name) in [(Growth::FixedArea, "1 m²"), (Growth::FixedEdge, "12 mm edges")] {
        for size in scenes::SIZES {
            let mut single = each(scenes::single_terms());
            single.push(("all single-garment terms", scenes::single_terms()));
            bench(&mut criterion, name, &Scene::new(size, growth, 1, None), &single);
            let sampled = [
                ("repulsion, 16 partners", vec![Term::Repulsion]),
                ("all single-garment terms, 16 partners", scenes::single_terms()),
            ];
            bench(&mut criterion, name, &Scene::new(size, growth, 1, Some(16)), &sampled);
            bench(&mut criterion, name, &Scene::new(size, growth, 2, None), &each(scenes::layer_terms()));
        }
    }
    criterion.final_summary();
}
