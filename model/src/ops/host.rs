//! Tensors in host memory as rows, and parallel loops over fixed chunks of them.

use std::mem::MaybeUninit;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::backend::tensor::{Device, FloatTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{DType, TensorData};
use rayon::prelude::*;

use super::segments::ranges;

/// Elements one task works on: about a second-level cache, so that small tensors stay on one thread.
pub(super) const CHUNK_ELEMENTS: usize = 1 << 14;

/// A backend whose tensors can be read in place.
pub(super) trait HostBackend: Backend {
    /// A tensor held in a layout with contiguous rows.
    type Held: Send + Sync;

    /// Holds a matrix for reading, copying only if its rows are not contiguous.
    fn hold(tensor: FloatTensor<Self>) -> Self::Held;

    /// The rows of a held matrix.
    fn rows(held: &Self::Held) -> Rows<'_>;

    /// All elements of a tensor of any shape in row-major order, which is made so if it is not. `None` if the elements are
    /// not f32 or the backend does not lend them.
    fn values(_tensor: &mut FloatTensor<Self>) -> Option<&[f32]> {
        None
    }

    /// The same for writing in place; memory that is shared is copied first.
    fn values_mut(_tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        None
    }

    /// The elements of a matrix whose memory is nobody else's and holds nothing else, for writing in place; `None` if it is
    /// not so, or they are not f32.
    fn own_values_mut(_tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
        None
    }

    /// A matrix from its elements.
    fn matrix(values: Vec<f32>, columns: usize, device: &Device<Self>) -> FloatTensor<Self> {
        let rows = values.len() / columns.max(1);
        Self::float_from_data(TensorData::new(values, [rows, columns]), device)
    }
}

/// Whether the kernels, which are written for f32, apply.
pub(super) fn all_f32<B: Backend>(tensors: &[&FloatTensor<B>]) -> bool {
    tensors.iter().all(|tensor| tensor.dtype() == DType::F32)
}

/// Read access to a matrix whose rows are contiguous.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a> {
    values: &'a [f32],
    stride: usize,
    columns: usize,
    count: usize,
}

impl<'a> Rows<'a> {
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &'a [f32] {
        &self.values[row * self.stride..row * self.stride + self.columns]
    }
}

/// A run of rows inside one segment.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub(super) segment: usize,
    pub(super) rows: Range<usize>,
}

/// Cuts segments into chunks whose size depends on the number of columns only.
pub(super) fn chunks(ends: &[usize], columns: usize) -> Vec<Chunk> {
    let step = (CHUNK_ELEMENTS / columns.max(1)).max(1);
    let mut chunks = Vec::new();
    for (segment, range) in ranges(ends).enumerate() {
        let mut start = range.start;
        while start < range.end {
            let end = (start + step).min(range.end);
            chunks.push(Chunk { segment, rows: start..end });
            start = end;
        }
    }
    chunks
}

/// The part of `values` (rows of `columns` elements) that belongs to each chunk.
pub(super) fn split_mut<'a>(
    mut values: &'a mut [f32],
    chunks: &[Chunk],
    columns: usize,
) -> Vec<&'a mut [f32]> {
    let mut parts = Vec::with_capacity(chunks.len());
    for chunk in chunks {
        let (part, rest) = values.split_at_mut(chunk.rows.len() * columns);
        parts.push(part);
        values = rest;
    }
    parts
}

/// Elements of the part of a matrix that belongs to each chunk.
pub(super) fn part_lengths(chunks: &[Chunk], columns: usize) -> impl Iterator<Item = usize> + '_ {
    chunks.iter().map(move |chunk| chunk.rows.len() * columns)
}

/// Elements of a new matrix. Its memory is not zeroed in one pass before the work: the task that computes a part zeroes
/// that part, in its own cache and beside the others.
pub(super) struct NewValues {
    values: Vec<f32>,
    count: usize,
    zeroed: AtomicUsize,
}

/// A run of elements of [`NewValues`].
pub(super) struct Part<'a> {
    memory: &'a mut [MaybeUninit<f32>],
    zeroed: &'a AtomicUsize,
}

impl NewValues {
    pub(super) fn new(count: usize) -> Self {
        Self { values: Vec::with_capacity(count), count, zeroed: AtomicUsize::new(0) }
    }

    /// Consecutive parts of the given lengths, which must make up all of it.
    pub(super) fn parts(&mut self, lengths: impl IntoIterator<Item = usize>) -> Vec<Part<'_>> {
        *self.zeroed.get_mut() = 0;
        let zeroed = &self.zeroed;
        let mut memory = &mut self.values.spare_capacity_mut()[..self.count];
        let next = |length| {
            let (part, rest) = std::mem::take(&mut memory).split_at_mut(length);
            memory = rest;
            Part { memory: part, zeroed }
        };
        lengths.into_iter().map(next).collect()
    }

    /// The elements, once every part has been written.
    pub(super) fn finish(mut self) -> Vec<f32> {
        assert_eq!(*self.zeroed.get_mut(), self.count, "every part of a matrix is written");
        // SAFETY: parts do not overlap and each counts its elements once, when they have been written: all have been.
        unsafe { self.values.set_len(self.count) };
        self.values
    }
}

impl<'a> Part<'a> {
    #[inline(always)]
    pub(super) fn zeroed(self) -> &'a mut [f32] {
        self.memory.fill(MaybeUninit::new(0.0));
        self.zeroed.fetch_add(self.memory.len(), Ordering::Relaxed);
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

/// Adds the rows of `partial` (one per chunk) into one row per segment, in chunk order, in f64.
pub(super) fn sum_partials(partial: &[f32], chunks: &[Chunk], columns: usize, segments: usize) -> Vec<f32> {
    let mut sums = vec![0.0_f64; segments * columns];
    for (chunk, row) in chunks.iter().zip(partial.chunks_exact(columns.max(1))) {
        let sum = &mut sums[chunk.segment * columns..(chunk.segment + 1) * columns];
        for (sum, value) in sum.iter_mut().zip(row) {
            *sum += f64::from(*value);
        }
    }
    sums.into_iter().map(|sum| sum as f32).collect()
}

#[cfg(feature = "flex")]
mod flex {
    use burn::backend::Flex;

    use super::*;

    /// Where the elements lie once the tensor has been made contiguous; `None` if they are not f32.
    fn contiguous(tensor: &mut FloatTensor<Flex>) -> Option<Range<usize>> {
        if tensor.dtype() != DType::F32 {
            return None;
        }
        if !tensor.layout().is_contiguous() {
            *tensor = tensor.to_contiguous();
        }
        let start = tensor.layout().start_offset();
        Some(start..start + tensor.layout().num_elements())
    }

    impl HostBackend for Flex {
        type Held = FloatTensor<Flex>;

        fn hold(tensor: FloatTensor<Self>) -> Self::Held {
            let strides = tensor.layout().strides();
            // A block of columns of a wider matrix is read in place.
            let contiguous_rows =
                strides.len() == 2 && (strides[1] == 1 || tensor.layout().shape()[1] == 1) && strides[0] >= 0;
            if contiguous_rows { tensor } else { tensor.to_contiguous() }
        }

        fn values(tensor: &mut FloatTensor<Self>) -> Option<&[f32]> {
            let range = contiguous(tensor)?;
            tensor.storage::<f32>().get(range)
        }

        fn values_mut(tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
            let range = contiguous(tensor)?;
            tensor.storage_mut::<f32>().get_mut(range)
        }

        fn own_values_mut(tensor: &mut FloatTensor<Self>) -> Option<&mut [f32]> {
            let layout = tensor.layout();
            let whole = tensor.dtype() == DType::F32 && layout.is_contiguous() && layout.start_offset() == 0;
            let count = layout.num_elements();
            (whole && tensor.is_unique())
                .then(|| tensor.storage_mut::<f32>())
                .filter(|values| values.len() == count)
        }

        fn rows(held: &Self::Held) -> Rows<'_> {
            let layout = held.layout();
            let [count, columns] = [layout.shape()[0], layout.shape()[1]];
            Rows {
                values: &held.storage::<f32>()[layout.start_offset()..],
                stride: layout.strides()[0] as usize,
                columns,
                count,
            }
        }
    }
}

// burn deprecates the backend but still ships it, and users ask for it.
#[cfg(feature = "ndarray")]
#[allow(deprecated)]
mod ndarray {
    use burn::backend::NdArray;
    use burn::backend::ops::FloatTensorOps;

    use super::*;

    /// Elements copied out of the array, with its shape.
    pub(in crate::ops) struct Copied {
        values: Vec<f32>,
        columns: usize,
    }

    impl HostBackend for NdArray {
        type Held = Copied;

        fn hold(tensor: FloatTensor<Self>) -> Self::Held {
            let columns = tensor.shape()[1];
            let data = burn::backend::read_sync(Self::float_into_data(tensor));
            // Reading host memory cannot fail, and the caller has checked the element type.
            let values = data.ok().and_then(|data| data.try_into_vec::<f32>().ok()).unwrap_or_default();
            Copied { values, columns }
        }

        fn rows(held: &Self::Held) -> Rows<'_> {
            let columns = held.columns;
            Rows { values: &held.values, stride: columns, columns, count: held.values.len() / columns.max(1) }
        }
    }
}
