//! Times of the queries.
//!
//! `cargo bench -p clothcombo-physics --bench queries [-- FILTER]`. Every time is that of one query per garment vertex, on one
//! thread.

mod scenes;

use std::hint::black_box;
use std::time::Duration;

use clothcombo_physics::contact::triangle_pairs;
use clothcombo_physics::query::Distance;
use clothcombo_physics::{Surface, TriMesh};
use criterion::{BenchmarkId, Criterion};
use scenes::Growth;

fn bench(criterion: &mut Criterion, body: &TriMesh, size: usize) {
    let dressed = scenes::garment(size, Growth::FixedArea, 0.0);
    let narrow = scenes::narrowed(&dressed.posed);
    let surface = Surface::<f32>::from_mesh(body);
    let mut group = criterion.benchmark_group("queries");
    group.sample_size(10).measurement_time(Duration::from_secs(1)).warm_up_time(Duration::from_millis(200));

    for (name, distance) in
        [("nearest vertex", Distance::NearestVertex), ("closest point", Distance::ClosestPoint)]
    {
        black_box(surface.gap(narrow[0], distance)); // Trees are built at first use.
        group.bench_function(BenchmarkId::new(name, size), |bencher| {
            bencher.iter(|| narrow.iter().map(|p| surface.gap(*p, distance).gap).sum::<f32>());
        });
    }
    group.bench_function(BenchmarkId::new("intersecting triangle pairs", size), |bencher| {
        bencher.iter(|| triangle_pairs(&dressed.posed, dressed.rest.faces(), body.positions(), body.faces()));
    });
    group.finish();
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let body = scenes::body(scenes::REFERENCE_VERTICES, Growth::FixedArea);
    let surface_build = |bencher: &mut criterion::Bencher<'_>, distance: Distance| {
        bencher.iter(|| Surface::<f32>::from_mesh(&body).gap([0.0; 3], distance));
    };
    let mut group = criterion.benchmark_group("body of 12,810 vertices");
    group.sample_size(10).measurement_time(Duration::from_secs(1)).warm_up_time(Duration::from_millis(200));
    group.bench_function("build the vertex tree", |b| surface_build(b, Distance::NearestVertex));
    group.bench_function("build the closest-point tree", |b| surface_build(b, Distance::ClosestPoint));
    group.finish();
    for size in scenes::SIZES {
        bench(&mut criterion, &body, size);
    }
    criterion.final_summary();
}
