//! Steps of random meshes, looked at again at many times.

use super::*;
use crate::mesh::TriMesh;
use crate::mesh::shapes::{self, SplitMix};
use crate::vec3::{norm, scale};

/// Sheets over each other and over a ball, apart, of random shape.
fn scene(random: &mut SplitMix, gap: f64) -> (ContactMesh, Vec<[f64; 3]>) {
    let mut number = |most: u64| 3 + (random.symmetric().abs() * most as f64) as usize;
    let sheets: Vec<TriMesh> = (0..3)
        .map(|i| {
            let (columns, rows) = (number(5), number(5));
            let sheet = shapes::irregular_grid(0.1, 0.1, columns, rows, 0.3, i);
            let lift = 0.1 + gap * (i + 1) as f64;
            let bend = 0.3 * (columns as f64 - 5.0);
            shapes::mapped(&sheet, |[x, y, _]| {
                let (x, y) = (x - 0.05, y - 0.05);
                // Over the ball, or nearly flat and touching nothing all the same.
                let height = (lift * lift - (x * x + y * y) * 0.9).sqrt();
                [x, height + 0.02 * gap * (40.0 * x * (1.0 + bend)).sin(), y]
            })
        })
        .collect();
    let ball = shapes::icosphere(0.1, 2);
    let cloth = shapes::union(&sheets.iter().collect::<Vec<_>>());
    let start = cloth.vertex_count() as u32;
    let body = ball.faces().iter().map(|face| face.map(|v| v + start));
    let mesh = ContactMesh::new(cloth.vertex_count() + ball.vertex_count(), cloth.faces(), body);
    (mesh, [cloth.positions(), ball.positions()].concat())
}

fn all_intersections(mesh: &ContactMesh, positions: &[[f64; 3]]) -> FacePairs {
    let faces = mesh.faces.len() as u32;
    let pairs = (0..mesh.cloth_faces as u32).flat_map(|f| (f + 1..faces).map(move |g| (f, g)));
    pairs
        .filter(|&(f, g)| mesh_triangles_intersect(positions, mesh.faces[f as usize], mesh.faces[g as usize]))
        .collect()
}

fn moved(random: &mut SplitMix, x: &[[f64; 3]], size: f64, body_from: usize) -> Vec<[f64; 3]> {
    let drift: [f64; 3] = std::array::from_fn(|_| size * random.symmetric());
    x.iter()
        .enumerate()
        .map(|(v, p)| {
            let own: [f64; 3] = std::array::from_fn(|_| size * random.symmetric());
            let by = if v < body_from { add(own, drift) } else { scale(own, 0.05) };
            add(*p, by)
        })
        .collect()
}

/// Steps of meshes that start apart: at 64 times of each nothing intersects.
fn replay(rounds: usize, seed: u64) {
    let mut random = SplitMix::new(seed);
    let (mut refused, mut whole) = (0, 0);
    for round in 0..rounds {
        let (mesh, mut x) = scene(&mut random, 0.004);
        let body_from = x.len() - 162;
        let mut filter = StepFilter::new(&mesh, &x);
        assert!(filter.intersections.is_empty());
        for _ in 0..2 {
            let size = [0.0005, 0.003, 0.02, 0.1][round % 4];
            let wanted = moved(&mut random, &x, size, body_from);
            let mut y = wanted.clone();
            filter.step(&x, &mut y, 5e-5);
            let taken = y.iter().zip(&wanted).filter(|(a, b)| a == b).count();
            refused += y.len() - taken;
            whole += taken;
            for i in 1..=64 {
                let t = f64::from(i) / 64.0;
                let between: Vec<[f64; 3]> =
                    x.iter().zip(&y).map(|(p, q)| add_scaled(*p, t, sub(*q, *p))).collect();
                let mut check = StepFilter::new(&mesh, &between);
                assert!(check.intersections.is_empty(), "round {round}, time {t}");
                check.intersections.clear();
            }
            x = y;
        }
    }
    assert!(refused > 20 * rounds && whole > 20 * rounds, "{refused} {whole}");
}

#[test]
fn a_filtered_step_never_intersects() {
    replay(150, 1);
}

/// About ten minutes.
#[test]
#[ignore = "long"]
fn ten_thousand_filtered_steps_never_intersect() {
    replay(5000, 2);
}

#[test]
fn steps_of_intersecting_meshes_add_no_intersection() {
    let mut random = SplitMix::new(5);
    let (mut fewer, mut start) = (0, 0);
    for round in 0..150 {
        let (mesh, x) = scene(&mut random, 0.002);
        let body_from = x.len() - 162;
        let x = moved(&mut random, &x, [0.002, 0.006][round % 2], body_from);
        let mut filter = StepFilter::new(&mesh, &x);
        let before = filter.intersections.clone();
        assert_eq!(before, all_intersections(&mesh, &x));
        let mut y = moved(&mut random, &x, [0.0005, 0.002, 0.01][round % 3], body_from);
        filter.step(&x, &mut y, 5e-5);
        let after = all_intersections(&mesh, &y);
        assert_eq!(after, filter.intersections);
        assert!(after.iter().all(|pair| before.binary_search(pair).is_ok()), "round {round}");
        start += before.len();
        fewer += before.len() - after.len();
    }
    assert!(start > 3000 && fewer > 50, "{start} {fewer}");
}

/// A triangle without area that lies across another one intersects nothing; with some it would, though nothing met on the way.
#[test]
fn a_triangle_that_gets_an_area_makes_no_intersection() {
    let positions = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
    let across = [[0.3, -2.0, -2.0], [0.3, 2.0, -2.0], [0.3, 0.0, 3.0]];
    let x = [positions, across].concat();
    let mesh = ContactMesh::new(6, &[[0, 1, 2], [3, 4, 5]], std::iter::empty());
    let mut filter = StepFilter::new(&mesh, &x);
    assert!(filter.intersections.is_empty());
    let mut y = x.clone();
    y[2] = [0.0, 0.1, 0.0];
    filter.step(&x, &mut y, 5e-5);
    assert_eq!(filter.intersections, all_intersections(&mesh, &y));
    assert!(y == x);
}

/// The same step without trees and boxes: all pairs of faces and their elements.
fn brute_force(mesh: &ContactMesh, x: &[[f64; 3]], wanted: &[[f64; 3]], margin: f64) -> Vec<[f64; 3]> {
    let faces = mesh.faces.len() as u32;
    let pairs: Vec<(u32, u32)> =
        (0..mesh.cloth_faces as u32).flat_map(|f| (f + 1..faces).map(move |g| (f, g))).collect();
    let mut y = wanted.to_vec();
    let mut drawn = vec![0; y.len()];
    loop {
        let mut back: Vec<u32> = Vec::new();
        for &(f, g) in &pairs {
            let corners = |f: u32, state: &[[f64; 3]]| mesh.faces[f as usize].map(|v| state[v as usize]);
            let [start, end] = [x, &y].map(|state| [corners(f, state), corners(g, state)]);
            if triangles_stay_apart(&start, &end, margin.max(NEAREST)) {
                continue;
            }
            mesh.element_pairs(f, g, |pair| {
                let [start, end] = [x, &y].map(|state| pair.vertices.map(|v| state[v as usize]));
                if !stay_apart(&pair, &start, &end, margin) {
                    back.extend(pair.vertices);
                }
            });
        }
        if back.is_empty() {
            return y;
        }
        back.sort_unstable();
        back.dedup();
        for v in back.into_iter().map(|v| v as usize) {
            drawn[v] += 1;
            y[v] = drawn_back(x[v], wanted[v], drawn[v]);
        }
    }
}

#[test]
fn the_filter_does_what_looking_at_all_pairs_does() {
    let mut random = SplitMix::new(8);
    for round in 0..40 {
        let (mesh, x) = scene(&mut random, 0.004);
        let wanted = moved(&mut random, &x, [0.0005, 0.003, 0.02][round % 3], x.len() - 162);
        let mut y = wanted.clone();
        StepFilter::new(&mesh, &x).step(&x, &mut y, 5e-5);
        assert!(y == brute_force(&mesh, &x, &wanted, 5e-5), "round {round}");
    }
}

#[test]
fn results_do_not_depend_on_threads_and_rest_and_rigid_motion_pass() {
    let mut random = SplitMix::new(12);
    let (mesh, x) = scene(&mut random, 0.003);
    let wanted = moved(&mut random, &x, 0.02, x.len() - 162);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut y = wanted.clone();
            let mut filter = StepFilter::new(&mesh, &x);
            filter.step(&x, &mut y, 5e-5);
            y
        })
    };
    assert!(with(1) == with(4));
    let (sin, cos) = 0.3_f64.sin_cos();
    let turned: Vec<[f64; 3]> =
        x.iter().map(|[x, y, z]| [cos * x - sin * y + 0.4, sin * x + cos * y, z - 0.1]).collect();
    for wanted in [x.clone(), turned] {
        let mut y = wanted.clone();
        let mut filter = StepFilter::new(&mesh, &x);
        filter.step(&x, &mut y, 5e-5);
        assert!(y == wanted);
    }
    assert!(norm(sub(x[0], wanted[0])) > 0.0);
}
