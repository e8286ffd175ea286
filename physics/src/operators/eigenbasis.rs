//! The smallest generalised eigenpairs `L φ = λ M φ`, one connected component at a time.

use faer::Mat;

use crate::operators::lanczos::{Failure, dense_eigenpairs, smallest_eigenpairs};
use crate::operators::{OperatorError, SparseMatrix};

/// The smallest mass in the eigenvalue problem, relative to the mean mass of the component.
const MASS_FLOOR: f64 = 1e-6;

/// The smallest area of a component that has a basis, relative to the whole.
const AREA_FLOOR: f64 = 1e-12;

/// Components of up to this many vertices are solved densely.
const DENSE_LIMIT: usize = 200;

/// The lower end of the Laplacian's spectrum.
#[derive(Debug, Clone, PartialEq)]
pub struct Eigenbasis {
    /// Eigenvalues `[k]` (1/m²), ascending; zero in padded columns.
    pub values: Vec<f64>,
    /// Eigenvectors `[V, k]` row-major (1/m); padded columns are zero.
    pub vectors: Vec<f64>,
}

/// The `count` smallest eigenpairs of `L φ = λ M φ`, mass-orthonormal, for a Laplacian `[V, V]` and lumped masses `[V]`.
///
/// Every connected component of the Laplacian has its own basis, zero on the others, so a repeated eigenvalue of equal
/// components mixes nothing and stalls nothing; the pairs are then merged in ascending order (equal ones by component). When
/// there are fewer than `count` pairs the rest is zero columns. The sign of a vector makes its entry of largest magnitude
/// positive.
///
/// Small components go to a dense solver, large ones to block Lanczos on `(C + σI)⁻¹` with `C = M^{-1/2} L M^{-1/2}` and
/// `σ = 4π / area`, about the first eigenvalue by Weyl's law.
///
/// Masses below 10⁻⁶ of their component's mean count as that, inside this solve only: the problem stays definite, and such a
/// vertex follows its neighbours. A component without area (a single vertex, faces collapsed to a point or a line) carries
/// no function: its rows are zero.
///
/// # Errors
/// [`OperatorError::Factorisation`] or [`OperatorError::NotConverged`], naming the component.
pub fn eigenbasis(laplacian: &SparseMatrix, mass: &[f64], count: usize) -> Result<Eigenbasis, OperatorError> {
    struct Pair {
        value: f64,
        component: usize,
        column: usize,
    }
    let components = members(laplacian, mass);
    let mut pairs = Vec::new();
    let mut bases = Vec::with_capacity(components.len());
    for vertices in &components {
        let (values, vectors) = component_basis(laplacian, mass, vertices, count)?;
        let component = bases.len();
        pairs.extend(values.iter().enumerate().map(|(column, &value)| Pair { value, component, column }));
        bases.push(vectors);
    }
    pairs.sort_by(|a, b| a.value.total_cmp(&b.value));
    pairs.truncate(count);

    let mut values = vec![0.0; count];
    let mut vectors = vec![0.0; mass.len() * count];
    for (target, pair) in pairs.iter().enumerate() {
        values[target] = pair.value;
        let basis = &bases[pair.component];
        let sign = sign(basis.col_as_slice(pair.column));
        for (row, &vertex) in components[pair.component].iter().enumerate() {
            vectors[vertex as usize * count + target] = sign * basis[(row, pair.column)];
        }
    }
    Ok(Eigenbasis { values, vectors })
}

/// Connected components of the Laplacian that have an area, each ascending, ordered by their lowest vertex.
///
/// Not those of the faces: a face collapsed to a point has no entries, and a vertex with only such faces hangs on nothing.
fn members(laplacian: &SparseMatrix, mass: &[f64]) -> Vec<Vec<u32>> {
    let smallest_area = AREA_FLOOR * mass.iter().sum::<f64>();
    let mut seen = vec![false; mass.len()];
    let mut components = Vec::new();
    for seed in 0..mass.len() {
        if std::mem::replace(&mut seen[seed], true) {
            continue;
        }
        let mut vertices = vec![seed as u32];
        let mut next = 0;
        while next < vertices.len() {
            for &neighbour in laplacian.row(vertices[next] as usize).0 {
                if !std::mem::replace(&mut seen[neighbour as usize], true) {
                    vertices.push(neighbour);
                }
            }
            next += 1;
        }
        if vertices.iter().map(|&v| mass[v as usize]).sum::<f64>() > smallest_area {
            vertices.sort_unstable();
            components.push(vertices);
        }
    }
    components
}

/// Eigenvalues ascending and eigenvectors by column on one component.
fn component_basis(
    laplacian: &SparseMatrix,
    mass: &[f64],
    vertices: &[u32],
    count: usize,
) -> Result<(Vec<f64>, Mat<f64>), OperatorError> {
    let n = vertices.len();
    let wanted = count.min(n);
    if wanted == 0 {
        return Ok((Vec::new(), Mat::zeros(n, 0)));
    }
    let area: f64 = vertices.iter().map(|&v| mass[v as usize]).sum();
    let floor = MASS_FLOOR * area / n as f64;
    // In units of 4π / area the first eigenvalues are of order one, whatever the unit of length.
    let unit = 4.0 * std::f64::consts::PI / area;
    let root: Vec<f64> = vertices.iter().map(|&v| (mass[v as usize].max(floor) * unit).sqrt()).collect();
    let scaled = scaled_block(laplacian, vertices, &root);

    let solved = if n <= DENSE_LIMIT || n <= 3 * wanted {
        dense(&scaled)
    } else {
        let length = root.iter().map(|r| r * r).sum::<f64>().sqrt();
        let kernel: Vec<f64> = root.iter().map(|r| r / length).collect();
        smallest_eigenpairs(&scaled, &kernel, wanted)
    };
    let (mut values, mut vectors) = solved.map_err(|failure| match failure {
        Failure::Factorisation(what) => OperatorError::Factorisation { what, vertex: vertices[0], size: n },
        Failure::NotConverged(residual) => {
            OperatorError::NotConverged { vertex: vertices[0], size: n, residual }
        }
    })?;
    values.truncate(wanted);
    for column in 0..wanted {
        values[column] *= unit;
        for row in 0..n {
            vectors[(row, column)] *= unit.sqrt() / root[row];
        }
    }
    Ok((values, vectors))
}

/// `M^{-1/2} L M^{-1/2}` on one component, in local numbering.
fn scaled_block(laplacian: &SparseMatrix, vertices: &[u32], root: &[f64]) -> SparseMatrix {
    let local = |vertex: u32| vertices.binary_search(&vertex).ok();
    let mut triplets = Vec::new();
    for (row, &vertex) in vertices.iter().enumerate() {
        let (columns, values) = laplacian.row(vertex as usize);
        for (&neighbour, &value) in columns.iter().zip(values) {
            if let Some(column) = local(neighbour) {
                triplets.push((row as u32, column as u32, value / (root[row] * root[column])));
            }
        }
    }
    SparseMatrix::from_triplets(vertices.len(), vertices.len(), triplets)
}

fn dense(matrix: &SparseMatrix) -> Result<(Vec<f64>, Mat<f64>), Failure> {
    let n = matrix.rows();
    let mut full = Mat::<f64>::zeros(n, n);
    for row in 0..n {
        let (columns, values) = matrix.row(row);
        for (&column, &value) in columns.iter().zip(values) {
            full[(row, column as usize)] = value;
        }
    }
    let (mut values, vectors) =
        dense_eigenpairs(full.as_ref()).ok_or(Failure::Factorisation("the dense eigenvalue solver"))?;
    // Rounding may leave the zero of the constants slightly negative.
    for value in &mut values {
        *value = value.max(0.0);
    }
    Ok((values, vectors))
}

/// +1 if the entry of largest magnitude is positive. Among entries that tie up to rounding the first one decides.
fn sign(column: &[f64]) -> f64 {
    let largest = column.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let decisive = column.iter().find(|v| v.abs() >= (1.0 - 1e-6) * largest).copied().unwrap_or(0.0);
    if decisive < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
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
            let on =
                |range: std::ops::Range<usize>| range.into_iter().any(|v| double.vectors[v * 40 + j] != 0.0);
            assert!(on(0..n) != on(n..2 * n));
        }
    }

    #[test]
    fn tiny_meshes_are_solved_and_padded() {
        let triangle =
            TriMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]).unwrap();
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
            positions
                .push(std::array::from_fn(|k| 0.5 * (positions[a as usize][k] + positions[b as usize][k])));
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
}
