//! Sparse matrices in compressed rows.

/// A sparse matrix in compressed-row form; within a row, columns ascend and are unique.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix {
    columns_count: usize,
    offsets: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl SparseMatrix {
    /// Builds from `(row, column, value)` entries; entries at the same place are summed in the order given.
    ///
    /// # Panics
    /// If an entry lies outside `rows × columns_count`.
    pub fn from_triplets(rows: usize, columns_count: usize, mut triplets: Vec<(u32, u32, f64)>) -> Self {
        // A stable sort keeps the order of summation, hence every bit of the result.
        triplets.sort_by_key(|&(row, column, _)| (row, column));
        let is_inside =
            |(row, column, _): &(u32, u32, f64)| (*row as usize) < rows && (*column as usize) < columns_count;
        assert!(triplets.iter().all(is_inside), "entry outside the matrix");
        let (mut offsets, mut columns, mut values) = (vec![0u32; rows + 1], Vec::new(), Vec::new());
        for same_place in triplets.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (row, column, first) = same_place[0];
            columns.push(column);
            values.push(same_place[1..].iter().fold(first, |sum, (.., value)| sum + value));
            offsets[row as usize + 1] += 1;
        }
        for row in 0..rows {
            offsets[row + 1] += offsets[row];
        }
        Self { columns_count, offsets, columns, values }
    }

    /// Zeros that are stored at these columns, ascending, of every row of a square matrix.
    pub(crate) fn zeros<R: Iterator<Item = u32>>(
        columns_count: usize,
        rows: impl Iterator<Item = R>,
    ) -> Self {
        let (mut offsets, mut columns) = (vec![0], Vec::new());
        for row in rows {
            columns.extend(row);
            offsets.push(columns.len() as u32);
        }
        let values = vec![0.0; columns.len()];
        Self { columns_count, offsets, columns, values }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns_count
    }

    /// Number of stored entries.
    pub fn entry_count(&self) -> usize {
        self.values.len()
    }

    /// Column indices and values of one row.
    pub fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let range = self.offsets[row] as usize..self.offsets[row + 1] as usize;
        (&self.columns[range.clone()], &self.values[range])
    }

    /// The entry at `(row, column)`, zero where none is stored.
    #[cfg(test)]
    pub fn get(&self, row: usize, column: u32) -> f64 {
        let (columns, values) = self.row(row);
        columns.binary_search(&column).map_or(0.0, |at| values[at])
    }

    /// The product with a vector of `columns()` values.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        self.apply_columns(x, 1)
    }

    /// The product with a dense row-major matrix `[columns(), width]`; `[rows(), width]` row-major.
    pub fn apply_columns(&self, x: &[f64], width: usize) -> Vec<f64> {
        let mut result = vec![0.0; self.rows() * width];
        if width == 0 {
            return result;
        }
        for (row, out) in result.chunks_exact_mut(width).enumerate() {
            let (columns, values) = self.row(row);
            for (&column, &value) in columns.iter().zip(values) {
                let from = &x[column as usize * width..][..width];
                for (o, &f) in out.iter_mut().zip(from) {
                    *o += value * f;
                }
            }
        }
        result
    }

    pub(super) fn offsets(&self) -> &[u32] {
        &self.offsets
    }

    pub(super) fn column_indices(&self) -> &[u32] {
        &self.columns
    }

    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }

    /// Where the entries of a row begin among all.
    pub(crate) fn start(&self, row: usize) -> usize {
        self.offsets[row] as usize
    }

    /// The stored entries, row by row; where they are stays as it is.
    pub(crate) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triplets_are_summed_and_sorted() {
        let matrix =
            SparseMatrix::from_triplets(3, 2, vec![(2, 1, 4.0), (0, 1, 1.0), (0, 0, 2.0), (2, 1, -1.5)]);
        assert_eq!((matrix.rows(), matrix.columns(), matrix.entry_count()), (3, 2, 3));
        assert_eq!(matrix.row(0), (&[0, 1][..], &[2.0, 1.0][..]));
        assert_eq!(matrix.row(1).0.len(), 0);
        assert_eq!((matrix.get(2, 1), matrix.get(2, 0)), (2.5, 0.0));
        assert_eq!(matrix.apply(&[10.0, 100.0]), [120.0, 0.0, 250.0]);
        assert_eq!(matrix.apply_columns(&[1.0, 0.0, 0.0, 1.0], 2), [2.0, 1.0, 0.0, 0.0, 0.0, 2.5]);
    }
}
