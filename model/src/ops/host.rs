//! Tensors in host memory as rows, and parallel loops over fixed chunks of them.

use std::mem::MaybeUninit;
use std::ops::Range;

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;
use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;

use super::instruction_set::vectorised;
use super::matrix_view::MatrixView;
use super::tensors::Tensors;
use crate::packing::Packing;

#[cfg(feature = "flex")]
mod flex;
#[cfg(feature = "ndarray")]
mod ndarray;

/// Elements one task works on: about a second-level cache, so that small tensors stay on one thread.
pub(super) const CHUNK_ELEMENTS: usize = 1 << 14;

/// A backend whose tensors lie in host memory. All are f32.
pub(super) trait HostBackend: Backend {
    /// A matrix with contiguous rows, copied only if its own are not.
    fn hold(matrix: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Read access to a matrix that is [held](Self::hold).
    fn view(held: &FloatTensor<Self>) -> MatrixView<'_>;

    /// All elements of a tensor of any shape in row-major order, which is made so if it is not.
    fn values(tensor: &mut FloatTensor<Self>) -> &[f32];

    /// The same for writing in place; memory that is shared is copied first.
    fn values_mut(tensor: &mut FloatTensor<Self>) -> &mut [f32];

    /// The elements of a matrix whose memory no other tensor shares and that fills its memory, for writing in place.
    fn own_values_mut(_tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        None
    }

    /// `lhs·rhs`, plus the addend if there is one, in the memory of the addend if no other tensor shares it.
    fn product(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: Option<FloatTensor<Self>>,
    ) -> FloatTensor<Self> {
        let product = Self::float_matmul(lhs, rhs);
        match addend {
            Some(addend) => Self::float_add(product, addend),
            None => product,
        }
    }

    /// A matrix from its elements.
    fn matrix(values: Vec<f32>, columns: usize) -> FloatTensor<Self> {
        let rows = values.len() / columns.max(1);
        // The host is the only device of such a backend.
        Self::float_from_data(TensorData::new(values, [rows, columns]), &Default::default())
    }
}

/// Whether a tensor lies in host memory.
pub fn lies_on_host<const D: usize>(tensor: &Tensor<D>) -> bool {
    #[allow(deprecated)]
    let hosts: &[Device] = &[
        #[cfg(feature = "flex")]
        Device::flex(),
        #[cfg(feature = "ndarray")]
        Device::ndarray(),
    ];
    hosts.contains(&tensor.device().inner())
}

/// A run of rows inside one garment.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub(super) garment: usize,
    pub(super) rows: Range<usize>,
}

/// Cuts packed rows into chunks whose size depends on the number of columns only.
pub(super) fn chunks(packing: &Packing, columns: usize) -> Vec<Chunk> {
    let step = (CHUNK_ELEMENTS / columns.max(1)).max(1);
    let of_garment = |(garment, rows): (usize, Range<usize>)| {
        let end = rows.end;
        rows.step_by(step).map(move |start| Chunk { garment, rows: start..(start + step).min(end) })
    };
    packing.ranges().enumerate().flat_map(of_garment).collect()
}

/// What the chunks of rows make one matrix of.
#[derive(Clone, Copy)]
pub(super) enum OutputMatrix {
    /// The same rows, of so many columns.
    Rows(usize),
    /// One row of so many columns per garment: its chunks' rows summed in order, in f64.
    Sums(usize),
}

/// Matrices whose parts `kernel` writes chunk by chunk, in parallel and vectorised; it finds zeros there.
///
/// Chunks have about [`CHUNK_ELEMENTS`] elements in `columns` columns. Mark the kernel `#[inline(always)]`.
pub(super) fn compute<B: HostBackend, const K: usize>(
    packing: &Packing,
    columns: usize,
    outputs: [OutputMatrix; K],
    kernel: impl Fn(&Chunk, [&mut [f32]; K]) + Sync,
) -> Tensors<B> {
    let chunks = chunks(packing, columns);
    let mut matrices = outputs.map(|output| match output {
        OutputMatrix::Rows(columns) => (output, NewValues::of_rows(&chunks, columns)),
        OutputMatrix::Sums(columns) => (output, NewValues::new(vec![columns; chunks.len()])),
    });
    let mut parts = matrices.each_mut().map(|(_, values)| values.parts().into_iter());
    let mut next = || parts.each_mut().map(|parts| parts.next().expect("every chunk has a part"));
    let tasks = chunks.iter().map(|chunk| (chunk, next())).collect();
    for_each(tasks, |(chunk, parts)| {
        let parts = parts.map(zeroed);
        vectorised(
            #[inline(always)]
            || kernel(chunk, parts),
        );
    });
    let matrix = |(output, values): (OutputMatrix, NewValues)| {
        // SAFETY: every part has been filled with zeros at least.
        let values = unsafe { values.finish() };
        match output {
            OutputMatrix::Rows(columns) => B::matrix(values, columns),
            OutputMatrix::Sums(columns) => {
                B::matrix(sum_partials(&values, &chunks, columns, packing.count()), columns)
            }
        }
    };
    matrices.map(matrix).into()
}

/// The elements of a new matrix. Its memory is not zeroed in one pass before the work: the task that computes a part writes
/// that part, in its own cache and in parallel with the others.
pub(super) struct NewValues {
    values: Vec<f32>,
    lengths: Vec<usize>,
}

impl NewValues {
    /// Consecutive parts of the given lengths.
    pub(super) fn new(lengths: Vec<usize>) -> Self {
        Self { values: Vec::with_capacity(lengths.iter().sum()), lengths }
    }

    /// A part for the rows of every chunk.
    pub(super) fn of_rows(chunks: &[Chunk], columns: usize) -> Self {
        Self::new(chunks.iter().map(|chunk| chunk.rows.len() * columns).collect())
    }

    /// The parts, to be written.
    pub(super) fn parts(&mut self) -> Vec<&mut [MaybeUninit<f32>]> {
        split_mut(self.values.spare_capacity_mut(), self.lengths.iter().copied())
    }

    /// The elements.
    ///
    /// # Safety
    /// Every part has been written.
    pub(super) unsafe fn finish(mut self) -> Vec<f32> {
        // SAFETY: promised.
        unsafe { self.values.set_len(self.lengths.iter().sum()) };
        self.values
    }
}

/// Consecutive parts of the given lengths.
pub(super) fn split_mut<T>(mut values: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    let next = |length| values.split_off_mut(..length).expect("parts within the whole");
    lengths.map(next).collect()
}

/// Memory filled with zeros.
#[inline(always)]
pub(super) fn zeroed(memory: &mut [MaybeUninit<f32>]) -> &mut [f32] {
    memory.fill(MaybeUninit::new(0.0));
    // SAFETY: the elements have just been written.
    unsafe { memory.assume_init_mut() }
}

/// Memory filled with rows, one after another.
pub(super) fn filled<'m, 'r>(
    memory: &'m mut [MaybeUninit<f32>],
    rows: impl Iterator<Item = &'r [f32]>,
) -> &'m mut [f32] {
    let mut end = 0;
    for row in rows {
        memory[end..end + row.len()].write_copy_of_slice(row);
        end += row.len();
    }
    assert_eq!(end, memory.len(), "rows that fill the memory");
    // SAFETY: all elements have just been written.
    unsafe { memory.assume_init_mut() }
}

/// Runs one task per chunk; a single one stays on this thread.
pub(super) fn for_each<T: Send>(tasks: Vec<T>, run: impl Fn(T) + Send + Sync) {
    if tasks.len() < 2 {
        tasks.into_iter().for_each(run);
    } else {
        tasks.into_par_iter().for_each(run);
    }
}

/// Adds the rows of `partial` (one per chunk) into one row per garment, in chunk order, in f64.
fn sum_partials(partial: &[f32], chunks: &[Chunk], columns: usize, garments: usize) -> Vec<f32> {
    let mut sums = vec![0.0_f64; garments * columns];
    for (chunk, row) in chunks.iter().zip(partial.chunks_exact(columns.max(1))) {
        let sum = &mut sums[chunk.garment * columns..(chunk.garment + 1) * columns];
        for (sum, value) in sum.iter_mut().zip(row) {
            *sum += f64::from(*value);
        }
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}
