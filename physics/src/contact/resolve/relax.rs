//! The smooth step that meets contacts: of all displacements, one that changes little from vertex to vertex.

use super::condition::Condition;
use super::packed_cloth::PackedCloth;
use crate::vec3::{add, add_scaled, norm, scale, sub};

/// How much of a neighbourhood's mean displacement a vertex takes over: below 1, so that a push fades with distance (to a
/// third over about four edges) instead of dragging everything along.
const FOLLOW: f64 = 0.98;
/// Over-relaxation of the smoothing.
const OVER: f64 = 1.4;
/// Share of an edge's change of length that one pass takes back.
const LENGTH_STIFFNESS: f64 = 0.5;
/// An edge gets no shorter than this share of its length.
const SHORTEST: f64 = 0.6;

/// Passes over the contacts alone at the end.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastPasses {
    /// Most of them.
    most: usize,
    /// After as many the lengths of edges are limited again.
    limited: usize,
    /// As many at the very end leave lengths as they are.
    free: usize,
}

impl LastPasses {
    /// Few: what is left is met in the next round.
    pub const FEW: Self = Self { most: 8, limited: 1, free: 0 };
    /// Until contacts are met: a push goes through a stack of sheets one sheet at a time.
    pub const ALL: Self = Self { most: 400, limited: 10, free: 20 };
}

/// Moves the vertices of `region` until `contacts` are met, by a displacement from `shape` that is smooth over the garment,
/// keeps its edge lengths, and is left as it is outside. Gauss–Seidel in a fixed order: smoothing, lengths, contacts; in the end
/// as many passes over the contacts alone as `last` allows.
pub(super) fn relax(
    cloth: &PackedCloth<'_>,
    positions: &mut [[f64; 3]],
    shape: &[[f64; 3]],
    region: &[u32],
    contacts: &[Condition],
    stretch: f64,
    (sweeps, last): (usize, LastPasses),
) {
    let mut may_move = vec![false; positions.len()];
    region.iter().for_each(|&v| may_move[v as usize] = true);
    let edges: Vec<(usize, usize, f64)> = region
        .iter()
        .flat_map(|&v| {
            let may_move = &may_move;
            cloth.ring(v).filter_map(move |n| {
                let is_mine = n > v || !may_move[n as usize];
                is_mine.then(|| (v as usize, n as usize, norm(sub(shape[v as usize], shape[n as usize]))))
            })
        })
        .collect();
    for _ in 0..sweeps {
        for &v in region {
            let ring = cloth.ring(v);
            let share = FOLLOW / ring.len().max(1) as f64;
            let v = v as usize;
            let sum = ring.fold([0.0; 3], |sum, n| add(sum, sub(positions[n as usize], shape[n as usize])));
            let wanted = add_scaled(shape[v], share, sum);
            positions[v] = add_scaled(positions[v], OVER, sub(wanted, positions[v]));
        }
        for &(a, b, length) in &edges {
            keep_length(positions, a, b, may_move[b], length);
        }
        for contact in contacts {
            contact.enforce(positions, &may_move);
        }
        for &(a, b, length) in &edges {
            limit_length(positions, (a, b), may_move[b], length, stretch);
        }
    }
    for pass in 1..=last.most {
        let mut is_violated = false;
        for contact in contacts {
            is_violated |= contact.enforce(positions, &may_move);
        }
        if !is_violated {
            break;
        }
        if pass % last.limited != 0 || pass + last.free > last.most {
            continue;
        }
        for &(a, b, length) in &edges {
            limit_length(positions, (a, b), may_move[b], length, stretch);
        }
    }
}

/// Takes back what an edge is longer or shorter than it may get; `b` may be fixed.
#[inline]
fn limit_length(
    positions: &mut [[f64; 3]],
    (a, b): (usize, usize),
    b_may_move: bool,
    length: f64,
    stretch: f64,
) {
    let along = sub(positions[b], positions[a]);
    let now = norm(along);
    let allowed = now.clamp(SHORTEST * length, stretch * length);
    if now == allowed || now < 1e-12 {
        return;
    }
    move_ends(positions, (a, b), b_may_move, scale(along, (now - allowed) / now));
}

/// Moves the ends of an edge towards each other by `step`; `b` may be fixed.
#[inline]
fn move_ends(positions: &mut [[f64; 3]], (a, b): (usize, usize), b_may_move: bool, step: [f64; 3]) {
    if b_may_move {
        positions[a] = add_scaled(positions[a], 0.5, step);
        positions[b] = add_scaled(positions[b], -0.5, step);
    } else {
        positions[a] = add(positions[a], step);
    }
}

/// `to`, or what is as far as allowed on the way there from `from`.
pub(super) fn no_farther(from: [f64; 3], to: [f64; 3], farthest: f64) -> [f64; 3] {
    let moved = sub(to, from);
    let length = norm(moved);
    if length > farthest { add_scaled(from, farthest / length, moved) } else { to }
}

/// Takes back part of the change of an edge's length; `b` may be fixed.
#[inline]
pub(super) fn keep_length(positions: &mut [[f64; 3]], a: usize, b: usize, b_may_move: bool, length: f64) {
    let along = sub(positions[b], positions[a]);
    let now = norm(along);
    if now < 1e-12 {
        return;
    }
    move_ends(positions, (a, b), b_may_move, scale(along, LENGTH_STIFFNESS * (now - length) / now));
}
