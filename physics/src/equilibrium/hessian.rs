//! The Gauss–Newton matrix of a scene and its Cholesky factor.

use faer::MatMut;

use super::Problem;
use crate::energy::{CurvatureSink, crease_reach};
use crate::operators::SparseMatrix;
use crate::operators::cholesky::Cholesky;
use crate::rows::CompressedRows;

/// One triangle of a sparse symmetric matrix of 3×3 blocks, and its factor.
///
/// Where blocks are and in which order to eliminate them is found once for a garment. Garments of an outfit touch each
/// other elsewhere in every state: blocks that have no place get one, and none is given up.
pub(super) struct Hessian {
    /// The vertices that every vertex has a block with, from itself on.
    blocks: CompressedRows<u32>,
    /// The same triangle over coordinates, without what is below the diagonal.
    matrix: SparseMatrix,
    /// The diagonal entries without the shift.
    diagonal: Vec<f64>,
    factor: Option<Cholesky>,
}

impl Hessian {
    /// For `count` vertices: blocks get their place when they are first added to.
    pub fn new(count: usize) -> Self {
        Self::with_blocks(count, (0..count as u32).map(|v| [v, v]).collect())
    }

    /// Of `count` vertices with blocks for `pairs`, which may come twice.
    fn with_blocks(count: usize, mut pairs: Vec<[u32; 2]>) -> Self {
        // Stable: it merges what is sorted already.
        pairs.sort();
        pairs.dedup();
        let keyed = pairs.iter().map(|[row, column]| (*row as usize, *column));
        let blocks = CompressedRows::grouped(count, keyed);
        let rows = (0..3 * count).map(|row| {
            let (vertex, r) = (row / 3, row % 3);
            blocks.row(vertex).iter().flat_map(move |&column| {
                let first = if column as usize == vertex { r as u32 } else { 0 };
                (first..3).map(move |c| 3 * column + c)
            })
        });
        let matrix = SparseMatrix::zeros(3 * count, rows);
        let factor = Cholesky::analysed_in_blocks(&matrix, &blocks);
        Self { blocks, matrix, diagonal: Vec::new(), factor }
    }

    /// Makes room for more blocks; those that have a place keep one. Cloth that slides touches there again.
    fn grow(&mut self, missing: Vec<[u32; 2]>) {
        let count = self.blocks.len();
        let known = (0..count).flat_map(|row| self.blocks.row(row).iter().map(move |&c| [row as u32, c]));
        let mut pairs: Vec<[u32; 2]> = known.collect();
        let mut missing = missing;
        missing.sort_unstable();
        pairs.extend(missing);
        *self = Self::with_blocks(count, pairs);
    }

    /// Takes the curvature of `problem` at `posed`, with creases as if they were smooth over `width` (m), and returns
    /// the `gradient` there as changed by that.
    pub fn assemble(
        &mut self,
        problem: &Problem<'_>,
        posed: &[[f64; 3]],
        gradient: &[[f64; 3]],
        width: f64,
    ) -> Vec<[f64; 3]> {
        let missing = self.add_curvature(problem, posed);
        if !missing.is_empty() {
            self.grow(missing);
            self.add_curvature(problem, posed);
        }
        let mut smooth = gradient.to_vec();
        let mut blocks = Blocks { hessian: self, missing: Vec::new() };
        problem.creases(posed, [crease_reach(width), f64::INFINITY]).smooth(width, &mut smooth, &mut blocks);
        self.diagonal = (0..self.matrix.rows()).map(|row| self.matrix.row(row).1[0]).collect();
        smooth
    }

    /// Takes the curvature at `posed` alone; returns the blocks that have no place.
    fn add_curvature(&mut self, problem: &Problem<'_>, posed: &[[f64; 3]]) -> Vec<[u32; 2]> {
        self.matrix.values_mut().fill(0.0);
        let mut blocks = Blocks { hessian: self, missing: Vec::new() };
        problem.curvature(posed, &mut blocks);
        blocks.missing
    }

    /// `−(H + shift·mean·I)⁻¹ g`, `mean` being that of the diagonal; `None` where that is not positive definite.
    pub fn direction(&mut self, gradient: &[[f64; 3]], shift: f64) -> Option<Vec<[f64; 3]>> {
        let rows = self.matrix.rows();
        let mean = self.diagonal.iter().sum::<f64>() / rows.max(1) as f64;
        // Where no term is curved any length will do.
        let mean = if mean > 0.0 { mean } else { 1.0 };
        for row in 0..rows {
            let at = self.matrix.start(row);
            self.matrix.values_mut()[at] = self.diagonal[row] + shift * mean;
        }
        let factor = self.factor.as_mut()?;
        if !factor.factorise(&self.matrix) {
            return None;
        }
        let mut direction: Vec<[f64; 3]> = gradient.iter().map(|g| g.map(|x| -x)).collect();
        factor.solve_in_place(MatMut::from_column_major_slice_mut(direction.as_flattened_mut(), rows, 1));
        Some(direction)
    }

    /// Adds to the block at a place.
    #[inline(always)]
    fn add(&mut self, [row, column]: [u32; 2], place: usize, block: [[f64; 3]; 3]) {
        let is_diagonal = row == column;
        for (r, line) in block.iter().enumerate() {
            // Rows of a block on the diagonal start on it.
            let start = self.matrix.start(3 * row as usize + r);
            let values = self.matrix.values_mut();
            match is_diagonal {
                true => (r..3).for_each(|c| values[start + c - r] += line[c]),
                false => (0..3).for_each(|c| values[start + 3 * place - r + c] += line[c]),
            }
        }
    }
}

/// Adds blocks to the matrix.
struct Blocks<'a> {
    hessian: &'a mut Hessian,
    /// Blocks without a place.
    missing: Vec<[u32; 2]>,
}

impl CurvatureSink for Blocks<'_> {
    #[inline]
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        let (pair, block) = match i <= j {
            true => ([i as u32, j as u32], block),
            false => ([j as u32, i as u32], transposed(block)),
        };
        if i == j {
            return self.hessian.add(pair, 0, block);
        }
        match self.hessian.blocks.row(pair[0] as usize).binary_search(&pair[1]) {
            Ok(place) => self.hessian.add(pair, place, block),
            Err(_) => self.missing.push(pair),
        }
    }
}

fn transposed(block: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| block[c][r]))
}
