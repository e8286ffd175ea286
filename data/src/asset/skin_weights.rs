//! Sparse linear-blend-skinning weights.

/// Per vertex a short list of (joint, weight) in compressed rows; each row sums to one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseSkinWeights {
    offsets: Vec<u32>,
    joints: Vec<u16>,
    weights: Vec<f32>,
}

/// Weights at most this large move no vertex by more than a micrometre and are dropped.
const NEGLIGIBLE_WEIGHT: f32 = 1e-6;

impl SparseSkinWeights {
    /// From one list of (joint, weight) per vertex; negligible weights are dropped and each row is scaled to sum one.
    pub fn from_rows<R: IntoIterator<Item = (u16, f32)>>(rows: impl IntoIterator<Item = R>) -> Self {
        let mut sparse = Self { offsets: vec![0], joints: Vec::new(), weights: Vec::new() };
        for row in rows {
            let start = sparse.weights.len();
            for (joint, weight) in row {
                if weight > NEGLIGIBLE_WEIGHT || !weight.is_finite() {
                    sparse.joints.push(joint);
                    sparse.weights.push(weight);
                }
            }
            let sum: f64 = sparse.weights[start..].iter().map(|w| f64::from(*w)).sum();
            // Rows that are normalised already stay as they are, bit for bit, so that saved weights load unchanged.
            if sum > 0.0 && (sum - 1.0).abs() > 1e-6 {
                for w in &mut sparse.weights[start..] {
                    *w = (f64::from(*w) / sum) as f32;
                }
            }
            sparse.offsets.push(sparse.weights.len() as u32);
        }
        sparse
    }

    /// From a dense row-major `[vertices × joint_count]` matrix.
    pub fn from_dense(dense: &[f32], joint_count: usize) -> Self {
        Self::from_rows(
            dense
                .chunks_exact(joint_count.max(1))
                .map(|row| row.iter().enumerate().map(|(j, w)| (j as u16, *w))),
        )
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Joints and weights of one vertex.
    ///
    /// # Panics
    /// If `vertex` is not below [`Self::vertex_count`].
    pub fn row(&self, vertex: usize) -> (&[u16], &[f32]) {
        let range = self.offsets[vertex] as usize..self.offsets[vertex + 1] as usize;
        (&self.joints[range.clone()], &self.weights[range])
    }

    /// The joints of one vertex, each with its weight.
    ///
    /// # Panics
    /// As [`Self::row`].
    #[inline]
    pub fn of_vertex(&self, vertex: usize) -> impl Iterator<Item = (usize, f32)> {
        let (joints, weights) = self.row(vertex);
        joints.iter().zip(weights).map(|(joint, weight)| (usize::from(*joint), *weight))
    }

    /// Dense row-major `[vertices × joint_count]`; joints at or past `joint_count` are left out.
    pub fn to_dense(&self, joint_count: usize) -> Vec<f32> {
        let mut dense = vec![0.0; self.vertex_count() * joint_count];
        for v in 0..self.vertex_count() {
            for (j, w) in self.of_vertex(v).filter(|(j, _)| *j < joint_count) {
                dense[v * joint_count + j] += w;
            }
        }
        dense
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dense_round_trip_and_normalisation() {
        let dense = [0.5f32, 0.0, 0.5, 0.0, 2.0, 0.0, 0.1, 0.1, 0.2];
        let sparse = SparseSkinWeights::from_dense(&dense, 3);
        assert_eq!(sparse.vertex_count(), 3);
        assert_eq!(sparse.row(1), (&[1u16][..], &[1.0f32][..]));
        let back = sparse.to_dense(3);
        for (row, expected) in back.chunks(3).zip([[0.5, 0.0, 0.5], [0.0, 1.0, 0.0], [0.25, 0.25, 0.5]]) {
            assert!(row.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-6));
        }
    }
}
