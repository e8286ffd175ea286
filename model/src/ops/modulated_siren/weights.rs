//! Right factors of the products of a pass.

use crate::ops::matrix_view::MatrixView;
use crate::ops::tile::RightFactor;

/// The weights of a modulated SIREN, or their transposes.
pub(super) struct SirenWeights {
    pub(super) gates: Vec<RightFactor>,
    /// One for every sine layer.
    pub(super) sines: Vec<RightFactor>,
    pub(super) output: RightFactor,
}

impl SirenWeights {
    /// Of the weights between gates, of the first sine layer, of the others and of the output layer.
    pub(super) fn new([gates, first, sines, output]: [MatrixView<'_>; 4], transposed: bool) -> Self {
        let factor =
            |matrix: MatrixView<'_>| RightFactor::new(if transposed { matrix.transposed() } else { matrix });
        // Square matrices that lie one below the other.
        let squares = |matrices: MatrixView<'_>| -> Vec<RightFactor> {
            let width = matrices.columns();
            let starts = (0..matrices.rows()).step_by(width);
            starts.map(|start| factor(matrices.some_rows(start..start + width))).collect()
        };
        let sines = std::iter::once(factor(first)).chain(squares(sines)).collect();
        Self { gates: squares(gates), sines, output: factor(output) }
    }
}
