//! The smooth step that meets contacts: of all displacements, one that changes little from vertex to vertex.

use super::RestGarment;
use super::contact::Contact;
use crate::vec3::{add, add_scaled, norm, scale, sub};

/// How much of a neighbourhood's mean displacement a vertex takes over: below 1, so that a push fades with distance (to a
/// third over about four edges) instead of dragging everything along.
const FOLLOW: f64 = 0.98;
/// Over-relaxation of the smoothing.
const OVER: f64 = 1.4;
/// Share of an edge's change of length that one pass takes back.
const LENGTH_STIFFNESS: f64 = 0.5;
/// Passes over the contacts alone at the end.
const LAST_PASSES: usize = 8;

/// Cloth as a graph: one garment, or several side by side.
pub(super) trait Cloth {
    /// Number of vertices.
    fn vertices(&self) -> usize;
    /// Vertices that share an edge with `v`, ascending.
    fn ring(&self, v: u32) -> impl ExactSizeIterator<Item = u32>;
}

impl Cloth for RestGarment {
    fn vertices(&self) -> usize {
        self.vertex_count()
    }

    fn ring(&self, v: u32) -> impl ExactSizeIterator<Item = u32> {
        self.topology.ring(v as usize).iter().copied()
    }
}

/// Vertices within `rings` edges of `seeds`, ascending.
pub(super) fn neighbourhood(cloth: &impl Cloth, seeds: &[u32], rings: usize) -> Vec<u32> {
    let mut is_in = vec![false; cloth.vertices()];
    let mut all: Vec<u32> = Vec::new();
    let mut front: Vec<u32> = Vec::new();
    for &v in seeds {
        if !std::mem::replace(&mut is_in[v as usize], true) {
            front.push(v);
        }
    }
    for _ in 0..rings {
        let mut next = Vec::new();
        for &v in &front {
            for n in cloth.ring(v) {
                if !std::mem::replace(&mut is_in[n as usize], true) {
                    next.push(n);
                }
            }
        }
        all.append(&mut front);
        front = next;
    }
    all.append(&mut front);
    all.sort_unstable();
    all
}

/// Moves the vertices of `region` until `contacts` are met, by a displacement that is smooth over the garment, keeps the edge
/// lengths of `input`, and is zero at the region's rim. Gauss–Seidel in a fixed order: smoothing, lengths, contacts.
pub(super) fn relax(
    cloth: &impl Cloth,
    positions: &mut [[f64; 3]],
    input: &[[f64; 3]],
    region: &[u32],
    contacts: &[Contact],
    sweeps: usize,
) {
    let start = positions.to_vec();
    let mut may_move = vec![false; positions.len()];
    region.iter().for_each(|&v| may_move[v as usize] = true);
    let edges: Vec<(usize, usize, f64)> = region
        .iter()
        .flat_map(|&v| {
            let may_move = &may_move;
            cloth.ring(v).filter_map(move |n| {
                let is_mine = n > v || !may_move[n as usize];
                is_mine.then(|| (v as usize, n as usize, norm(sub(input[v as usize], input[n as usize]))))
            })
        })
        .collect();
    for _ in 0..sweeps {
        for &v in region {
            let ring = cloth.ring(v);
            let share = FOLLOW / ring.len().max(1) as f64;
            let v = v as usize;
            let sum = ring.fold([0.0; 3], |sum, n| add(sum, sub(positions[n as usize], start[n as usize])));
            let wanted = add_scaled(start[v], share, sum);
            positions[v] = add_scaled(positions[v], OVER, sub(wanted, positions[v]));
        }
        for &(a, b, length) in &edges {
            keep_length(positions, a, b, may_move[b], length);
        }
        for contact in contacts {
            contact.enforce(positions, &may_move);
        }
    }
    for _ in 0..LAST_PASSES {
        let mut is_violated = false;
        for contact in contacts {
            is_violated |= contact.enforce(positions, &may_move);
        }
        if !is_violated {
            break;
        }
    }
}

/// Takes back part of the change of an edge's length; `b` may be fixed.
#[inline]
fn keep_length(positions: &mut [[f64; 3]], a: usize, b: usize, b_may_move: bool, length: f64) {
    let along = sub(positions[b], positions[a]);
    let now = norm(along);
    if now < 1e-12 {
        return;
    }
    let step = scale(along, LENGTH_STIFFNESS * (now - length) / now);
    if b_may_move {
        positions[a] = add_scaled(positions[a], 0.5, step);
        positions[b] = add_scaled(positions[b], -0.5, step);
    } else {
        positions[a] = add(positions[a], step);
    }
}
