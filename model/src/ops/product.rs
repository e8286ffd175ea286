//! Matrix products: on a GPU as in `gpu::product`, in host memory written straight into their place.
//!
//! burn's flex backend zeroes the memory of every product, copies it to aligned memory, and only then multiplies; for the
//! narrow matrices of these networks (width 128) that takes a quarter of the time of the multiplication. Here tiles of the
//! result go from registers (`tile`) into fresh memory, or are added to a matrix whose memory no other tensor shares.

#[cfg(feature = "gpu")]
use burn::backend::Cube;
#[cfg(feature = "gpu")]
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Tensor;

#[cfg(feature = "gpu")]
use super::gpu;
use super::host::HostBackend;
use super::operation::{ArgumentGradients, FusedOps, Operation, Saved, Saves, TensorKernel, apply};
use super::tensors::Tensors;

/// `lhs·rhs`: `[N,K]`, `[K,C]` → `[N,C]`.
///
/// # Panics
/// If the inner sizes differ.
pub fn product(lhs: Tensor<2>, rhs: Tensor<2>) -> Tensor<2> {
    apply(MatrixProduct, [lhs, rhs])
}

/// `lhs·rhs + addend`: `[N,K]`, `[K,C]`, `[N,C]` → `[N,C]`; in the memory of `addend` if no other tensor shares it.
///
/// # Panics
/// If the sizes disagree.
pub fn product_add(lhs: Tensor<2>, rhs: Tensor<2>, addend: Tensor<2>) -> Tensor<2> {
    apply(MatrixProduct, [lhs, rhs, addend])
}

/// The factors, then the addend if there is one.
#[derive(Clone, Copy, Debug)]
struct MatrixProduct;

impl TensorKernel for MatrixProduct {
    #[cfg(feature = "gpu")]
    fn on_gpu(&self, arguments: Tensors<Cube>) -> Tensors<Cube> {
        let ([lhs, rhs], addend) = arguments.take_optional();
        let product = gpu::product(lhs, rhs);
        [match addend {
            Some(addend) => Cube::float_add(product, addend),
            None => product,
        }]
        .into()
    }

    fn on_host<B: HostBackend>(&self, arguments: Tensors<B>) -> Tensors<B> {
        let ([lhs, rhs], addend) = arguments.take_optional();
        [B::product(lhs, rhs, addend)].into()
    }
}

impl<const N: usize> Operation<N> for MatrixProduct {
    /// Each factor, where the gradient of the other one is wanted.
    fn saves(&self, tracked: [bool; N]) -> Saves<N> {
        let mut arguments = [false; N];
        [arguments[0], arguments[1]] = [tracked[1], tracked[0]];
        Saves { arguments, result: false }
    }

    fn backward<B: FusedOps>(&self, saved: Saved<B, N>, gradient: FloatTensor<B>) -> ArgumentGradients<B, N> {
        let transposed = |matrix| B::float_swap_dims(matrix, 0, 1);
        let multiply = |lhs, rhs| {
            let [product] = B::run(self, [lhs, rhs].into()).take();
            product
        };
        let mut factors = saved.arguments.into_iter();
        let (lhs, rhs) = (factors.next().flatten(), factors.next().flatten());
        let of_lhs = rhs.map(|rhs| multiply(gradient.clone(), transposed(rhs)));
        let of_rhs = lhs.map(|lhs| multiply(transposed(lhs), gradient.clone()));
        let mut gradients = [of_lhs, of_rhs, Some(gradient)].into_iter();
        std::array::from_fn(|_| gradients.next().flatten())
    }
}
