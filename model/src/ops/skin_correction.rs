//! Skin weights plus a correction restricted to the joints a garment uses.

#[cfg(feature = "gpu")]
use burn::backend::Cube;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::{Chunk, HostBackend, OutputMatrix, compute};
use super::matrix_view::MatrixView;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;
use crate::packing::Packing;

/// `weights + scale·P(raw)`: weights and raw `[ΣV,J]`, mask `[M,J]` of zeros and ones.
///
/// P keeps the joints of the row's garment and, if `zero_sum`, removes their mean, so that the sum of a row's weights does
/// not change. P is a symmetric projection, hence its own backward pass. The mask gets no gradient.
pub fn skin_correction(
    weights: Tensor<2>,
    raw: Tensor<2>,
    mask: Tensor<2>,
    packing: &Packing,
    scale: f64,
    zero_sum: bool,
) -> Tensor<2> {
    apply(Projection { packing: packing.clone(), scale, zero_sum }, [mask, raw, weights])
}

/// `base + scale·P(values)`. Arguments: mask, values, and the base unless it is zero.
#[derive(Clone, Debug)]
struct Projection {
    packing: Packing,
    scale: f64,
    zero_sum: bool,
}

impl Operation<3> for Projection {
    fn saves(&self, _: [bool; 3]) -> Saves<3> {
        Saves { arguments: [true, false, false], result: false }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, 3>, gradient: FloatTensor<B>) -> ArgumentGradients<B, 3> {
        let [of_values] = B::run(self, saved.with(gradient.clone())).take();
        [None, Some(of_values), Some(gradient)]
    }
}

impl TensorKernel for Projection {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let (mask_and_values, base) = arguments.take_optional();
        [gpu::projection(mask_and_values, base, &self.packing, self.scale, self.zero_sum)].into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let (held, base) = arguments.take_optional();
        let (held, base) = (held.map(B::hold), base.map(B::hold));
        let ([mask, values], base) = (held.each_ref().map(B::view), base.as_ref().map(B::view));
        let joints = values.columns();
        compute(
            &self.packing,
            joints,
            [OutputMatrix::Rows(joints)],
            #[inline(always)]
            |chunk, [output]| self.project(values, mask, base, chunk, output),
        )
    }
}

impl Projection {
    #[inline(always)]
    fn project(
        &self,
        values: MatrixView<'_>,
        mask: MatrixView<'_>,
        base: Option<MatrixView<'_>>,
        chunk: &Chunk,
        output: &mut [f32],
    ) {
        let mask = mask.row(chunk.garment);
        let joints = mask.len();
        let count: f32 = mask.iter().sum();
        let share = if self.zero_sum { 1.0 / count.max(1.0) } else { 0.0 };
        let scale = self.scale as f32;
        for (row, output) in chunk.rows.clone().zip(output.chunks_exact_mut(joints)) {
            let values = &values.row(row)[..joints];
            let mut sum = 0.0;
            for joint in 0..joints {
                output[joint] = mask[joint] * values[joint];
                sum += output[joint];
            }
            let mean = share * sum;
            for joint in 0..joints {
                output[joint] = scale * (output[joint] - mean * mask[joint]);
            }
            if let Some(base) = base {
                let base = &base.row(row)[..joints];
                for joint in 0..joints {
                    output[joint] += base[joint];
                }
            }
        }
    }
}
