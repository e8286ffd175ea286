//! Contact orientation: on which side of each other near elements of cloth lie in a state, and the conditions that keep them
//! there.
//!
//! Deep in a crease of the body many sheets lie over each other, and no outward direction orders them: the nearest body point may
//! be on either side. A state without intersections needs no order: after a short step every vertex has to be on the same side
//! of the faces near it as before, and every edge on the same side of the edges near it, the two ways in which triangles can
//! begin to intersect. Elements of triangles that intersect all the same keep the side they had before, so that a later step
//! can separate them.

use std::collections::HashSet;
use std::ops::Range;

use rayon::prelude::*;

use super::condition::{Condition, is_tiny, normal_of};
use super::packed_cloth::PackedCloth;
use crate::contact::TriangleTree;
use crate::contact::step_filter::{ElementKey, ElementPair, element_keys};
use crate::vec3::{bounds, cross, dot, norm_squared, scale, sub};

/// Elements nearer than this (m) may meet in a step.
const ORIENTED_WITHIN: f64 = 0.006;
/// How far beyond a face or an edge an element may lie and still slide over it in a step, as a share of the face or edge.
const BESIDE_SHARE: f64 = 0.25;
/// Edges with a smaller sine between them have no orientation.
const PARALLEL: f64 = 0.1;
/// Least and largest distance that a condition keeps, as shares of the gap.
const KEPT_GAP: (f64, f64) = (0.1, 0.5);

/// The sides of all near vertex–face and edge–edge pairs in a state of an outfit.
pub(super) struct ContactOrientation {
    /// Vertices and faces first.
    pairs: Vec<OrientedPair>,
    /// Intersecting faces without orientation, in both orders.
    not_oriented: HashSet<(u32, u32)>,
}

/// A vertex over (`side` 1) or under (−1) a face, or an edge on the side of another one to which the cross product of the two
/// points (1), or on the other (−1).
#[derive(Clone, Copy)]
struct OrientedPair {
    pair: ElementPair,
    side: f64,
    /// Distance (m).
    gap: f64,
}

impl ContactOrientation {
    /// The orientation of `outfit` at `positions`. Intersecting faces keep the one they had `before`, or have none.
    pub fn of(outfit: &PackedCloth<'_>, positions: &[[f64; 3]], before: Option<&Self>) -> Self {
        let tree = TriangleTree::new(positions, &outfit.faces);
        let edges = Edges::of(outfit);
        let intersections = tree.self_pairs();
        let keys = |&(f, g): &(u32, u32)| element_keys(outfit.faces[f as usize], outfit.faces[g as usize]);
        let unknown: HashSet<ElementKey> = intersections.iter().flat_map(keys).collect();
        let oriented = |pair: ElementPair| {
            if unknown.contains(&pair.key()) {
                return None;
            }
            let relative = Relative::of(&pair, positions)?;
            let [first, second] = pair.sides();
            if relative.is_beside(&pair) && are_joined(outfit, first, second) {
                return None;
            }
            let (side, gap) = (relative.height.signum(), relative.height.abs());
            (gap < ORIENTED_WITHIN).then_some(OrientedPair { pair, side, gap })
        };
        let over_faces = |v: u32| -> Vec<OrientedPair> {
            let near = faces_near(&tree, [positions[v as usize]; 2]).map(|f| outfit.faces[f as usize]);
            let pairs = near
                .filter(|face| !face.contains(&v))
                .map(|[a, b, c]| ElementPair { vertices: [v, a, b, c], has_face: true });
            pairs.filter_map(oriented).collect()
        };
        let past_edges = |i: u32| -> Vec<OrientedPair> {
            let [p, q] = edges.all[i as usize];
            let near = faces_near(&tree, [p, q].map(|v| positions[v as usize]));
            let mut others: Vec<u32> =
                near.flat_map(|f| edges.of_face[f as usize]).filter(|j| *j > i).collect();
            others.sort_unstable();
            others.dedup();
            let others = others.into_iter().map(|j| edges.all[j as usize]);
            let pairs = others
                .filter(|other| !other.iter().any(|v| [p, q].contains(v)))
                .map(|[r, s]| ElementPair { vertices: [p, q, r, s], has_face: false });
            pairs.filter_map(oriented).collect()
        };
        let in_parallel =
            |range: Range<usize>| (range.start as u32..range.end as u32).into_par_iter().with_min_len(64);
        let mut pairs: Vec<OrientedPair> =
            in_parallel(0..positions.len()).flat_map_iter(over_faces).collect();
        // Intersecting pairs have only their earlier orientation.
        let known = before.iter().flat_map(|before| &before.pairs);
        let (over, past): (Vec<OrientedPair>, Vec<OrientedPair>) =
            known.filter(|of| unknown.contains(&of.pair.key())).partition(|of| of.pair.has_face);
        pairs.extend(&over);
        pairs.par_extend(in_parallel(0..edges.all.len()).flat_map_iter(past_edges));
        pairs.extend(&past);
        let oriented: HashSet<ElementKey> = over.iter().chain(&past).map(|of| of.pair.key()).collect();
        let has_no_orientation = |pair: &(u32, u32)| !keys(pair).any(|key| oriented.contains(&key));
        let not_oriented = intersections
            .into_iter()
            .filter(has_no_orientation)
            .flat_map(|(f, g)| [(f, g), (g, f)])
            .collect();
        Self { pairs, not_oriented }
    }

    /// Whether two faces intersect and have no orientation.
    pub fn is_unknown(&self, f: u32, g: u32) -> bool {
        self.not_oriented.contains(&(f, g))
    }

    /// Conditions at `positions`, within a step, that keep the side of every pair with a vertex that `is_in`.
    pub fn contacts(&self, positions: &[[f64; 3]], is_in: &[bool], gap: f64, found: &mut Vec<Condition>) {
        let (least, most) = (KEPT_GAP.0 * gap, KEPT_GAP.1 * gap);
        for OrientedPair { pair, side, gap } in &self.pairs {
            if !pair.vertices.iter().any(|&v| is_in[v as usize]) {
                continue;
            }
            let Some(Relative { weights, normal, height }) = Relative::of(pair, positions) else { continue };
            if height * side < 2.0 * most {
                let target = gap.clamp(least, most);
                found.push(Condition::new(pair.vertices, weights, scale(normal, *side), target));
            }
        }
    }
}

/// All edges of an outfit, and for every face its three.
struct Edges {
    all: Vec<[u32; 2]>,
    of_face: Vec<[u32; 3]>,
}

impl Edges {
    fn of(outfit: &PackedCloth<'_>) -> Self {
        let (mut all, mut of_face): (Vec<[u32; 2]>, Vec<[u32; 3]>) = (Vec::new(), Vec::new());
        for (g, layer) in outfit.layers.iter().enumerate() {
            let (start, first) = (outfit.vertices(g).start, all.len() as u32);
            let garment = layer.garment;
            all.extend(garment.topology.edges.iter().map(|edge| edge.map(|v| v + start)));
            of_face.extend(garment.edges_of_faces.iter().map(|edges| edges.map(|e| e + first)));
        }
        Self { all, of_face }
    }
}

/// Faces with a box near that of two points.
fn faces_near<'a>(tree: &'a TriangleTree<'_>, [a, b]: [[f64; 3]; 2]) -> impl Iterator<Item = u32> + 'a {
    let (low, high) = bounds([a, b]);
    tree.faces_in_box((low.map(|x| x - ORIENTED_WITHIN), high.map(|x| x + ORIENTED_WITHIN)))
}

/// Whether an edge joins one of `some` to one of `others`: neighbours in one sheet have no orientation.
fn are_joined(outfit: &PackedCloth<'_>, some: &[u32], others: &[u32]) -> bool {
    some.iter().any(|&v| outfit.ring(v).any(|n| others.contains(&n)))
}

/// How the first element of a pair lies to the second.
struct Relative {
    /// Of the vertices, in the vector from the point of the second element to that of the first.
    weights: [f64; 4],
    normal: [f64; 3],
    /// Of the first over the second along the normal (m).
    height: f64,
}

impl Relative {
    fn of(pair: &ElementPair, positions: &[[f64; 3]]) -> Option<Self> {
        let corners = pair.vertices.map(|v| positions[v as usize]);
        match pair.has_face {
            true => Self::over_face(corners),
            false => Self::past_edge(corners),
        }
    }

    /// Of a vertex along the normal of a face; none if it does not project into the face, or that has no normal.
    fn over_face([p, corners @ ..]: [[f64; 3]; 4]) -> Option<Self> {
        if is_tiny(&corners) {
            return None;
        }
        let area = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
        let [a, b, c] = std::array::from_fn(|k| {
            let (next, last) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
            dot(cross(sub(last, next), sub(p, next)), area) / norm_squared(area)
        });
        let normal = normal_of(&corners);
        let is_over = [a, b, c].iter().all(|w: &f64| *w > -BESIDE_SHARE);
        is_over.then(|| Self { weights: [1.0, -a, -b, -c], normal, height: dot(normal, sub(p, corners[0])) })
    }

    /// Of an edge along the cross product of the two, at the closest points of their lines; none if those lie outside the edges, or
    /// the edges are about parallel.
    fn past_edge([p, q, r, s]: [[f64; 3]; 4]) -> Option<Self> {
        let (first, second, between) = (sub(q, p), sub(s, r), sub(r, p));
        let across = cross(first, second);
        let squared = norm_squared(across);
        if squared <= PARALLEL * PARALLEL * norm_squared(first) * norm_squared(second) || squared < 1e-24 {
            return None;
        }
        let [t, u] = [second, first].map(|other| dot(cross(between, other), across) / squared);
        let normal = scale(across, 1.0 / squared.sqrt());
        let is_past = [t, u].iter().all(|t| *t > -BESIDE_SHARE && *t < 1.0 + BESIDE_SHARE);
        is_past.then(|| Self { weights: [1.0 - t, t, u - 1.0, -u], normal, height: -dot(normal, between) })
    }

    /// Whether a point lies outside its element.
    fn is_beside(&self, pair: &ElementPair) -> bool {
        let (first, second) = self.weights.split_at(pair.first());
        first.iter().any(|w| *w < 0.0) || second.iter().any(|w| *w > 0.0)
    }
}

#[cfg(test)]
mod tests;
