//! Products on matrix units (tensor cores), which multiply in bf16 and add in f32.
//!
//! Each factor is split into a high and a low part of eight bits each, `x = h + l + O(2⁻¹⁷ x)`, and three products are added up,
//! `l·h' + h·l' + h·h'`: the relative error of a term is at most 2⁻¹⁵,
//! for factors between 10⁻³² and 3·10³⁸ in size. Infinities make NaN.

use burn_cubecl::cubecl;
use cubecl::client::Client;
use cubecl::cmma::{self, MatrixIdent, MatrixLayout};
use cubecl::features::MmaConfig;
use cubecl::ir::{ElemType, FloatKind};
use cubecl::prelude::*;
use half::bf16;

use super::factor::{PRODUCT_UNITS, TILE, Transposed, read_tile};

/// Terms of the sum that a tile holds.
pub(super) const CMMA_DEPTH: usize = 32;
/// Rows, columns and terms of what a matrix unit multiplies at once.
const FRAGMENT: usize = 16;
/// Units of a plane.
const PLANE: usize = 32;
/// Planes of a group, along rows and columns of its tile.
const PLANES: [usize; 2] = [2, 4];
const _: () = assert!(PLANES[0] * PLANES[1] * PLANE == PRODUCT_UNITS);
/// Fragments of the result that a plane computes, along rows and columns.
const FRAGMENTS: [usize; 2] = [TILE / PLANES[0] / FRAGMENT, TILE / PLANES[1] / FRAGMENT];
/// Entries between the lines of a tile, so that they start in different banks of memory.
const PADDING: usize = 8;

/// Bytes of shared memory: both factors' tiles in two parts, with the padding that is larger, and the bounce.
const SHARED: usize = 4 * 2 * TILE * (CMMA_DEPTH + PADDING) + 4 * PRODUCT_UNITS / PLANE * FRAGMENT * FRAGMENT;

/// Whether a device has units for this, and groups large enough.
pub(super) fn are_in(client: &Client) -> bool {
    let [bf16, f32] = [FloatKind::BF16, FloatKind::F32].map(ElemType::Float);
    let size = FRAGMENT as u32;
    let wanted = MmaConfig { a_type: bf16, b_type: bf16, cd_type: f32, m: size, n: size, k: size };
    let hardware = &client.properties().hardware;
    let planes = [hardware.plane_size_min, hardware.plane_size_max];
    let is_large =
        hardware.max_shared_memory_size >= SHARED && hardware.max_units_per_cube as usize >= PRODUCT_UNITS;
    is_large && planes == [PLANE as u32; 2] && client.features().matmul.cmma.contains(&wanted)
}

/// The lines of a tile in memory, and the entries of each.
const fn lines(across: usize, along: usize, transposed: bool) -> [usize; 2] {
    if transposed { [along, across] } else { [across, along] }
}

/// Splits this unit's share of a tile into high and low parts.
#[cube]
fn write_tile<N: Size>(
    registers: &Array<Vector<f32, N>>,
    high: &mut Shared<[Vector<bf16, N>]>,
    low: &mut Shared<[Vector<bf16, N>]>,
    #[comptime] inner: usize,
    #[comptime] count: usize,
) {
    let width = N::value();
    let per_line = comptime!(inner / width);
    let pitch = comptime!((inner + PADDING) / width);
    #[unroll]
    for i in 0..count {
        let position = UNIT_POS as usize + i * PRODUCT_UNITS;
        let at = position / per_line * pitch + position % per_line;
        let value = registers[i];
        let rounded = rounded_to_bf16::<N>(value);
        high[at] = Vector::<bf16, N>::cast_from(rounded);
        low[at] = Vector::<bf16, N>::cast_from(rounded_to_bf16::<N>(value - rounded));
    }
}

/// To the nearest: casts of the graphics APIs may cut digits off, which costs a bit of each part and makes errors add up.
#[cube]
fn rounded_to_bf16<N: Size>(value: Vector<f32, N>) -> Vector<f32, N> {
    let mut result = Vector::<f32, N>::empty();
    #[unroll]
    for lane in 0..N::value() {
        let bits = u32::reinterpret(value.extract(lane));
        let rounded = (bits + 0x8000) & 0xffff_0000;
        // The carry would make a zero of a NaN whose bits are all ones.
        let is_nan = (bits & 0x7fff_ffff) > 0x7f80_0000;
        result.insert(lane, f32::reinterpret(select(is_nan, 0x7fc0_0000u32, rounded)));
    }
    result
}

/// The fragment of a tile that starts at `row` and `column`.
#[cube]
fn fragment<N: Size>(
    tile: &Shared<[Vector<bf16, N>]>,
    row: usize,
    column: usize,
    #[comptime] ident: MatrixIdent,
    #[comptime] inner: usize,
    #[comptime] transposed: bool,
) -> cmma::Matrix<bf16> {
    let pitch = comptime!(inner + PADDING);
    let layout = comptime!(if transposed { MatrixLayout::ColMajor } else { MatrixLayout::RowMajor });
    // SAFETY: it is loaded before anything reads it.
    let mut result =
        unsafe { cmma::Matrix::<bf16>::uninitialized(ident, FRAGMENT, FRAGMENT, FRAGMENT, layout) };
    let start = if comptime!(transposed) { column * pitch + row } else { row * pitch + column };
    let end = tile.len();
    cmma::load(&mut result, &tile[start / N::value()..end], pitch as u32);
    result
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
    let width = N::value();
    let [lhs_outer, lhs_inner] = comptime!(lines(TILE, CMMA_DEPTH, transposed.lhs));
    let [rhs_outer, rhs_inner] = comptime!(lines(CMMA_DEPTH, TILE, transposed.rhs));
    let count = comptime!(TILE * CMMA_DEPTH / width / PRODUCT_UNITS);
    let lhs_size = comptime!(lhs_outer * (lhs_inner + PADDING) / width);
    let rhs_size = comptime!(rhs_outer * (rhs_inner + PADDING) / width);
    let mut lhs_high = Shared::<[Vector<bf16, N>]>::new_aligned_slice(lhs_size, 16usize);
    let mut lhs_low = Shared::<[Vector<bf16, N>]>::new_aligned_slice(lhs_size, 16usize);
    let mut rhs_high = Shared::<[Vector<bf16, N>]>::new_aligned_slice(rhs_size, 16usize);
    let mut rhs_low = Shared::<[Vector<bf16, N>]>::new_aligned_slice(rhs_size, 16usize);

    let row_start = CUBE_POS_Y as usize * TILE;
    let column_start = CUBE_POS_X as usize * TILE;
    let start = CUBE_POS_Z as usize * chunk;
    let end = select(start + chunk < depth, start + chunk, depth);
    let plane = UNIT_POS as usize / PLANE;
    let plane_row = plane / PLANES[1] * comptime!(FRAGMENTS[0] * FRAGMENT);
    let plane_column = plane % PLANES[1] * comptime!(FRAGMENTS[1] * FRAGMENT);

    let mut sums = Sequence::<cmma::Matrix<f32>>::new();
    #[unroll]
    for _ in 0..comptime!(FRAGMENTS[0] * FRAGMENTS[1]) {
        sums.push(cmma::Matrix::<f32>::from_value(
            MatrixIdent::Accumulator,
            FRAGMENT,
            FRAGMENT,
            FRAGMENT,
            MatrixLayout::Undefined,
            0.0,
        ));
    }

    let mut lhs_registers = Array::<Vector<f32, N>>::new(count);
    let mut rhs_registers = Array::<Vector<f32, N>>::new(count);
    let mut at = start;
    read_factors::<N>(
        lhs,
        rhs,
        &mut lhs_registers,
        &mut rhs_registers,
        row_start,
        rows,
        column_start,
        columns,
        depth,
        at,
        end,
        count,
        transposed,
    );
    while at < end {
        sync_cube();
        write_tile::<N>(&lhs_registers, &mut lhs_high, &mut lhs_low, lhs_inner, count);
        write_tile::<N>(&rhs_registers, &mut rhs_high, &mut rhs_low, rhs_inner, count);
        sync_cube();
        at += CMMA_DEPTH;
        // The next tile is on its way while this one is multiplied.
        if at < end {
            read_factors::<N>(
                lhs,
                rhs,
                &mut lhs_registers,
                &mut rhs_registers,
                row_start,
                rows,
                column_start,
                columns,
                depth,
                at,
                end,
                count,
                transposed,
            );
        }
        #[unroll]
        for step in 0..comptime!(CMMA_DEPTH / FRAGMENT) {
            let along = step * FRAGMENT;
            let mut highs = Sequence::<cmma::Matrix<bf16>>::new();
            let mut lows = Sequence::<cmma::Matrix<bf16>>::new();
            #[unroll]
            for j in 0..comptime!(FRAGMENTS[1]) {
                let column = plane_column + j * FRAGMENT;
                highs.push(fragment::<N>(
                    &rhs_high,
                    along,
                    column,
                    MatrixIdent::B,
                    rhs_inner,
                    transposed.rhs,
                ));
                lows.push(fragment::<N>(&rhs_low, along, column, MatrixIdent::B, rhs_inner, transposed.rhs));
            }
            #[unroll]
            for i in 0..comptime!(FRAGMENTS[0]) {
                let row = plane_row + i * FRAGMENT;
                let high = fragment::<N>(&lhs_high, row, along, MatrixIdent::A, lhs_inner, transposed.lhs);
                let low = fragment::<N>(&lhs_low, row, along, MatrixIdent::A, lhs_inner, transposed.lhs);
                #[unroll]
                for j in 0..comptime!(FRAGMENTS[1]) {
                    let sum = sums.index(comptime!(i * FRAGMENTS[1] + j));
                    cmma::execute(&low, highs.index(j), sum, sum);
                    cmma::execute(&high, lows.index(j), sum, sum);
                    cmma::execute(&high, highs.index(j), sum, sum);
                }
            }
        }
    }

    // Fragments that reach beyond the result, or whose lines are not aligned, go through memory of their plane.
    let mut bounce =
        Shared::<[f32]>::new_aligned_slice(comptime!(PRODUCT_UNITS / PLANE * FRAGMENT * FRAGMENT), 16usize);
    let mine = plane * comptime!(FRAGMENT * FRAGMENT);
    let base = CUBE_POS_Z as usize * rows * columns;
    let output_end = output.len();
    #[unroll]
    for i in 0..comptime!(FRAGMENTS[0]) {
        #[unroll]
        for j in 0..comptime!(FRAGMENTS[1]) {
            let sum = sums.index(comptime!(i * FRAGMENTS[1] + j));
            let row = row_start + plane_row + i * FRAGMENT;
            let column = column_start + plane_column + j * FRAGMENT;
            // 32 bytes, as CUDA asks for; the graphics APIs are content with 16.
            let aligned = columns % 8 == 0;
            if aligned && row + FRAGMENT <= rows && column + FRAGMENT <= columns {
                let place = base + row * columns + column;
                cmma::store(&mut output[place..output_end], sum, columns as u32, MatrixLayout::RowMajor);
            } else {
                cmma::store(
                    &mut bounce[mine..mine + comptime!(FRAGMENT * FRAGMENT)],
                    sum,
                    FRAGMENT as u32,
                    MatrixLayout::RowMajor,
                );
                sync_plane();
                #[unroll]
                for entry in 0..comptime!(FRAGMENT * FRAGMENT / PLANE) {
                    let position = entry * PLANE + UNIT_POS as usize % PLANE;
                    let (r, c) = (row + position / FRAGMENT, column + position % FRAGMENT);
                    if r < rows && c < columns {
                        output[base + r * columns + c] = bounce[mine + position];
                    }
                }
                sync_plane();
            }
        }
    }
}

#[cube]
fn read_factors<N: Size>(
    lhs: &[Vector<f32, N>],
    rhs: &[Vector<f32, N>],
    lhs_registers: &mut Array<Vector<f32, N>>,
    rhs_registers: &mut Array<Vector<f32, N>>,
    row_start: usize,
    rows: usize,
    column_start: usize,
    columns: usize,
    depth: usize,
    at: usize,
    end: usize,
    #[comptime] count: usize,
    #[comptime] transposed: Transposed,
) {
    let unit = UNIT_POS as usize;
    if comptime!(transposed.lhs) {
        read_tile::<N>(lhs, lhs_registers, unit, at, end, row_start, rows, rows, TILE, count, PRODUCT_UNITS);
    } else {
        read_tile::<N>(
            lhs,
            lhs_registers,
            unit,
            row_start,
            rows,
            at,
            end,
            depth,
            CMMA_DEPTH,
            count,
            PRODUCT_UNITS,
        );
    }
    if comptime!(transposed.rhs) {
        read_tile::<N>(
            rhs,
            rhs_registers,
            unit,
            column_start,
            columns,
            at,
            end,
            depth,
            CMMA_DEPTH,
            count,
            PRODUCT_UNITS,
        );
    } else {
        read_tile::<N>(
            rhs,
            rhs_registers,
            unit,
            at,
            end,
            column_start,
            columns,
            columns,
            TILE,
            count,
            PRODUCT_UNITS,
        );
    }
}

/// The device of tests is a GPU only where there is no backend in host memory.
#[cfg(all(test, not(any(feature = "flex", feature = "ndarray"))))]
mod tests;
