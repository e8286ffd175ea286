//! The triangles that may meet, and which of them stands for each vertex and edge.

use crate::rows::CompressedRows;

/// Garments and a body as one mesh: faces of the cloth first, then those of the body, which are never paired with each other.
#[derive(Debug)]
pub(crate) struct ContactMesh {
    /// Faces `[F, 3]`, by packed vertices.
    pub faces: Vec<[u32; 3]>,
    /// Faces of the cloth; those behind them are of the body.
    pub cloth_faces: usize,
    /// What a face stands for, so that every pair of elements is looked at once: bit `k` its corner `k`, bit `3 + k`
    /// its edge from corner `k` to the next.
    owned: Vec<u8>,
    /// Faces around every vertex, ascending.
    faces_at: CompressedRows<u32>,
}

impl ContactMesh {
    /// Of `cloth` and `body` faces; every index is below `vertices`.
    pub fn new(vertices: usize, cloth: &[[u32; 3]], body: impl Iterator<Item = [u32; 3]>) -> Self {
        let faces: Vec<[u32; 3]> = cloth.iter().copied().chain(body).collect();
        let faces_at = crate::rows::faces_at_vertices(vertices, &faces, 0..faces.len() as u32);
        let mut owned = vec![0; faces.len()];
        for v in 0..vertices {
            let around = faces_at.row(v);
            if let Some(&first) = around.first() {
                let corner = faces[first as usize].iter().position(|&c| c as usize == v);
                owned[first as usize] |= 1 << corner.unwrap_or(0);
            }
            // The edges to larger vertices belong to the first face around `v` that has them.
            for (i, &f) in around.iter().enumerate() {
                for k in 0..3 {
                    let Some(other) = other_end(faces[f as usize], k, v as u32).filter(|&o| o > v as u32)
                    else {
                        continue;
                    };
                    if !around[..i].iter().any(|&g| faces[g as usize].contains(&other)) {
                        owned[f as usize] |= 8 << k;
                    }
                }
            }
        }
        Self { faces, cloth_faces: cloth.len(), owned, faces_at }
    }

    /// Whether face `f` is one of the body.
    pub fn is_body(&self, f: u32) -> bool {
        f as usize >= self.cloth_faces
    }

    /// Faces around vertex `v`, ascending.
    pub fn faces_at(&self, v: u32) -> &[u32] {
        self.faces_at.row(v as usize)
    }

    /// Calls `found` with every pair of elements that faces `f` and `g` stand for.
    #[inline]
    pub fn element_pairs(&self, f: u32, g: u32, mut found: impl FnMut(ElementPair)) {
        let (one, other) = (self.faces[f as usize], self.faces[g as usize]);
        let (of_f, of_g) = (self.owned[f as usize], self.owned[g as usize]);
        for (owned, [a, b]) in [(of_f, [one, other]), (of_g, [other, one])] {
            for k in (0..3).filter(|k| owned >> k & 1 == 1) {
                if !b.contains(&a[k]) {
                    found(ElementPair { vertices: [a[k], b[0], b[1], b[2]], has_face: true });
                }
            }
        }
        for k in (0..3).filter(|k| of_f >> (3 + k) & 1 == 1) {
            let [p, q] = edge(one, k);
            for l in (0..3).filter(|l| of_g >> (3 + l) & 1 == 1) {
                let [r, s] = edge(other, l);
                if p != r && p != s && q != r && q != s {
                    found(ElementPair { vertices: [p, q, r, s], has_face: false });
                }
            }
        }
    }

    /// Faces of the first element of a pair, and those of the second.
    pub fn faces_of(&self, pair: &ElementPair) -> [Vec<u32>; 2] {
        pair.sides().map(|vertices| {
            let has_all = |f: &&u32| vertices.iter().all(|v| self.faces[**f as usize].contains(v));
            self.faces_at(vertices[0]).iter().filter(has_all).copied().collect()
        })
    }
}

/// The edge of a face from corner `k` to the next.
fn edge(face: [u32; 3], k: usize) -> [u32; 2] {
    [face[k], face[(k + 1) % 3]]
}

/// The other end of edge `k` of a face, if `v` is one.
fn other_end(face: [u32; 3], k: usize, v: u32) -> Option<u32> {
    match edge(face, k) {
        [a, b] if a == v => Some(b),
        [a, b] if b == v => Some(a),
        _ => None,
    }
}

/// Whether a pair of elements is a vertex and a face, and its vertices in a fixed order.
pub(crate) type ElementKey = (bool, [u32; 4]);

/// Keys of all pairs of an element of one face and one of the other.
pub(crate) fn element_keys(one: [u32; 3], other: [u32; 3]) -> impl Iterator<Item = ElementKey> {
    let over = [(one, other), (other, one)]
        .into_iter()
        .flat_map(|(a, b)| a.map(|v| ElementPair { vertices: [v, b[0], b[1], b[2]], has_face: true }));
    let past = (0..9).map(move |k| {
        let ([p, q], [r, s]) = (edge(one, k / 3), edge(other, k % 3));
        ElementPair { vertices: [p, q, r, s], has_face: false }
    });
    over.chain(past).map(|pair| pair.key())
}

/// A vertex and a face, or two edges: what has to meet first where two triangles begin to intersect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ElementPair {
    /// The vertex and the corners of the face, or the ends of both edges.
    pub vertices: [u32; 4],
    /// Whether it is a vertex and a face.
    pub has_face: bool,
}

impl ElementPair {
    /// How many vertices the first element has.
    pub fn first(&self) -> usize {
        if self.has_face { 1 } else { 2 }
    }

    /// Vertices of the first element.
    pub fn first_vertices(&self) -> &[u32] {
        &self.vertices[..self.first()]
    }

    /// Vertices of both elements.
    pub fn sides(&self) -> [&[u32]; 2] {
        let (first, second) = self.vertices.split_at(self.first());
        [first, second]
    }

    /// The same for the same elements, however they are turned.
    pub fn key(&self) -> ElementKey {
        let mut key = self.vertices;
        let first = self.first();
        key[..first].sort_unstable();
        key[first..].sort_unstable();
        if !self.has_face && key[..2] > key[2..] {
            key.rotate_left(2);
        }
        (self.has_face, key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use std::collections::HashMap;

    /// Also over an edge with three faces, and one that both faces turn the same way round.
    #[test]
    fn every_pair_of_elements_is_found_exactly_once() {
        let mesh = shapes::union(&[&shapes::tetrahedron(), &shapes::grid(1.0, 1.0, 2, 1)]);
        let mut faces = mesh.faces().to_vec();
        let [a, b, _] = faces[0];
        let extra = mesh.vertex_count() as u32;
        faces.extend([[a, b, extra], [b, a, extra + 1], [b, a, extra + 2]]);
        let mesh = ContactMesh::new(extra as usize + 3, &faces, std::iter::empty());
        let mut found: HashMap<(bool, [u32; 4]), usize> = HashMap::new();
        for f in 0..faces.len() as u32 {
            for g in f + 1..faces.len() as u32 {
                mesh.element_pairs(f, g, |pair| *found.entry(pair.key()).or_default() += 1);
            }
        }
        let mut edges: Vec<[u32; 2]> = faces.iter().flat_map(|&f| [0, 1, 2].map(|k| edge(f, k))).collect();
        edges.iter_mut().for_each(|e| e.sort_unstable());
        edges.sort_unstable();
        edges.dedup();
        let mut expected = 0;
        for face in &faces {
            expected += (0..extra + 3).filter(|v| !face.contains(v)).count();
        }
        for (i, e) in edges.iter().enumerate() {
            expected += edges[i + 1..].iter().filter(|h| !h.contains(&e[0]) && !h.contains(&e[1])).count();
        }
        assert!(found.values().all(|count| *count == 1));
        assert_eq!(found.len(), expected);
    }
}
