//! A triangle mesh that can be edited: the three local edge operations of remeshing.
//!
//! Vertices keep the labels of the [`LabelledTriangles`] the mesh is made of.

use super::clean::compact;
use super::labelled_triangles::LabelledTriangles;
use super::triangle::{smallest_sine, triangle_normal};
use clothcombo_physics::vec3::{add, dot, norm, sub};

/// An editable manifold triangle mesh with boundary.
#[derive(Debug, Clone)]
pub struct EditableMesh {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) labels: Vec<u32>,
    /// Removed faces are [`DEAD`].
    pub(super) faces: Vec<[u32; 3]>,
    /// Faces around each vertex; empty for removed vertices.
    incident: Vec<Vec<u32>>,
}

/// Marks a removed face.
pub(super) const DEAD: [u32; 3] = [u32::MAX; 3];

impl EditableMesh {
    /// The mesh of these triangles, with their labels.
    pub fn new(triangles: LabelledTriangles) -> Self {
        let LabelledTriangles { positions, labels, faces } = triangles;
        let mut incident = vec![Vec::with_capacity(8); positions.len()];
        for (f, face) in faces.iter().enumerate() {
            for v in face {
                incident[*v as usize].push(f as u32);
            }
        }
        Self { positions, labels, faces, incident }
    }

    /// Living faces with vertices renumbered in order of first use.
    pub fn compact(&self) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let alive = self.faces.iter().copied().filter(|f| *f != DEAD);
        let (used, faces) = compact(alive, self.positions.len());
        (used.iter().map(|v| self.point(*v)).collect(), faces)
    }

    pub(super) fn incident(&self, v: u32) -> &[u32] {
        &self.incident[v as usize]
    }

    pub(super) fn is_alive(&self, v: u32) -> bool {
        !self.incident[v as usize].is_empty()
    }

    pub(super) fn point(&self, v: u32) -> [f64; 3] {
        self.positions[v as usize]
    }

    pub(super) fn length(&self, a: u32, b: u32) -> f64 {
        norm(sub(self.point(a), self.point(b)))
    }

    /// Unique living edges `[low, high]` in a fixed order.
    pub(super) fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges = Vec::with_capacity(self.faces.len() * 3 / 2 + 16);
        for face in self.faces.iter().filter(|f| **f != DEAD) {
            for corner in 0..3 {
                let (a, b) = (face[corner], face[(corner + 1) % 3]);
                // An inner edge is met in both directions, a boundary edge, whose ends are labelled, in only one.
                let labelled = self.labels[a as usize] != 0 && self.labels[b as usize] != 0;
                if a < b || (labelled && self.edge_faces(a, b).1 == 1) {
                    edges.push([a.min(b), a.max(b)]);
                }
            }
        }
        edges
    }

    /// The faces of an edge (at most two are returned) and their number.
    pub(super) fn edge_faces(&self, a: u32, b: u32) -> ([u32; 2], usize) {
        let (mut faces, mut count) = ([u32::MAX; 2], 0);
        for &f in &self.incident[a as usize] {
            if self.faces[f as usize].contains(&b) {
                if count < 2 {
                    faces[count] = f;
                }
                count += 1;
            }
        }
        (faces, count)
    }

    /// Whether an edge joins two vertices.
    fn are_neighbours(&self, a: u32, b: u32) -> bool {
        self.incident[a as usize].iter().any(|f| self.faces[*f as usize].contains(&b))
    }

    fn opposite(&self, f: u32, a: u32, b: u32) -> u32 {
        let face = self.faces[f as usize];
        face[0] ^ face[1] ^ face[2] ^ a ^ b
    }

    /// Unnormalised normal (twice the area) of a face.
    pub(super) fn normal(&self, f: u32) -> [f64; 3] {
        triangle_normal(self.faces[f as usize].map(|v| self.point(v)))
    }

    /// Area-weighted normal of a vertex, not normalised.
    pub(super) fn vertex_normal(&self, v: u32) -> [f64; 3] {
        self.incident[v as usize].iter().fold([0.0; 3], |sum, f| add(sum, self.normal(*f)))
    }

    /// Neighbours of a vertex in order of first appearance.
    pub(super) fn neighbours(&self, v: u32, into: &mut Vec<u32>) {
        into.clear();
        for &f in &self.incident[v as usize] {
            for u in self.faces[f as usize] {
                if u != v && !into.contains(&u) {
                    into.push(u);
                }
            }
        }
    }

    /// The two neighbours along the boundary, if `v` is an ordinary boundary vertex.
    pub(super) fn boundary_neighbours(&self, v: u32) -> Option<[u32; 2]> {
        let (mut ends, mut count) = ([0; 2], 0);
        for &f in &self.incident[v as usize] {
            for u in self.faces[f as usize] {
                if u != v && self.edge_faces(v, u).1 == 1 {
                    if count == 2 {
                        return None;
                    }
                    ends[count] = u;
                    count += 1;
                }
            }
        }
        (count == 2).then_some(ends)
    }

    fn detach(&mut self, v: u32, f: u32) {
        let list = &mut self.incident[v as usize];
        if let Some(at) = list.iter().position(|x| *x == f) {
            list.remove(at);
        }
    }

    /// Fewest faces a vertex may have: one at a corner; two on a smooth boundary, where a single face would be flat.
    fn least_faces(&self, v: u32) -> usize {
        match self.labels[v as usize].count_ones() {
            0 => 3,
            1 => 2,
            _ => 1,
        }
    }

    /// Inserts a vertex at `position` into the edge; the label of a boundary edge is inherited.
    pub(super) fn split(&mut self, a: u32, b: u32, position: [f64; 3]) -> u32 {
        let (faces, count) = self.edge_faces(a, b);
        let middle = self.positions.len() as u32;
        self.positions.push(position);
        self.labels.push(if count == 1 { self.labels[a as usize] & self.labels[b as usize] } else { 0 });
        self.incident.push(Vec::with_capacity(6));
        for &f in &faces[..count.min(2)] {
            let c = self.opposite(f, a, b);
            let new = self.faces.len() as u32;
            let old_face = self.faces[f as usize];
            self.faces[f as usize] = old_face.map(|v| if v == b { middle } else { v });
            self.faces.push(old_face.map(|v| if v == a { middle } else { v }));
            self.detach(b, f);
            self.incident[b as usize].push(new);
            self.incident[c as usize].push(new);
            self.incident[middle as usize].extend([f, new]);
        }
        middle
    }

    /// Whether removing `gone` by merging it into `kept` keeps the mesh a manifold and the boundary curves whole.
    pub(super) fn can_collapse(&self, gone: u32, kept: u32) -> bool {
        let (faces, count) = self.edge_faces(gone, kept);
        if count == 0 || count > 2 {
            return false;
        }
        let (label_gone, label_kept) = (self.labels[gone as usize], self.labels[kept as usize]);
        if label_gone != 0 && (count != 1 || label_gone.count_ones() != 1 || label_gone & label_kept == 0) {
            return false;
        }
        let across = [0, count - 1].map(|i| self.opposite(faces[i], gone, kept));
        if count == 2 && across[0] == across[1] {
            return false;
        }
        // Link condition: the only common neighbours are those opposite the edge.
        let ends = [gone, kept, across[0], across[1]];
        let mut around_gone = self.incident[gone as usize].iter().flat_map(|f| self.faces[*f as usize]);
        if around_gone.any(|u| !ends.contains(&u) && self.are_neighbours(u, kept)) {
            return false;
        }
        for c in across {
            // The vertex across must keep a proper fan.
            if self.incident[c as usize].len() <= self.least_faces(c) {
                return false;
            }
        }
        // A boundary loop needs more than three vertices to lose one.
        if count == 1
            && let (Some(p), Some(q)) = (self.boundary_neighbours(gone), self.boundary_neighbours(kept))
            && p.iter().any(|v| *v != kept && q.contains(v))
        {
            return false;
        }
        true
    }

    /// Whether every face around `v` outside `without` keeps its orientation and a usable shape when `v` moves.
    pub(super) fn can_move(&self, v: u32, target: [f64; 3], without: u32, least_angle: f64) -> bool {
        let least_sine = least_angle.to_radians().sin();
        let around = self.vertex_normal(v);
        self.incident[v as usize].iter().all(|&f| {
            let face = self.faces[f as usize];
            if face.contains(&without) {
                return true;
            }
            let before = self.normal(f);
            let corners = face.map(|u| if u == v { target } else { self.point(u) });
            let after = triangle_normal(corners);
            let old = smallest_sine(face.map(|u| self.point(u)));
            // The normal of a sliver says nothing: compare with the mean around the vertex instead.
            let reference = if old > 0.15 { before } else { around };
            if dot(reference, after) <= 0.3 * norm(reference) * norm(after) {
                return false;
            }
            let new = smallest_sine(corners);
            new >= least_sine.min(old)
        })
    }

    /// Merges `gone` into `kept`, which moves to `position`. Call [`Self::can_collapse`] first.
    pub(super) fn collapse(&mut self, gone: u32, kept: u32, position: [f64; 3]) {
        let faces = std::mem::take(&mut self.incident[gone as usize]);
        for f in faces {
            let face = self.faces[f as usize];
            if face.contains(&kept) {
                for v in face {
                    if v != gone {
                        self.detach(v, f);
                    }
                }
                self.faces[f as usize] = DEAD;
            } else {
                self.faces[f as usize] = face.map(|v| if v == gone { kept } else { v });
                self.incident[kept as usize].push(f);
            }
        }
        self.positions[kept as usize] = position;
    }

    /// Replaces edge `ab` by the other diagonal of its two faces if that raises the smallest angle, by more than a
    /// relative `gain`, without folding the surface. Returns whether it did.
    pub(super) fn flip_if_better(&mut self, a: u32, b: u32, gain: f64) -> bool {
        let (faces, count) = self.edge_faces(a, b);
        if count != 2 {
            return false;
        }
        let [f, g] = faces;
        // Orient so that f runs a → b.
        let face = self.faces[f as usize];
        let forward = (0..3).any(|i| face[i] == a && face[(i + 1) % 3] == b);
        let (f, g) = if forward { (f, g) } else { (g, f) };
        let (c, d) = (self.opposite(f, a, b), self.opposite(g, a, b));
        let [pa, pb, pc, pd] = [a, b, c, d].map(|v| self.point(v));
        let before = smallest_sine([pa, pb, pc]).min(smallest_sine([pb, pa, pd]));
        let after = smallest_sine([pc, pa, pd]).min(smallest_sine([pc, pd, pb]));
        if c == d || after <= before * (1.0 + gain) || self.are_neighbours(c, d) {
            return false;
        }
        if [a, b].iter().any(|v| self.incident[*v as usize].len() <= self.least_faces(*v)) {
            return false;
        }
        let (n0, n1) = (triangle_normal([pa, pb, pc]), triangle_normal([pb, pa, pd]));
        let (m0, m1) = (triangle_normal([pc, pa, pd]), triangle_normal([pc, pd, pb]));
        let mean = add(n0, n1);
        let along = |n: [f64; 3]| dot(n, mean) > 0.5 * norm(n) * norm(mean);
        if !(along(m0) && along(m1) && dot(m0, m1) > 0.4 * norm(m0) * norm(m1)) {
            return false;
        }
        self.faces[f as usize] = [c, a, d];
        self.faces[g as usize] = [c, d, b];
        self.detach(b, f);
        self.detach(a, g);
        self.incident[d as usize].push(f);
        self.incident[c as usize].push(g);
        true
    }
}
