//! Contact orientation: on which side of each other near elements of cloth lie in a state, and the conditions that keep them
//! there.
//!
//! Deep in a crease of the body many sheets lie over each other, and no outward direction orders them: the nearest body point may
//! be on either side. A state without intersections needs no order: after a short step every vertex has to be on the same side
//! of the faces near it as before, and every edge on the same side of the edges near it, the two ways in which triangles can
//! begin to intersect. Elements of triangles that intersect all the same keep the side they had before, so that a later step
//! can separate them.

use std::collections::HashSet;

use rayon::prelude::*;

use super::contact::{Contact, is_tiny, normal_of};
use super::outfit::Outfit;
use crate::contact::TriangleTree;
use crate::vec3::{bounds, cross, dot, norm_squared, scale, sub};

/// Elements nearer than this (m) may meet in a step.
const WATCH: f64 = 0.006;
/// How far beyond a face or an edge an element may lie and still slide over it in a step, as a share of the face or edge.
const BESIDE: f64 = 0.25;
/// Edges with a smaller sine between them have no orientation.
const PARALLEL: f64 = 0.1;
/// Least and largest distance that a condition keeps, as shares of the gap.
const KEPT: (f64, f64) = (0.1, 0.5);

/// The sides of all near vertex–face and edge–edge pairs in a state of an outfit.
pub(super) struct ContactOrientation {
    vertices: Vec<VertexOverFace>,
    edges: Vec<EdgePastEdge>,
    /// Intersecting faces without orientation, in both orders.
    not_oriented: HashSet<(u32, u32)>,
}

/// A vertex over (`side` 1) or under (−1) a face.
#[derive(Clone, Copy)]
struct VertexOverFace {
    vertex: u32,
    face: [u32; 3],
    side: f64,
    /// Distance (m).
    gap: f64,
}

/// An edge on the side of another one to which the cross product of the two points (`side` 1), or on the other (−1).
#[derive(Clone, Copy)]
struct EdgePastEdge {
    edges: [[u32; 2]; 2],
    side: f64,
    /// Distance (m).
    gap: f64,
}

impl ContactOrientation {
    /// The orientation of `outfit` at `positions`. Intersecting faces keep the one they had `before`, or have none.
    pub fn of(outfit: &Outfit<'_>, positions: &[[f64; 3]], before: Option<&Self>) -> Self {
        let tree = TriangleTree::new(positions, &outfit.faces);
        let edges = Edges::of(outfit);
        let intersections = tree.self_pairs();
        let unknown = Pairs::of_faces(&outfit.faces, &intersections);
        let mut vertices: Vec<VertexOverFace> = (0..positions.len() as u32)
            .into_par_iter()
            .with_min_len(64)
            .flat_map_iter(|v| {
                let near = faces_near(&tree, [positions[v as usize]; 2]);
                near.map(|f| outfit.faces[f as usize])
                    .filter(|face| !face.contains(&v) && !unknown.vertices.contains(&(v, *face)))
                    .filter_map(|face| {
                        let Over { at, height, .. } = over(positions, v, face)?;
                        if at.iter().any(|w| *w < 0.0) && are_joined(outfit, &[v], &face) {
                            return None;
                        }
                        let (side, gap) = (height.signum(), height.abs());
                        (gap < WATCH).then_some(VertexOverFace { vertex: v, face, side, gap })
                    })
                    .collect::<Vec<_>>()
            })
            .collect();
        let near_edge = |i: u32| {
            let first = edges.all[i as usize];
            let near = faces_near(&tree, first.map(|v| positions[v as usize]));
            let mut others: Vec<u32> =
                near.flat_map(|f| edges.of_face[f as usize]).filter(|j| *j > i).collect();
            others.sort_unstable();
            others.dedup();
            let pairs = others.into_iter().map(|j| [first, edges.all[j as usize]]);
            pairs
                .filter(|[first, second]| !second.iter().any(|v| first.contains(v)))
                .filter(|pair| !unknown.edges.contains(pair))
                .filter_map(|edges| {
                    let Past { at, height, .. } = past(positions, edges)?;
                    let is_beside = at.iter().any(|t| !(0.0..=1.0).contains(t));
                    if is_beside && are_joined(outfit, &edges[0], &edges[1]) {
                        return None;
                    }
                    let (side, gap) = (height.signum(), height.abs());
                    (gap < WATCH).then_some(EdgePastEdge { edges, side, gap })
                })
                .collect::<Vec<_>>()
        };
        let mut edges: Vec<EdgePastEdge> =
            (0..edges.all.len() as u32).into_par_iter().with_min_len(64).flat_map_iter(near_edge).collect();
        // Intersecting pairs have only their earlier orientation.
        let (first_vertex, first_edge) = (vertices.len(), edges.len());
        if let Some(before) = before {
            let is_unknown = |of: &&VertexOverFace| unknown.vertices.contains(&(of.vertex, of.face));
            vertices.extend(before.vertices.iter().filter(is_unknown));
            let is_unknown = |of: &&EdgePastEdge| unknown.edges.contains(&of.edges);
            edges.extend(before.edges.iter().filter(is_unknown));
        }
        let oriented = Pairs::oriented(&vertices[first_vertex..], &edges[first_edge..]);
        let has_no_orientation =
            |&(f, g): &(u32, u32)| !oriented.include(outfit.faces[f as usize], outfit.faces[g as usize]);
        let not_oriented = intersections
            .into_iter()
            .filter(has_no_orientation)
            .flat_map(|(f, g)| [(f, g), (g, f)])
            .collect();
        Self { vertices, edges, not_oriented }
    }

    /// Whether two faces intersect and have no orientation.
    pub fn is_unknown(&self, f: u32, g: u32) -> bool {
        self.not_oriented.contains(&(f, g))
    }

    /// Conditions at `positions`, within a step, that keep the side of every pair with a vertex that `is_in`.
    pub fn contacts(&self, positions: &[[f64; 3]], is_in: &[bool], gap: f64, found: &mut Vec<Contact>) {
        let (least, most) = (KEPT.0 * gap, KEPT.1 * gap);
        let may_move = |vertices: &[u32]| vertices.iter().any(|&v| is_in[v as usize]);
        for VertexOverFace { vertex, face, side, gap } in &self.vertices {
            if !(may_move(&[*vertex]) || may_move(face)) {
                continue;
            }
            let Some(Over { at, normal, height }) = over(positions, *vertex, *face) else { continue };
            if height * side < 2.0 * most {
                let gap = gap.clamp(least, most);
                found.push(Contact::vertex_over(*vertex, (*face, at), scale(normal, *side), gap));
            }
        }
        for EdgePastEdge { edges, side, gap } in &self.edges {
            if !may_move(edges.as_flattened()) {
                continue;
            }
            let Some(Past { at, normal, height }) = past(positions, *edges) else { continue };
            if height * side < 2.0 * most {
                let ([[p, q], [r, s]], [t, u]) = (*edges, at);
                let weights = [1.0 - t, t, u - 1.0, -u];
                let target = gap.clamp(least, most);
                found.push(Contact::new([p, q, r, s], weights, scale(normal, *side), target));
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
    fn of(outfit: &Outfit<'_>) -> Self {
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

/// Edges of a face, the smaller vertex first.
fn edges_of([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// Vertex–face and edge–edge pairs.
struct Pairs {
    vertices: HashSet<(u32, [u32; 3])>,
    /// In both orders.
    edges: HashSet<[[u32; 2]; 2]>,
}

impl Pairs {
    /// All pairs of intersecting faces.
    fn of_faces(faces: &[[u32; 3]], intersections: &[(u32, u32)]) -> Self {
        let (mut vertices, mut edges) = (HashSet::new(), HashSet::new());
        for &(f, g) in intersections {
            let (f, g) = (faces[f as usize], faces[g as usize]);
            vertices.extend(f.map(|v| (v, g)).into_iter().chain(g.map(|v| (v, f))));
            for one in edges_of(f) {
                edges.extend(edges_of(g).into_iter().flat_map(|other| [[one, other], [other, one]]));
            }
        }
        Self { vertices, edges }
    }

    /// The pairs that have a side.
    fn oriented(vertices: &[VertexOverFace], edges: &[EdgePastEdge]) -> Self {
        let both_ways = |of: &EdgePastEdge| [of.edges, [of.edges[1], of.edges[0]]];
        Self {
            vertices: vertices.iter().map(|of| (of.vertex, of.face)).collect(),
            edges: edges.iter().flat_map(both_ways).collect(),
        }
    }

    /// Whether any pair belongs to two faces.
    fn include(&self, one: [u32; 3], other: [u32; 3]) -> bool {
        let has_vertex = |f: [u32; 3], g| f.iter().any(|&v| self.vertices.contains(&(v, g)));
        let has_edge = |a: &[u32; 2]| edges_of(other).iter().any(|b| self.edges.contains(&[*a, *b]));
        has_vertex(one, other) || has_vertex(other, one) || edges_of(one).iter().any(has_edge)
    }
}

/// Faces with a box near that of two points.
fn faces_near<'a>(tree: &'a TriangleTree<'_>, [a, b]: [[f64; 3]; 2]) -> impl Iterator<Item = u32> + 'a {
    let (low, high) = bounds([a, b]);
    tree.faces_in_box((low.map(|x| x - WATCH), high.map(|x| x + WATCH)))
}

/// Whether an edge joins one of `some` to one of `others`: neighbours in one sheet have no orientation.
fn are_joined(outfit: &Outfit<'_>, some: &[u32], others: &[u32]) -> bool {
    some.iter().any(|&v| outfit.ring(v).any(|n| others.contains(&n)))
}

/// A vertex in the frame of a face.
struct Over {
    /// Barycentric coordinates of its projection.
    at: [f64; 3],
    normal: [f64; 3],
    /// Over the face along its normal (m).
    height: f64,
}

/// None if the vertex does not project into the face, or the face has no normal.
fn over(positions: &[[f64; 3]], vertex: u32, face: [u32; 3]) -> Option<Over> {
    let (p, corners) = (positions[vertex as usize], face.map(|v| positions[v as usize]));
    if is_tiny(&corners) {
        return None;
    }
    let area = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let at = std::array::from_fn(|k| {
        let (next, last) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
        dot(cross(sub(last, next), sub(p, next)), area) / norm_squared(area)
    });
    let normal = normal_of(&corners);
    let is_over = at.iter().all(|w: &f64| *w > -BESIDE);
    is_over.then(|| Over { at, normal, height: dot(normal, sub(p, corners[0])) })
}

/// The closest points of the lines of two edges.
struct Past {
    /// Coordinates on each edge, 0–1.
    at: [f64; 2],
    /// Along the cross product of the two.
    normal: [f64; 3],
    /// Of the first over the second along the normal (m).
    height: f64,
}

/// None if the closest points lie outside the edges, or the edges are about parallel.
fn past(positions: &[[f64; 3]], edges: [[u32; 2]; 2]) -> Option<Past> {
    let [[p, q], [r, s]] = edges.map(|edge| edge.map(|v| positions[v as usize]));
    let (first, second, between) = (sub(q, p), sub(s, r), sub(r, p));
    let across = cross(first, second);
    let squared = norm_squared(across);
    if squared <= PARALLEL * PARALLEL * norm_squared(first) * norm_squared(second) || squared < 1e-24 {
        return None;
    }
    let at = [second, first].map(|other| dot(cross(between, other), across) / squared);
    let normal = scale(across, 1.0 / squared.sqrt());
    let is_past = at.iter().all(|t| *t > -BESIDE && *t < 1.0 + BESIDE);
    is_past.then(|| Past { at, normal, height: -dot(normal, between) })
}

#[cfg(test)]
mod tests;
