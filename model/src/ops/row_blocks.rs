//! Several layers in one pass: a block of rows goes through all of them before the next one does, so that what the layers hand
//! on stays in a core's caches.

use std::ops::Range;

use rayon::prelude::*;

use super::host::Chunk;
use crate::packing::Packing;

/// Rows of a block at most. Fewer would read the weights and add to their gradients, which often lie in the third-level cache
/// only, too often; more would not fit the second level.
const ROWS_PER_BLOCK: usize = 192;
/// Blocks have a multiple of so many rows: whole tiles of every instruction set.
const BLOCK_ROW_STEP: usize = 12;
/// Blocks per part of a sum at least: a part takes as much memory as the sum.
const BLOCKS_PER_PART: usize = 4;
/// Parts at most; a power of two, so that as many threads have equal shares.
const MAX_PARTS: usize = 8;

/// Runs of rows of one garment each, of about the same length.
pub(super) fn row_blocks(packing: &Packing) -> Vec<Chunk> {
    let of_garment = |(garment, rows): (usize, Range<usize>)| {
        let (count, end) = (rows.len().div_ceil(ROWS_PER_BLOCK).max(1), rows.end);
        let step = rows.len().div_ceil(count).next_multiple_of(BLOCK_ROW_STEP).max(BLOCK_ROW_STEP);
        rows.step_by(step).map(move |start| Chunk { garment, rows: start..(start + step).min(end) })
    };
    packing.ranges().enumerate().flat_map(of_garment).collect()
}

/// Sums over blocks, K vectors of the given lengths, to which `add` adds what one block contributes; S is memory that a task
/// uses again for each of its blocks.
///
/// Parts of all blocks, cut by their number alone, each add theirs in order, and the parts are then added in order: no bit
/// depends on the number of threads.
pub(super) fn sum_over_blocks<T: Send, S: Default, const K: usize>(
    mut blocks: Vec<T>,
    lengths: [usize; K],
    add: impl Fn(T, &mut [Vec<f32>; K], &mut S) + Sync,
) -> [Vec<f32>; K] {
    let count = blocks.len();
    let parts = 1 << (count / BLOCKS_PER_PART).clamp(1, MAX_PARTS).ilog2();
    let mut tasks: Vec<Vec<T>> =
        (0..parts).rev().map(|part| blocks.split_off(part * count / parts)).collect();
    tasks.reverse();
    let sum_part = |blocks: Vec<T>| {
        let mut sums = lengths.map(|length| vec![0.0; length]);
        let mut scratch = S::default();
        blocks.into_iter().for_each(|block| add(block, &mut sums, &mut scratch));
        sums
    };
    let sums: Vec<[Vec<f32>; K]> = match parts {
        1 => tasks.into_iter().map(sum_part).collect(),
        _ => tasks.into_par_iter().map(sum_part).collect(),
    };
    let join = |mut sums: [Vec<f32>; K], others: [Vec<f32>; K]| {
        sums.iter_mut().zip(&others).for_each(|(sums, others)| add_to(sums, others));
        sums
    };
    sums.into_iter().reduce(join).expect("at least one part")
}

/// Adds element by element.
pub(super) fn add_to(sums: &mut [f32], others: &[f32]) {
    for (sum, other) in sums.iter_mut().zip(others) {
        *sum += other;
    }
}

/// `outputs[i] = function(inputs[i], outputs[i])` for every i.
///
/// A vector of every matrix is read before one is written: the compiler cannot tell that so many slices do not overlap, and
/// would leave a plain loop scalar. Mark the function `#[inline(always)]`.
#[inline(always)]
pub(super) fn map_lanes<const I: usize, const O: usize>(
    inputs: [&[f32]; I],
    mut outputs: [&mut [f32]; O],
    function: impl Fn([f32; I], [f32; O]) -> [f32; O],
) {
    const MAP_LANES: usize = 16;
    let count = outputs[0].len();
    let whole = count / MAP_LANES * MAP_LANES;
    for at in (0..whole).step_by(MAP_LANES) {
        map_array::<I, O, MAP_LANES>(&inputs, &mut outputs, at, &function);
    }
    for at in whole..count {
        map_array::<I, O, 1>(&inputs, &mut outputs, at, &function);
    }
}

/// [`map_lanes`] for the N elements from `at` on.
#[inline(always)]
fn map_array<const I: usize, const O: usize, const N: usize>(
    inputs: &[&[f32]; I],
    outputs: &mut [&mut [f32]; O],
    at: usize,
    function: impl Fn([f32; I], [f32; O]) -> [f32; O],
) {
    let (mut read, mut written) = ([[0.0_f32; N]; I], [[0.0_f32; N]; O]);
    for i in 0..I {
        read[i].copy_from_slice(&inputs[i][at..at + N]);
    }
    for o in 0..O {
        written[o].copy_from_slice(&outputs[o][at..at + N]);
    }
    for lane in 0..N {
        let (mut x, mut y) = ([0.0; I], [0.0; O]);
        for i in 0..I {
            x[i] = read[i][lane];
        }
        for o in 0..O {
            y[o] = written[o][lane];
        }
        let y = function(x, y);
        for o in 0..O {
            written[o][lane] = y[o];
        }
    }
    for o in 0..O {
        outputs[o][at..at + N].copy_from_slice(&written[o]);
    }
}
