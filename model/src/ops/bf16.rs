//! Products of bf16 numbers with f32 sums, on processors that multiply such pairs (AVX512-BF16): twice the rate of f32.
//!
//! Both factors are rounded to the nearest bf16, a relative error of at most 2⁻⁸; sums are f32, and subnormal numbers count as
//! zero. Terms go in pairs, two bf16 in the place of one f32. An element of the result is the sum of its pairs in their order,
//! whatever tile it lies in.

use std::arch::x86_64::{
    __m256bh, __m256i, __m512, __m512bh, __m512i, __mmask16, _mm512_add_ps, _mm512_cvtepu16_epi32,
    _mm512_cvtne2ps_pbh, _mm512_cvtneps_pbh, _mm512_dpbf16_ps, _mm512_loadu_ps, _mm512_loadu_si512,
    _mm512_mask_storeu_epi32, _mm512_mask_storeu_ps, _mm512_maskz_loadu_ps, _mm512_or_si512,
    _mm512_set1_epi32, _mm512_setzero_ps, _mm512_slli_epi32, _mm512_storeu_si512,
};
use std::mem::transmute;
use std::ops::Range;

use super::tile::{OutputBlock, StridedMatrix};

/// Sums in a vector.
const LANES: usize = 16;
/// Columns of a panel: two vectors.
const PANEL: usize = 2 * LANES;
/// Rows of a tile, whose sums fill the registers.
const ROWS: usize = 12;

/// Whether this processor has such products.
pub(super) fn is_available() -> bool {
    is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bf16")
}

/// The right factor of a product: panels of [`PANEL`] columns one after another, each of whose rows has a pair of terms of every
/// column.
#[derive(Default)]
pub(super) struct PairPanels {
    pairs: Vec<u32>,
    inner: usize,
    columns: usize,
}

impl PairPanels {
    /// Becomes a matrix of `[inner, columns]` elements, in the memory it has.
    ///
    /// # Safety
    /// `matrix` has that size, and the processor [such products](is_available).
    pub(super) unsafe fn fill(&mut self, matrix: StridedMatrix, inner: usize, columns: usize) {
        (self.inner, self.columns) = (inner, columns);
        let length = inner.div_ceil(2) * PANEL;
        self.pairs.clear();
        self.pairs.resize(length * columns.div_ceil(PANEL), 0);
        let place = |k: usize, start: usize| start / PANEL * length + k * PANEL + start % PANEL;
        // SAFETY: promised; there is room for all panels.
        unsafe { write_pairs(matrix, inner, columns, &mut self.pairs, place) };
    }

    /// `output = lhs·(rows `terms` of the right factor)`, plus what `output` holds if `add`.
    ///
    /// # Safety
    /// `lhs` has `[rows, terms.len()]` elements; `output` `[rows, columns]`, initialised if `add`, that nobody else uses; and the
    /// processor [has such products](is_available).
    pub(super) unsafe fn multiply(
        &self,
        lhs: StridedMatrix,
        rows: usize,
        terms: Range<usize>,
        output: OutputBlock,
        add: bool,
    ) {
        assert!(terms.end <= self.inner, "terms of a product beyond its right factor");
        let ends_a_pair = terms.end == self.inner || terms.end.is_multiple_of(2);
        assert!(
            terms.start.is_multiple_of(2) && ends_a_pair,
            "a product that begins or ends within a pair of terms"
        );
        let pairs = terms.len().div_ceil(2);
        let turned = lhs.column_stride != 1;
        assert!(!turned || lhs.row_stride == 1, "neither rows nor columns of a left factor are contiguous");
        let mut left = vec![0; rows * pairs];
        // SAFETY: promised.
        unsafe {
            match turned {
                true => write_pairs(lhs.transposed(), terms.len(), rows, &mut left, |k, row| k * rows + row),
                false => write_pairs_of_rows(lhs, rows, terms.len(), &mut left),
            }
        }
        for (panel, right) in self.pairs.chunks_exact(self.inner.div_ceil(2) * PANEL).enumerate() {
            let start = panel * PANEL;
            let right = &right[terms.start / 2 * PANEL..][..pairs * PANEL];
            let (output, columns) = (output.from(0, start), PANEL.min(self.columns - start));
            // SAFETY: promised.
            unsafe {
                match turned {
                    true => strip::<true>(&left, rows, right, output, columns, add),
                    false => strip::<false>(&left, rows, right, output, columns, add),
                }
            }
        }
    }
}

/// The elements of a vector that are among the first `count`.
#[inline(always)]
const fn first(count: usize) -> __mmask16 {
    if count < LANES { (1 << count) - 1 } else { __mmask16::MAX }
}

const _: () = assert!(first(0) == 0 && first(15) == 0x7fff && first(16) == 0xffff);

/// Two vectors rounded to the nearest bf16, ties to even, element beside element.
#[inline]
#[target_feature(enable = "avx512f,avx512bf16")]
fn paired(a: __m512, b: __m512) -> __m512i {
    // SAFETY: the registers hold the same bits, whatever they are called.
    let [a, b] = [a, b]
        .map(|x| _mm512_cvtepu16_epi32(unsafe { transmute::<__m256bh, __m256i>(_mm512_cvtneps_pbh(x)) }));
    _mm512_or_si512(a, _mm512_slli_epi32::<16>(b))
}

/// The pairs of terms of every column of `[terms, columns]` elements: the vector of pair `k` from column `start` on goes to
/// `place(k, start)`. The last term of an odd number has 0 beside it.
///
/// # Safety
/// `matrix` has that size, `to` room at every place, and the processor such numbers.
#[target_feature(enable = "avx512f,avx512bf16")]
unsafe fn write_pairs(
    matrix: StridedMatrix,
    terms: usize,
    columns: usize,
    to: &mut [u32],
    place: impl Fn(usize, usize) -> usize,
) {
    let to = to.as_mut_ptr();
    // SAFETY (all): elements of the matrix, and room for the pairs.
    let vector = |term: usize, start: usize| unsafe {
        let (from, left) = (matrix.from(term, start), columns - start);
        match (matrix.column_stride == 1, left >= LANES) {
            (true, true) => _mm512_loadu_ps(from.first),
            (true, false) => _mm512_maskz_loadu_ps(first(left), from.first),
            (false, _) => strided(from, left),
        }
    };
    for k in 0..terms.div_ceil(2) {
        // Along the rows, which lie in memory one after another.
        for start in (0..columns).step_by(LANES) {
            let second = if 2 * k + 1 < terms { vector(2 * k + 1, start) } else { _mm512_setzero_ps() };
            let pairs = paired(vector(2 * k, start), second);
            unsafe {
                let to = to.add(place(k, start));
                match columns - start >= LANES {
                    true => _mm512_storeu_si512(to.cast(), pairs),
                    false => _mm512_mask_storeu_epi32(to.cast(), first(columns - start), pairs),
                }
            }
        }
    }
}

/// At most a vector of elements that are not contiguous, then zeros.
///
/// # Safety
/// `from` has `count` columns.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn strided(from: StridedMatrix, count: usize) -> __m512 {
    let mut values = [0.0; LANES];
    for (column, value) in values.iter_mut().enumerate().take(count) {
        // SAFETY: promised.
        *value = unsafe { *from.from(0, column).first };
    }
    // SAFETY: a vector of elements.
    unsafe { _mm512_loadu_ps(values.as_ptr()) }
}

/// The pairs of terms of every row of `[rows, terms]` elements with contiguous rows, row after row.
///
/// # Safety
/// As [`write_pairs`].
#[target_feature(enable = "avx512f,avx512bf16")]
unsafe fn write_pairs_of_rows(matrix: StridedMatrix, rows: usize, terms: usize, to: &mut [u32]) {
    let pairs = terms.div_ceil(2);
    for (row, to) in to.chunks_exact_mut(pairs).enumerate().take(rows) {
        let from = matrix.from(row, 0).first;
        for start in (0..pairs).step_by(LANES) {
            let left = terms - 2 * start;
            // SAFETY: elements of the row and of its pairs.
            unsafe {
                let (from, to) = (from.add(2 * start), to.as_mut_ptr().add(start));
                if left >= 2 * LANES {
                    let both = _mm512_cvtne2ps_pbh(_mm512_loadu_ps(from.add(LANES)), _mm512_loadu_ps(from));
                    _mm512_storeu_si512(to.cast(), transmute::<__m512bh, __m512i>(both));
                } else {
                    let low = _mm512_maskz_loadu_ps(first(left), from);
                    let of_high = first(left.saturating_sub(LANES));
                    let high = _mm512_maskz_loadu_ps(of_high, from.wrapping_add(LANES));
                    let both = transmute::<__m512bh, __m512i>(_mm512_cvtne2ps_pbh(high, low));
                    _mm512_mask_storeu_epi32(to.cast(), first(pairs - start), both);
                }
            }
        }
    }
}

/// The product of pairs `[rows, K]`, or turned `[K, rows]`, with one panel `[K, PANEL]`, of whose columns as many as
/// `columns` are wanted, tile by tile.
///
/// # Safety
/// As [`PairPanels::multiply`].
#[target_feature(enable = "avx512f,avx512bf16")]
unsafe fn strip<const TURNED: bool>(
    left: &[u32],
    rows: usize,
    right: &[u32],
    output: OutputBlock,
    columns: usize,
    add: bool,
) {
    let mut row = 0;
    macro_rules! tiles {
        ($rows:expr) => {
            while rows - row >= $rows {
                let output = output.from(row, 0);
                // SAFETY: rows below `rows`.
                unsafe {
                    match columns <= LANES {
                        true => tile::<{ $rows }, 1, TURNED>(left, [row, rows], right, output, columns, add),
                        false => tile::<{ $rows }, 2, TURNED>(left, [row, rows], right, output, columns, add),
                    }
                }
                row += $rows;
            }
        };
    }
    tiles!(ROWS);
    tiles!(4);
    tiles!(1);
}

/// R rows, from `row` of `rows` on, times V vectors of a panel.
///
/// # Safety
/// As [`PairPanels::multiply`].
#[inline]
#[target_feature(enable = "avx512f,avx512bf16")]
unsafe fn tile<const R: usize, const V: usize, const TURNED: bool>(
    left: &[u32],
    [row, rows]: [usize; 2],
    right: &[u32],
    output: OutputBlock,
    columns: usize,
    add: bool,
) {
    let count = right.len() / PANEL;
    // Elements from row to row and from pair to pair.
    let [down, along] = if TURNED { [1, rows] } else { [count, 1] };
    debug_assert!(count == 0 || (row + R - 1) * down + (count - 1) * along < left.len());
    let mut sums = [[_mm512_setzero_ps(); V]; R];
    for k in 0..count {
        // SAFETY (all): pairs of both factors; the registers hold the same bits, whatever they are called.
        let panel: [__m512bh; V] = std::array::from_fn(|v| unsafe {
            transmute(_mm512_loadu_si512(right.as_ptr().add(k * PANEL + v * LANES).cast()))
        });
        for r in 0..R {
            let of_row: __m512bh = unsafe {
                let at = left.as_ptr().add((row + r) * down + k * along);
                transmute(_mm512_set1_epi32(at.read().cast_signed()))
            };
            for v in 0..V {
                sums[r][v] = _mm512_dpbf16_ps(sums[r][v], of_row, panel[v]);
            }
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        for (v, sum) in sums.iter().enumerate() {
            let wanted = first(columns - v * LANES);
            // SAFETY: the wanted elements of a row of the output, initialised if they are read.
            unsafe {
                let to = output.from(r, v * LANES).first;
                let sum = if add { _mm512_add_ps(_mm512_maskz_loadu_ps(wanted, to), *sum) } else { *sum };
                _mm512_mask_storeu_ps(to, wanted, sum);
            }
        }
    }
}
