//! The smallest generalised eigenpairs `L φ = λ M φ`, one connected component at a time.

use faer::Mat;

use crate::mesh::DisjointSets;
use crate::operators::lanczos::{Failure, dense_eigenpairs, smallest_eigenpairs};
use crate::operators::{OperatorError, SparseMatrix};
use crate::rows::CompressedRows;

/// The smallest mass in the eigenvalue problem, relative to the mean mass of the component.
const MASS_FLOOR: f64 = 1e-6;

/// The smallest area of a component that has a basis, relative to the whole.
const COMPONENT_AREA_FLOOR: f64 = 1e-12;

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
    let components = members(laplacian, mass);
    // Eigenvalue, component, column in its basis.
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    let mut bases = Vec::with_capacity(components.len());
    for vertices in &components {
        let (values, vectors) = component_basis(laplacian, mass, vertices, count)?;
        let component = bases.len();
        pairs.extend(values.iter().enumerate().map(|(column, &value)| (value, component, column)));
        bases.push(vectors);
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs.truncate(count);

    let mut values = vec![0.0; count];
    let mut vectors = vec![0.0; mass.len() * count];
    for (target, &(value, component, column)) in pairs.iter().enumerate() {
        values[target] = value;
        let basis = &bases[component];
        let sign = sign(basis.col_as_slice(column));
        for (row, &vertex) in components[component].iter().enumerate() {
            vectors[vertex as usize * count + target] = sign * basis[(row, column)];
        }
    }
    Ok(Eigenbasis { values, vectors })
}

/// Connected components of the Laplacian that have an area, each ascending, ordered by their lowest vertex.
///
/// Not those of the faces: a face collapsed to a point has no entries, and a vertex with only such faces hangs on nothing.
fn members(laplacian: &SparseMatrix, mass: &[f64]) -> Vec<Vec<u32>> {
    let smallest_area = COMPONENT_AREA_FLOOR * mass.iter().sum::<f64>();
    let mut sets = DisjointSets::new(mass.len());
    for vertex in 0..mass.len() {
        laplacian.row(vertex).0.iter().for_each(|&neighbour| sets.join(vertex as u32, neighbour));
    }
    let rooted: Vec<(usize, u32)> = (0..mass.len() as u32).map(|v| (sets.root(v) as usize, v)).collect();
    let components = CompressedRows::grouped(mass.len(), rooted.into_iter());
    let area = |vertices: &[u32]| vertices.iter().map(|&v| mass[v as usize]).sum::<f64>();
    let all = (0..mass.len()).map(|lowest| components.row(lowest));
    all.filter(|vertices| area(vertices) > smallest_area).map(<[u32]>::to_vec).collect()
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
mod tests;
