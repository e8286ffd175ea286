//! Border edges of a sheet, where they lie along their loops, and which of them run along each other.

use crate::mesh::clean::pieces;
use clothcombo_physics::vec3::{add_scaled, dot, norm, normalized, scale, sub};
use std::collections::HashMap;

/// Least cosine between the directions of two borders that run along each other.
const LEAST_ALONG: f64 = 0.7;
/// Cosine from which two sheets lie on each other instead of continuing each other: the legs of trousers that touch, a lining.
const FOLDED: f64 = 0.9;
/// Two points of one loop face each other only if the way along it is this many times the distance: a corner is no seam.
const DETOUR: f64 = 3.0;
/// A longer edge, in cells of the grid, is no part of a seam.
const LONGEST_SEAM_EDGE: f64 = 128.0;
/// More edges in one cell of the grid are a heap, not a seam: comparing all of them would not end.
const CROWDED_CELL: usize = 512;

/// An edge with one face, in the face's direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct BorderEdge {
    pub ends: [u32; 2],
    pub face: u32,
    pub length: f64,
    /// The edge after it along the loop.
    pub next: Option<u32>,
    loop_number: u32,
    /// Length along the loop up to the first end.
    start: f64,
    component: u32,
    direction: [f64; 3],
    /// From the edge into its face, in the plane of the face; unit length.
    inward: [f64; 3],
}

/// A point of the border that faces another one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facing {
    pub edge: u32,
    /// Share of the edge's length from its first end.
    pub share: f64,
    pub distance: f64,
}

/// All borders of a sheet.
pub(super) struct Borders<'a> {
    pub positions: &'a [[f64; 3]],
    pub edges: Vec<BorderEdge>,
    loop_lengths: Vec<f64>,
    /// Border edge that begins at a vertex.
    outgoing: HashMap<u32, u32>,
    cell: f64,
    grid: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Borders<'a> {
    /// For queries within `reach`.
    pub fn new(positions: &'a [[f64; 3]], faces: &[[u32; 3]], reach: f64) -> Self {
        let mut uses: HashMap<[u32; 2], u32> = HashMap::with_capacity(2 * faces.len());
        let sides = |face: &[u32; 3]| [[face[0], face[1]], [face[1], face[2]], [face[2], face[0]]];
        let key = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
        faces.iter().flat_map(sides).for_each(|side| *uses.entry(key(side)).or_default() += 1);
        let mut components = pieces(faces, positions.len());
        let mut edges = Vec::new();
        for (number, face) in faces.iter().enumerate() {
            for side in sides(face).into_iter().filter(|side| uses[&key(*side)] == 1) {
                let [a, b, c] = [side[0], side[1], face[0] ^ face[1] ^ face[2] ^ side[0] ^ side[1]]
                    .map(|v| positions[v as usize]);
                let (along, direction) = (sub(b, a), normalized(sub(b, a)));
                edges.push(BorderEdge {
                    ends: side,
                    face: number as u32,
                    length: norm(along),
                    next: None,
                    loop_number: u32::MAX,
                    start: 0.0,
                    component: components.root(face[0]),
                    direction,
                    inward: normalized(add_scaled(sub(c, a), -dot(sub(c, a), direction), direction)),
                });
            }
        }
        let outgoing: HashMap<u32, u32> = edges.iter().zip(0..).map(|(e, n)| (e.ends[0], n)).collect();
        let mut borders =
            Self { positions, cell: 0.0, edges, loop_lengths: Vec::new(), outgoing, grid: HashMap::new() };
        borders.chain();
        borders.cell = borders.median_length().max(reach);
        borders.fill();
        borders
    }

    /// Numbers the loops and measures along them.
    fn chain(&mut self) {
        for n in 0..self.edges.len() {
            self.edges[n].next = self.outgoing.get(&self.edges[n].ends[1]).copied();
        }
        for first in 0..self.edges.len() {
            let (number, mut length) = (self.loop_lengths.len() as u32, 0.0);
            let mut at = Some(first as u32);
            while let Some(edge) =
                at.map(|n| &mut self.edges[n as usize]).filter(|e| e.loop_number == u32::MAX)
            {
                (edge.loop_number, edge.start) = (number, length);
                length += edge.length;
                at = edge.next;
            }
            if length > 0.0 {
                self.loop_lengths.push(length);
            } else if self.edges[first].loop_number == number {
                // An edge without length: a loop of its own, that nothing faces.
                self.loop_lengths.push(0.0);
            }
        }
    }

    fn fill(&mut self) {
        if !(self.cell > 0.0 && self.cell.is_finite()) {
            return;
        }
        for (edge, number) in self.edges.iter().zip(0..) {
            let steps = (2.0 * edge.length / self.cell).ceil().max(1.0);
            if steps > LONGEST_SEAM_EDGE {
                continue;
            }
            let start = self.positions[edge.ends[0] as usize];
            for step in 0..=steps as u32 {
                let at = add_scaled(start, edge.length * f64::from(step) / steps, edge.direction);
                let list = self.grid.entry(at.map(|x| (x / self.cell).floor() as i64)).or_default();
                if list.last() != Some(&number) && list.len() < CROWDED_CELL {
                    list.push(number);
                }
            }
        }
    }

    /// Median length of the border's edges; 0 without any.
    pub fn median_length(&self) -> f64 {
        let mut lengths: Vec<f64> = self.edges.iter().map(|e| e.length).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.get(lengths.len() / 2).copied().unwrap_or(0.0)
    }

    /// A point of an edge.
    pub fn point(&self, edge: u32, share: f64) -> [f64; 3] {
        let edge = &self.edges[edge as usize];
        add_scaled(self.positions[edge.ends[0] as usize], share * edge.length, edge.direction)
    }

    /// Whether two vertices are not near each other only because one border passes both.
    pub fn are_apart(&self, a: u32, b: u32) -> bool {
        let place = |v: u32| self.outgoing.get(&v).map(|e| (*e, 0.0));
        let (Some(p), Some(q)) = (place(a), place(b)) else { return true };
        let distance = norm(sub(self.positions[a as usize], self.positions[b as usize]));
        self.is_detour(p, q, distance)
    }

    fn is_detour(&self, (e, s): (u32, f64), (f, t): (u32, f64), distance: f64) -> bool {
        let [a, b] = [e, f].map(|n| &self.edges[n as usize]);
        if a.loop_number != b.loop_number {
            return true;
        }
        let along = (a.start + s * a.length - b.start - t * b.length).abs();
        let around = self.loop_lengths[a.loop_number as usize] - along;
        along.min(around) >= DETOUR * distance && along.min(around) > 0.0
    }

    /// The nearest point within `reach` of another border, or another part of this one, that continues the sheet of `edge` at
    /// `share` of its length.
    pub fn facing(&self, edge: u32, share: f64, reach: f64) -> Option<Facing> {
        let (own, p) = (&self.edges[edge as usize], self.point(edge, share));
        let cell = p.map(|x| (x / self.cell).floor() as i64);
        let mut best: Option<Facing> = None;
        for step in 0..27 {
            let at = [step % 3, step / 3 % 3, step / 9];
            let at = std::array::from_fn(|a| cell[a].saturating_add(at[a] - 1));
            for number in self.grid.get(&at).into_iter().flatten().filter(|n| **n != edge) {
                let other = &self.edges[*number as usize];
                let from = sub(p, self.positions[other.ends[0] as usize]);
                let share_there = (dot(from, other.direction) / other.length).clamp(0.0, 1.0);
                let share_there = if share_there.is_finite() { share_there } else { 0.0 };
                let distance = norm(sub(p, self.point(*number, share_there)));
                if distance > reach || best.is_some_and(|b| b.distance <= distance) {
                    continue;
                }
                let cosine = dot(own.direction, other.direction);
                // Sheets of one piece agree on a side: where their borders run in one direction, joining them twists it.
                let is_along =
                    if own.component == other.component { -cosine } else { cosine.abs() } >= LEAST_ALONG;
                let continues = dot(own.inward, other.inward) < FOLDED;
                if is_along && continues && self.is_detour((edge, share), (*number, share_there), distance) {
                    best = Some(Facing { edge: *number, share: share_there, distance });
                }
            }
        }
        best
    }
}

/// The mean of some points; the origin for none.
pub(super) fn mean(points: &[[f64; 3]]) -> [f64; 3] {
    let sum = points.iter().fold([0.0; 3], |sum, p| add_scaled(sum, 1.0, *p));
    scale(sum, 1.0 / points.len().max(1) as f64)
}
