//! Tensors in host memory as rows, and parallel loops over fixed chunks of them.

use std::mem::MaybeUninit;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::backend::Backend;
use burn::backend::tensor::FloatTensor;
use burn::tensor::TensorData;
use rayon::prelude::*;

use super::composed::multiply_add;
use super::tensors::Tensors;
use super::tile::StridedMatrix;
use crate::packing::Packing;

#[cfg(feature = "flex")]
mod flex;
#[cfg(feature = "ndarray")]
mod ndarray;

/// Elements one task works on: about a second-level cache, so that small tensors stay on one thread.
pub(super) const CHUNK_ELEMENTS: usize = 1 << 14;

/// A backend whose tensors can be read in place.
pub(super) trait HostBackend: Backend {
    /// A tensor held in a layout with contiguous rows.
    type Held: Send + Sync;

    /// Holds a matrix for reading, copying only if its rows are not contiguous.
    fn hold(tensor: FloatTensor<Self>) -> Self::Held;

    /// Read access to a held matrix.
    fn view(held: &Self::Held) -> MatrixView<'_>;

    /// All elements of a tensor of any shape in row-major order, which is made so if it is not. `None` if the elements are
    /// not f32 or the backend does not lend them.
    fn values(_tensor: &mut FloatTensor<Self>) -> Option<&[f32]> {
        None
    }

    /// The same for writing in place; memory that is shared is copied first.
    fn values_mut(_tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        None
    }

    /// The elements of a matrix whose memory no other tensor shares and that fills its memory, for writing in place; `None`
    /// otherwise, or if they are not f32.
    fn own_values_mut(_tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        None
    }

    /// `lhs·rhs`, plus the addend if there is one, in the memory of the addend if no other tensor shares it.
    fn product(
        lhs: FloatTensor<Self>,
        rhs: FloatTensor<Self>,
        addend: Option<FloatTensor<Self>>,
    ) -> FloatTensor<Self> {
        multiply_add::<Self>(lhs, rhs, addend)
    }

    /// A matrix from its elements.
    fn matrix(values: Vec<f32>, columns: usize) -> FloatTensor<Self> {
        let rows = values.len() / columns.max(1);
        // The host is the only device of such a backend.
        Self::float_from_data(TensorData::new(values, [rows, columns]), &Default::default())
    }
}

/// Read access to a matrix whose rows are contiguous.
#[derive(Clone, Copy)]
pub(super) struct MatrixView<'a> {
    values: &'a [f32],
    row_stride: usize,
    columns: usize,
    rows: usize,
}

impl<'a> MatrixView<'a> {
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The matrix as a factor of a product.
    pub(super) fn strided(&self) -> StridedMatrix {
        StridedMatrix { first: self.values.as_ptr(), row_stride: self.row_stride as isize, column_stride: 1 }
    }

    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &'a [f32] {
        &self.values[row * self.row_stride..row * self.row_stride + self.columns]
    }
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
    let lengths = |output| {
        let length = |chunk: &Chunk| match output {
            OutputMatrix::Rows(columns) => chunk.rows.len() * columns,
            OutputMatrix::Sums(columns) => columns,
        };
        chunks.iter().map(length).collect()
    };
    let mut matrices = outputs.map(|output| (output, NewValues::new(lengths(output))));
    let mut parts = matrices.each_mut().map(|(_, values)| values.parts().into_iter());
    let mut next = || parts.each_mut().map(|parts| parts.next().expect("every chunk has a part"));
    let tasks = chunks.iter().map(|chunk| (chunk, next())).collect();
    for_each(tasks, |(chunk, parts)| {
        let parts = parts.map(NewPart::zeroed);
        vectorised(
            #[inline(always)]
            || kernel(chunk, parts),
        );
    });
    let matrix = |(output, values): (OutputMatrix, NewValues)| match output {
        OutputMatrix::Rows(columns) => B::matrix(values.finish(), columns),
        OutputMatrix::Sums(columns) => {
            let sums = sum_partials(&values.finish(), &chunks, columns, packing.count());
            B::matrix(sums, columns)
        }
    };
    matrices.map(matrix).into()
}

/// The part of `values` (rows of `columns` elements) that belongs to each chunk.
pub(super) fn split_mut<'a>(
    mut values: &'a mut [f32],
    chunks: &[Chunk],
    columns: usize,
) -> Vec<&'a mut [f32]> {
    let next = |chunk: &Chunk| {
        let (part, rest) = std::mem::take(&mut values).split_at_mut(chunk.rows.len() * columns);
        values = rest;
        part
    };
    chunks.iter().map(next).collect()
}

/// Elements of a new matrix. Its memory is not zeroed in one pass before the work: the task that computes a part zeroes
/// that part, in its own cache and in parallel with the others.
pub(super) struct NewValues {
    values: Vec<f32>,
    lengths: Vec<usize>,
    written: AtomicUsize,
}

/// A run of elements of [`NewValues`].
pub(super) struct NewPart<'a> {
    memory: &'a mut [MaybeUninit<f32>],
    written: &'a AtomicUsize,
}

impl NewValues {
    /// Consecutive parts of the given lengths.
    pub(super) fn new(lengths: Vec<usize>) -> Self {
        Self { values: Vec::with_capacity(lengths.iter().sum()), lengths, written: AtomicUsize::new(0) }
    }

    /// The parts, to be written once.
    pub(super) fn parts(&mut self) -> Vec<NewPart<'_>> {
        *self.written.get_mut() = 0;
        let written = &self.written;
        let mut memory = self.values.spare_capacity_mut();
        let next = |length: &usize| {
            let (part, rest) = std::mem::take(&mut memory).split_at_mut(*length);
            memory = rest;
            NewPart { memory: part, written }
        };
        self.lengths.iter().map(next).collect()
    }

    /// The elements, once every part has been written.
    pub(super) fn finish(mut self) -> Vec<f32> {
        let count = self.lengths.iter().sum();
        assert_eq!(*self.written.get_mut(), count, "every part of a matrix is written");
        // SAFETY: parts do not overlap and each counts its elements once, when they have been written: all have been.
        unsafe { self.values.set_len(count) };
        self.values
    }
}

impl<'a> NewPart<'a> {
    /// Memory to be written.
    ///
    /// # Safety
    /// The caller writes all of it.
    pub(super) unsafe fn unwritten(self) -> &'a mut [MaybeUninit<f32>] {
        self.written.fetch_add(self.memory.len(), Ordering::Relaxed);
        self.memory
    }

    #[inline(always)]
    pub(super) fn zeroed(self) -> &'a mut [f32] {
        self.memory.fill(MaybeUninit::new(0.0));
        self.written.fetch_add(self.memory.len(), Ordering::Relaxed);
        let length = self.memory.len();
        // SAFETY: the elements have just been written, and the borrow is the part's own.
        unsafe { std::slice::from_raw_parts_mut(self.memory.as_mut_ptr().cast::<f32>(), length) }
    }
}

/// Runs one task per chunk; a single one stays on this thread.
pub(super) fn for_each<T: Send>(tasks: Vec<T>, run: impl Fn(T) + Send + Sync) {
    if tasks.len() < 2 {
        tasks.into_iter().for_each(run);
    } else {
        tasks.into_par_iter().for_each(run);
    }
}

/// Compiles a kernel for every instruction set and runs the best one this CPU has.
///
/// The closure's body must be inlined into the caller: mark it and what it calls `#[inline(always)]`.
#[inline(always)]
pub(super) fn vectorised<R>(kernel: impl FnOnce() -> R) -> R {
    // Named instruction sets instead of `pulp::Arch::dispatch`, through which a kernel is not inlined and stays narrow.
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V4::try_new() {
        return simd.vectorize(kernel);
    } else if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(kernel);
    }
    kernel()
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
