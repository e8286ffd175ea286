//! Products without matrix units: every unit adds up 8×8 entries of its group's tile in registers.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

use super::factor::{PRODUCT_UNITS, TILE, Transposed};

/// Terms of the sum that a tile holds.
pub(super) const PLAIN_DEPTH: usize = 16;
/// Units of a line of a group.
const LINE_UNITS: usize = 16;
/// Units that read one factor; the others read the other one.
const READERS: usize = PRODUCT_UNITS / 2;
/// Entries that lie together in a tile.
const FOUR: usize = 4;
/// Vectors between the lines of a tile, so that they start in different banks of memory.
const PITCH: usize = (TILE + FOUR) / FOUR;

/// Four by four entries of a factor for this unit: `block[i]` are four rows (lhs) or columns (rhs) of term `i`.
///
/// `across` counts rows or columns of the result, `along` the terms. In memory either may be the fast one.
#[cube]
fn read_block<N: Size>(
    source: &[Vector<f32, N>],
    block: &mut Array<Vector<f32, Const<4>>>,
    unit: usize,
    across_start: usize,
    across_end: usize,
    along_start: usize,
    along_end: usize,
    #[comptime] along_is_fast: bool,
    pitch: usize,
) {
    let width = N::value();
    let per_line = comptime!(if along_is_fast { PLAIN_DEPTH / FOUR } else { TILE / FOUR });
    let slow = unit / per_line * FOUR;
    let fast = unit % per_line * FOUR;
    #[unroll]
    for i in 0..comptime!(FOUR) {
        let mut line = Vector::<f32, Const<4>>::new(0.0);
        let (outer, outer_end) = if comptime!(along_is_fast) {
            (across_start + slow + i, across_end)
        } else {
            (along_start + slow + i, along_end)
        };
        let (inner, inner_end) = if comptime!(along_is_fast) {
            (along_start + fast, along_end)
        } else {
            (across_start + fast, across_end)
        };
        if outer < outer_end {
            #[unroll]
            for part in 0..comptime!(FOUR / width) {
                if inner + part * width < inner_end {
                    let value = source[(outer * pitch + inner) / width + part];
                    #[unroll]
                    for lane in 0..width {
                        line.insert(comptime!(part * width + lane), value.extract(lane));
                    }
                }
            }
        }
        if comptime!(along_is_fast) {
            #[unroll]
            for lane in 0..comptime!(FOUR) {
                let mut turned = block[lane];
                turned.insert(i, line.extract(lane));
                block[lane] = turned;
            }
        } else {
            block[i] = line;
        }
    }
}

/// Where [`read_block`] read, in a tile `[PLAIN_DEPTH][TILE]`.
#[cube]
fn write_block(
    block: &Array<Vector<f32, Const<4>>>,
    tile: &mut Shared<[Vector<f32, Const<4>>]>,
    unit: usize,
    #[comptime] along_is_fast: bool,
) {
    let per_line = comptime!(if along_is_fast { PLAIN_DEPTH / FOUR } else { TILE / FOUR });
    let (slow, fast) = (unit / per_line, unit % per_line);
    let (along, across) = if comptime!(along_is_fast) { (fast * FOUR, slow) } else { (slow * FOUR, fast) };
    #[unroll]
    for i in 0..comptime!(FOUR) {
        tile[(along + i) * PITCH + across] = block[i];
    }
}

/// Writes the sums over every chunk of terms to a row of `output`.
#[cube(launch_unchecked)]
pub(super) fn multiply<N: Size>(
    lhs: &[Vector<f32, N>],
    rhs: &[Vector<f32, N>],
    output: &mut [f32],
    rows: usize,
    columns: usize,
    depth: usize,
    chunk: usize,
    #[comptime] transposed: Transposed,
) {
    let mut lhs_tile =
        Shared::<[Vector<f32, Const<4>>]>::new_aligned_slice(comptime!(PLAIN_DEPTH * PITCH), 16usize);
    let mut rhs_tile =
        Shared::<[Vector<f32, Const<4>>]>::new_aligned_slice(comptime!(PLAIN_DEPTH * PITCH), 16usize);
    let row_start = CUBE_POS_Y as usize * TILE;
    let column_start = CUBE_POS_X as usize * TILE;
    let start = CUBE_POS_Z as usize * chunk;
    let end = select(start + chunk < depth, start + chunk, depth);
    let unit = UNIT_POS as usize;
    let (unit_row, unit_column) = (unit / LINE_UNITS, unit % LINE_UNITS);

    // Sums [half of rows][row][half of columns], four columns each.
    let mut sums = Array::<Vector<f32, Const<4>>>::new(16usize);
    let mut block = Array::<Vector<f32, Const<4>>>::new(FOUR);
    #[unroll]
    for i in 0..16 {
        sums[i] = Vector::<f32, Const<4>>::new(0.0);
    }
    let mut at = start;
    read_factors::<N>(
        lhs,
        rhs,
        &mut block,
        row_start,
        rows,
        column_start,
        columns,
        depth,
        at,
        end,
        transposed,
    );
    while at < end {
        sync_cube();
        if unit < READERS {
            write_block(&block, &mut lhs_tile, unit, !transposed.lhs);
        } else {
            write_block(&block, &mut rhs_tile, unit - READERS, transposed.rhs);
        }
        sync_cube();
        at += PLAIN_DEPTH;
        // The next tile is on its way while this one is multiplied.
        if at < end {
            read_factors::<N>(
                lhs,
                rhs,
                &mut block,
                row_start,
                rows,
                column_start,
                columns,
                depth,
                at,
                end,
                transposed,
            );
        }
        #[unroll]
        for term in 0..comptime!(PLAIN_DEPTH) {
            #[unroll]
            for half in 0..2 {
                let left = lhs_tile[term * PITCH + half * LINE_UNITS + unit_row];
                #[unroll]
                for side in 0..2 {
                    let right = rhs_tile[term * PITCH + side * LINE_UNITS + unit_column];
                    #[unroll]
                    for i in 0..comptime!(FOUR) {
                        let factor = Vector::<f32, Const<4>>::new(left.extract(i));
                        let sum = comptime!((half * FOUR + i) * 2 + side);
                        sums[sum] = fma(factor, right, sums[sum]);
                    }
                }
            }
        }
    }

    let base = CUBE_POS_Z as usize * rows * columns;
    #[unroll]
    for half in 0..2 {
        #[unroll]
        for i in 0..comptime!(FOUR) {
            let row = row_start + (half * LINE_UNITS + unit_row) * FOUR + i;
            #[unroll]
            for side in 0..2 {
                let sum = sums[comptime!((half * FOUR + i) * 2 + side)];
                #[unroll]
                for lane in 0..comptime!(FOUR) {
                    let column = column_start + (side * LINE_UNITS + unit_column) * FOUR + lane;
                    if row < rows && column < columns {
                        output[base + row * columns + column] = sum.extract(lane);
                    }
                }
            }
        }
    }
}

#[cube]
fn read_factors<N: Size>(
    lhs: &[Vector<f32, N>],
    rhs: &[Vector<f32, N>],
    block: &mut Array<Vector<f32, Const<4>>>,
    row_start: usize,
    rows: usize,
    column_start: usize,
    columns: usize,
    depth: usize,
    at: usize,
    end: usize,
    #[comptime] transposed: Transposed,
) {
    let unit = UNIT_POS as usize;
    if unit < READERS {
        let pitch = if comptime!(transposed.lhs) { rows } else { depth };
        read_block::<N>(lhs, block, unit, row_start, rows, at, end, !transposed.lhs, pitch);
    } else {
        let pitch = if comptime!(transposed.rhs) { depth } else { columns };
        read_block::<N>(rhs, block, unit - READERS, column_start, columns, at, end, transposed.rhs, pitch);
    }
}
