//! The basis against spectra in closed form and a dense solver.

use super::*;
use crate::mesh::{TriMesh, shapes};
use crate::operators::{cotangent_laplacian, lumped_mass};
use std::f64::consts::PI;

fn basis_of(mesh: &TriMesh, count: usize) -> Eigenbasis {
    eigenbasis(&cotangent_laplacian(mesh), &lumped_mass(mesh), count).unwrap()
}

/// Largest deviation of `ΦᵀMΦ` from the identity over the first `used` columns.
fn orthonormality_error(mesh: &TriMesh, basis: &Eigenbasis, used: usize) -> f64 {
    let (mass, k) = (lumped_mass(mesh), basis.values.len());
    let mut worst = 0.0f64;
    for i in 0..used {
        for j in 0..=i {
            let product: f64 = mass
                .iter()
                .enumerate()
                .map(|(v, m)| m * basis.vectors[v * k + i] * basis.vectors[v * k + j])
                .sum();
            worst = worst.max((product - f64::from(u8::from(i == j))).abs());
        }
    }
    worst
}

/// Largest `|Lφ − λMφ|` relative to the scale `λ_k`, in the norm of `M⁻¹`.
fn residual(mesh: &TriMesh, basis: &Eigenbasis, used: usize) -> f64 {
    let (mass, laplacian, k) = (lumped_mass(mesh), cotangent_laplacian(mesh), basis.values.len());
    let mut worst = 0.0f64;
    for j in 0..used {
        let column: Vec<f64> = (0..mass.len()).map(|v| basis.vectors[v * k + j]).collect();
        let image = laplacian.apply(&column);
        let squared: f64 = (0..mass.len())
            .filter(|&v| mass[v] > 0.0)
            .map(|v| (image[v] - basis.values[j] * mass[v] * column[v]).powi(2) / mass[v])
            .sum();
        worst = worst.max(squared.sqrt() / basis.values[used - 1]);
    }
    worst
}

#[test]
fn flat_grid_has_the_neumann_spectrum() {
    // λ = π²(i²/a² + j²/b²) on a free rectangle.
    let (a, b) = (0.5, 0.35);
    let mesh = shapes::irregular_grid(a, b, 70, 49, 0.25, 9);
    let basis = basis_of(&mesh, 32);
    let mut expected: Vec<f64> = (0..40)
        .flat_map(|i| {
            (0..40).map(move |j| PI * PI * (f64::from(i * i) / (a * a) + f64::from(j * j) / (b * b)))
        })
        .collect();
    expected.sort_by(f64::total_cmp);
    assert!(basis.values[0] < 1e-6);
    for j in 1..32 {
        assert!(
            (basis.values[j] / expected[j] - 1.0).abs() < 0.01,
            "{j}: {} {}",
            basis.values[j],
            expected[j]
        );
    }
    assert!(orthonormality_error(&mesh, &basis, 32) < 1e-9);
    assert!(residual(&mesh, &basis, 32) < 1e-6);
}

#[test]
fn sphere_has_eigenvalues_l_times_l_plus_one_with_their_multiplicity() {
    let radius = 0.3;
    let mesh = shapes::icosphere(radius, 5);
    let basis = basis_of(&mesh, 49);
    let mut at = 0;
    for l in 0..7usize {
        for _ in 0..2 * l + 1 {
            let expected = (l * (l + 1)) as f64;
            let found = basis.values[at] * radius * radius;
            assert!((found - expected).abs() <= 0.01 * expected + 1e-7, "{at}: {found} {expected}");
            at += 1;
        }
    }
    assert!(orthonormality_error(&mesh, &basis, 49) < 1e-9);
}

#[test]
fn lanczos_finds_what_the_dense_solver_finds() {
    // Squares, spheres and tubes repeat eigenvalues; none may be missed.
    for mesh in [
        shapes::grid(0.4, 0.4, 22, 22),
        shapes::icosphere(0.2, 3),
        shapes::tube(0.15, 0.5, 24, 20),
        shapes::irregular_grid(1.0, 0.1, 60, 8, 0.4, 8),
    ] {
        let (laplacian, mass) = (cotangent_laplacian(&mesh), lumped_mass(&mesh));
        let vertices: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        let root: Vec<f64> = mass.iter().map(|m| m.sqrt()).collect();
        let Ok((exact, _)) = dense(&scaled_block(&laplacian, &vertices, &root)) else {
            panic!("the dense solver failed")
        };
        for count in [5, 40, 128] {
            assert!(mesh.vertex_count() > 3 * count);
            let basis = eigenbasis(&laplacian, &mass, count).unwrap();
            for j in 0..count {
                assert!((basis.values[j] - exact[j]).abs() <= 1e-8 * exact[count - 1], "{count} {j}");
            }
            assert!(orthonormality_error(&mesh, &basis, count) < 1e-9);
            assert!(residual(&mesh, &basis, count) < 1e-5);
        }
    }
}

#[test]
fn two_equal_components_give_every_eigenvalue_twice() {
    let one = shapes::irregular_grid(0.5, 0.4, 24, 20, 0.3, 2);
    let two = shapes::mapped(&one, |[x, y, z]| [x + 3.0, y, z]);
    let both = shapes::union(&[&one, &two]);
    let (single, double) = (basis_of(&one, 20), basis_of(&both, 40));
    for j in 0..20 {
        for value in &double.values[2 * j..2 * j + 2] {
            assert!((value - single.values[j]).abs() < 1e-6 * single.values[19]);
        }
    }
    assert!(orthonormality_error(&both, &double, 40) < 1e-9);
    // Each vector lives on one component.
    let n = one.vertex_count();
    for j in 0..40 {
        let on = |range: std::ops::Range<usize>| range.into_iter().any(|v| double.vectors[v * 40 + j] != 0.0);
        assert!(on(0..n) != on(n..2 * n));
    }
}

#[test]
fn tiny_meshes_are_solved_and_padded() {
    let triangle = TriMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]).unwrap();
    for (mesh, n) in [(triangle, 3), (shapes::tetrahedron(), 4)] {
        let basis = basis_of(&mesh, 7);
        assert!(orthonormality_error(&mesh, &basis, n) < 1e-12);
        assert!(basis.values[0] < 1e-12 && basis.values[1] > 0.1);
        assert!(basis.values[n..].iter().all(|v| *v == 0.0));
        assert!(basis.vectors.chunks(7).all(|row| row[n..].iter().all(|v| *v == 0.0)));
        assert_eq!(basis_of(&mesh, 0).vectors, [] as [f64; 0]);
        assert_eq!(basis_of(&mesh, 1).values.len(), 1);
    }
}

#[test]
fn regular_tetrahedron_has_its_closed_form() {
    // Edge weights 1/√3 (two cotangents of 60°, halved), equal masses: L = 4w(I − J/4), so λ = 4w/m, three times.
    let mesh = shapes::tetrahedron();
    let basis = basis_of(&mesh, 4);
    let expected = 4.0 / 3f64.sqrt() / (mesh.area() / 4.0);
    for value in &basis.values[1..] {
        assert!((value / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn same_input_same_bits_and_positive_largest_entry() {
    let mesh = shapes::tube(0.2, 0.6, 20, 24);
    let basis = basis_of(&mesh, 30);
    assert_eq!(basis, basis_of(&mesh, 30));
    for j in 0..30 {
        let column = (0..mesh.vertex_count()).map(|v| basis.vectors[v * 30 + j]);
        let (low, high) = column.fold((0.0f64, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        assert!(high >= -low * (1.0 - 1e-5));
    }
}

#[test]
fn eigenvalues_scale_with_the_unit_of_length() {
    let metres = shapes::irregular_grid(0.8, 0.5, 24, 16, 0.3, 6);
    let millimetres = shapes::mapped(&metres, |p| crate::vec3::scale(p, 1e-3));
    let (coarse, fine) = (basis_of(&metres, 16), basis_of(&millimetres, 16));
    for j in 1..16 {
        assert!((coarse.values[j] * 1e6 / fine.values[j] - 1.0).abs() < 1e-8);
    }
}

#[test]
fn collapsed_components_have_no_part_in_the_basis() {
    let sheet = shapes::grid(0.3, 0.3, 18, 18);
    let point = shapes::mapped(&shapes::grid(1.0, 1.0, 18, 18), |_| [2.0, 2.0, 2.0]);
    let line = shapes::mapped(&shapes::grid(1.0, 1.0, 18, 18), |[x, y, _]| [4.0 + x + y, 0.0, 0.0]);
    let mesh = shapes::union(&[&sheet, &point, &line]);
    let (basis, single) = (basis_of(&mesh, 24), basis_of(&sheet, 24));
    assert_eq!(basis.values, single.values);
    assert_eq!(basis.vectors[..single.vectors.len()], single.vectors);
    assert!(basis.vectors[single.vectors.len()..].iter().all(|v| *v == 0.0));
}

#[test]
fn vertices_of_zero_mass_follow_their_neighbours() {
    // Collapsed faces along edges: each adds a vertex of mass zero at the middle of an edge.
    let sheet = shapes::irregular_grid(0.5, 0.4, 30, 24, 0.3, 5);
    let (mut positions, mut faces) = (sheet.positions().to_vec(), sheet.faces().to_vec());
    let mut middles = Vec::new();
    for face in (0..1400).step_by(100) {
        let [a, b, _] = faces[face];
        let middle = positions.len() as u32;
        positions.push(std::array::from_fn(|k| 0.5 * (positions[a as usize][k] + positions[b as usize][k])));
        faces.push([a, middle, b]);
        middles.push((middle as usize, a as usize, b as usize));
    }
    let mesh = TriMesh::new(positions, faces).unwrap();
    let basis = basis_of(&mesh, 20);
    assert!(orthonormality_error(&mesh, &basis, 20) < 1e-6);
    for &(middle, a, b) in &middles {
        for j in 0..20 {
            let at = |v: usize| basis.vectors[v * 20 + j];
            assert!((at(middle) - 0.5 * (at(a) + at(b))).abs() < 0.02 * (1.0 / mesh.area()).sqrt());
        }
    }
}
