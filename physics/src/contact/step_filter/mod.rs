//! Moves that make no intersection: every step of cloth or body passes a filter that shortens what would.
//!
//! A pair of elements (a vertex and a face, two edges) may move as long as a moving plane keeps it apart throughout
//! ([`separation`]). Triangles begin to intersect only where such a pair meets, so that what is apart at the start stays apart at
//! every time of the step. What is refused is drawn back, in the end to no motion: rest is always safe, so that the filter ends.
//!
//! Triangles that intersect already would otherwise be held for ever: their elements may pass each other, as long as no other
//! triangles intersect at the end of the step.
//!
//! Compare the moving planes of Offset Geometric Contact (Chen, Hsu, Liu, Macklin, Yang and Yuksel, SIGGRAPH 2025),
//! which bound each vertex for itself.

mod box_tree;
mod contact_mesh;
mod separation;
#[cfg(test)]
mod tests;

pub(crate) use box_tree::Bounds;
use box_tree::BoxTree;
pub(crate) use contact_mesh::{ContactMesh, ElementKey, ElementPair, element_keys};
pub(crate) use separation::closest_on_edges;

use crate::query::triangle_pair::{has_area, mesh_triangles_intersect};
use crate::vec3::{add, add_scaled, sub};
use rayon::prelude::*;
use separation::{Corners, NEAREST, TrianglePair, stay_apart, triangles_stay_apart};

/// Halvings of a refused motion before it ends.
const HALVINGS: u8 = 3;
/// Candidates looked at in one piece by a thread.
const CHUNK: usize = 256;

/// Pairs of faces.
pub(crate) type FacePairs = Vec<(u32, u32)>;

/// A mesh in motion, and which of its triangles intersect.
pub(crate) struct StepFilter<'a> {
    pub mesh: &'a ContactMesh,
    /// Boxes of faces hold them where they are, and where the last step that moved them came from.
    cloth: BoxTree,
    body: BoxTree,
    /// Triangles that intersect, the smaller number first, ascending.
    pub intersections: FacePairs,
}

impl<'a> StepFilter<'a> {
    /// Of `mesh` at `positions`.
    pub fn new(mesh: &'a ContactMesh, positions: &[[f64; 3]]) -> Self {
        let centre = |f: usize| {
            let [a, b, c] = mesh.faces[f].map(|v| positions[v as usize]);
            (add(add(a, b), c), f as u32)
        };
        let cloth = BoxTree::new((0..mesh.cloth_faces).map(centre).collect());
        let body = BoxTree::new((mesh.cloth_faces..mesh.faces.len()).map(centre).collect());
        let mut filter = Self { mesh, cloth, body, intersections: Vec::new() };
        let all = vec![true; mesh.faces.len()];
        filter.fit(&[positions], &all);
        let candidates = filter.candidates(&|_| true, 0.0);
        filter.intersections = filter.intersecting(&candidates, positions);
        filter
    }

    /// Takes the step from `from` to `to` without a look on the way.
    pub fn step_freely(&mut self, from: &[[f64; 3]], to: &[[f64; 3]]) {
        let is_moved = self.moved_faces(from, to);
        self.fit(&[to], &is_moved);
        let candidates = self.candidates(&|f| is_moved[f as usize], 0.0);
        let found = self.intersecting(&candidates, to);
        self.intersections.retain(|&(f, g)| !is_moved[f as usize] && !is_moved[g as usize]);
        self.intersections.extend(found);
        self.intersections.sort_unstable();
        self.intersections.dedup();
    }

    /// Shortens the step from `from` to `to` until it makes no intersection. Elements stay `margin` apart (m), or half as far as
    /// they are where that is less; a step ends no nearer than a micrometre, and no nearer than it starts where that is less.
    pub fn step(&mut self, from: &[[f64; 3]], to: &mut [[f64; 3]], margin: f64) {
        let wanted = to.to_vec();
        let is_moved = self.moved_faces(from, to);
        self.fit(&[from, &wanted], &is_moved);
        let candidates = self.candidates(&|f| is_moved[f as usize], margin);
        let exempt = self.exempt(&is_moved);
        let flat = self.flat(&candidates, from, &is_moved);
        let mut passing: Vec<ElementPair> = Vec::new();
        let mut drawn = vec![0_u8; to.len()];
        let mut is_asked = vec![true; to.len()];
        loop {
            let refused = self.refused(&candidates, from, to, &is_asked, margin);
            let (free, refused): (Vec<_>, Vec<_>) =
                refused.into_iter().partition(|pair| exempt.binary_search(&pair.key()).is_ok());
            passing.extend(free);
            let mut back: Vec<u32> = refused.iter().flat_map(|pair| pair.vertices).collect();
            if back.is_empty() {
                let made = self.made_by(&passing, &flat, to);
                back = made
                    .iter()
                    .flat_map(|&(f, g)| [f, g])
                    .flat_map(|f| self.mesh.faces[f as usize])
                    .collect();
            }
            if back.is_empty() {
                break;
            }
            back.sort_unstable();
            back.dedup();
            is_asked.fill(false);
            for v in back.into_iter().map(|v| v as usize) {
                drawn[v] = drawn[v].saturating_add(1);
                to[v] = drawn_back(from[v], wanted[v], drawn[v]);
                is_asked[v] = true;
            }
        }
        let still = self.intersecting(&self.intersections, to);
        self.intersections = still;
    }

    /// Which faces have a corner that moves.
    fn moved_faces(&self, from: &[[f64; 3]], to: &[[f64; 3]]) -> Vec<bool> {
        let moves = |face: &[u32; 3]| face.iter().any(|&v| from[v as usize] != to[v as usize]);
        self.mesh.faces.iter().map(moves).collect()
    }

    /// Makes the boxes of faces that moved anew, around all `states`.
    fn fit(&mut self, states: &[&[[f64; 3]]], is_moved: &[bool]) {
        let bounds = |f: u32| {
            let face = self.mesh.faces[f as usize];
            Bounds::around(states.iter().flat_map(|state| face.map(|v| state[v as usize])))
        };
        let is_moved = |f: u32| is_moved[f as usize];
        self.cloth.fit(bounds, is_moved);
        if self.moves_body(&is_moved) {
            self.body.fit(bounds, is_moved);
        }
    }

    fn moves_body(&self, is_moved: &impl Fn(u32) -> bool) -> bool {
        (self.mesh.cloth_faces..self.mesh.faces.len()).any(|f| is_moved(f as u32))
    }

    /// Pairs of faces, one of which `is_asked` for, whose boxes are no farther apart than `reach` (m) along any axis.
    pub fn candidates(&self, is_asked: &(impl Fn(u32) -> bool + Sync), reach: f64) -> FacePairs {
        let mut pairs = self.cloth.pairs(reach, is_asked);
        pairs.extend(match self.moves_body(is_asked) {
            true => self.cloth.pairs_with(&self.body, reach, |_| true),
            false => self.cloth.pairs_with(&self.body, reach, is_asked),
        });
        pairs
    }

    /// Calls `found` for every face of the cloth whose box meets `bounds`.
    pub fn cloth_faces_meeting(&self, bounds: &Bounds, found: impl FnMut(u32)) {
        self.cloth.faces_meeting(bounds, &mut Vec::new(), found);
    }

    /// Those of `pairs` that intersect, ascending. Exact.
    fn intersecting(&self, pairs: &[(u32, u32)], positions: &[[f64; 3]]) -> FacePairs {
        let faces = &self.mesh.faces;
        let intersect =
            |&(f, g): &(u32, u32)| mesh_triangles_intersect(positions, faces[f as usize], faces[g as usize]);
        let mut found: FacePairs = pairs.par_iter().with_min_len(CHUNK).copied().filter(intersect).collect();
        found.sort_unstable();
        found
    }

    /// Elements of triangles that intersect, and may come apart.
    fn exempt(&self, is_moved: &[bool]) -> Vec<ElementKey> {
        let moves = |(f, g): &&(u32, u32)| is_moved[*f as usize] || is_moved[*g as usize];
        let faces = &self.mesh.faces;
        let keys = |&(f, g): &(u32, u32)| element_keys(faces[f as usize], faces[g as usize]);
        let mut exempt: Vec<ElementKey> = self.intersections.iter().filter(moves).flat_map(keys).collect();
        exempt.sort_unstable();
        exempt.dedup();
        exempt
    }

    /// Pairs of elements of `candidates` that do not stay apart; only those with a vertex that `is_asked` about.
    fn refused(
        &self,
        candidates: &[(u32, u32)],
        from: &[[f64; 3]],
        to: &[[f64; 3]],
        is_asked: &[bool],
        margin: f64,
    ) -> Vec<ElementPair> {
        let faces = &self.mesh.faces;
        let of_chunk = |chunk: &[(u32, u32)]| {
            let mut refused = Vec::new();
            for &(f, g) in chunk {
                let pair = [faces[f as usize], faces[g as usize]];
                if !pair.as_flattened().iter().any(|&v| is_asked[v as usize]) {
                    continue;
                }
                let (start, end) = (corners_of_faces(from, pair), corners_of_faces(to, pair));
                if triangles_stay_apart(&start, &end, margin.max(NEAREST)) {
                    continue;
                }
                self.mesh.element_pairs(f, g, |pair| {
                    let (x, y) = (corners_of(from, &pair), corners_of(to, &pair));
                    if !stay_apart(&pair, &x, &y, margin) {
                        refused.push(pair);
                    }
                });
            }
            refused
        };
        candidates.par_chunks(CHUNK).flat_map_iter(of_chunk).collect()
    }

    /// Those of `pairs` with a triangle that moves and has no area at `positions`: it intersects nothing there, but
    /// what lies across it does as soon as it has some, and no elements meet.
    fn flat(&self, pairs: &[(u32, u32)], positions: &[[f64; 3]], is_moved: &[bool]) -> FacePairs {
        let is_flat = |(face, is_moved): (&[u32; 3], &bool)| {
            *is_moved && !has_area(&face.map(|v| positions[v as usize]))
        };
        let is_flat: Vec<bool> = self.mesh.faces.par_iter().zip(is_moved).map(is_flat).collect();
        pairs.iter().copied().filter(|(f, g)| is_flat[*f as usize] || is_flat[*g as usize]).collect()
    }

    /// Triangles around elements that passed each other, and those of `flat`, which intersect at `positions` and did not before.
    fn made_by(&self, passing: &[ElementPair], flat: &[(u32, u32)], positions: &[[f64; 3]]) -> FacePairs {
        let mut pairs: FacePairs = flat.to_vec();
        for pair in passing {
            let [first, second] = self.mesh.faces_of(pair);
            for &f in &first {
                let around =
                    second.iter().filter(|&&g| g != f && !(self.mesh.is_body(f) && self.mesh.is_body(g)));
                pairs.extend(around.map(|&g| (f.min(g), f.max(g))));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs.retain(|pair| self.intersections.binary_search(pair).is_err());
        self.intersecting(&pairs, positions)
    }
}

/// Corners of two faces. A loop: `map` over arrays of this size calls `memcpy` for every part.
#[inline(always)]
fn corners_of_faces(state: &[[f64; 3]], faces: [[u32; 3]; 2]) -> TrianglePair {
    let mut corners = [[[0.0; 3]; 3]; 2];
    for (corners, face) in corners.iter_mut().zip(faces) {
        for (corner, v) in corners.iter_mut().zip(face) {
            *corner = state[v as usize];
        }
    }
    corners
}

/// Corners of a pair of elements.
#[inline(always)]
fn corners_of(state: &[[f64; 3]], pair: &ElementPair) -> Corners {
    let mut corners = [[0.0; 3]; 4];
    for (corner, v) in corners.iter_mut().zip(pair.vertices) {
        *corner = state[v as usize];
    }
    corners
}

/// A motion that was refused `times` times: it is halved until it ends.
fn drawn_back(from: [f64; 3], wanted: [f64; 3], times: u8) -> [f64; 3] {
    match times > HALVINGS {
        true => from,
        false => add_scaled(from, 0.5_f64.powi(i32::from(times)), sub(wanted, from)),
    }
}
