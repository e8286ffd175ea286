//! Triangles of a file while they are repaired: every vertex, face and corner knows what of the file it was.

use super::error::FitError;
use super::report::{Elements, MeshPiece, Repair, RepairKind};
use crate::format::{FileFace, PolygonMesh};
use crate::mesh::{Attachment, Seam, attach};
use clothcombo_physics::query::VertexIndex;
use clothcombo_physics::vec3::{cross, norm, norm_squared, normalized, sub};
use clothcombo_physics::{Topology, TriMesh};

/// A corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    /// The corner of the file's face that it is; of one that splits an edge the nearer end.
    pub number: u32,
    /// Whether it is that corner itself.
    pub is_own: bool,
}

impl Corner {
    pub fn own(number: u32) -> Self {
        Self { number, is_own: true }
    }
}

/// Triangles in the file's coordinates.
#[derive(Default)]
pub(super) struct RepairSheet {
    pub positions: Vec<[f64; 3]>,
    pub faces: Vec<[u32; 3]>,
    /// For each vertex the first vertex of the file that became it.
    pub vertex_origin: Vec<u32>,
    /// The inverse: see [`Fitted::vertex_of_file`](super::Fitted::vertex_of_file).
    pub vertex_of_file: Vec<Option<u32>>,
    /// For each face the polygon of the file it is part of, ascending.
    pub face_origin: Vec<u32>,
    pub corners: Vec<[Corner; 3]>,
    /// Faces turned so far.
    pub turned: Vec<bool>,
    pub repairs: Vec<Repair>,
    /// Seams that were joined, by vertices of the file.
    pub seams: Vec<Seam>,
    /// What [`Keep::Largest`](super::Keep::Largest) left out; areas in the square of the file's unit.
    pub dropped_pieces: Vec<MeshPiece>,
    /// Polygons of the file that are left out because of [`Keep`](super::Keep).
    pub dropped_faces: Vec<u32>,
    /// For each vertex of the file a number that those at its place share; `u32::MAX` for unused ones.
    pub welded: Vec<u32>,
}

impl RepairSheet {
    /// Its triangles.
    ///
    /// # Errors
    /// [`FitError::Mesh`] when there are none.
    pub fn mesh(&self) -> Result<TriMesh, FitError> {
        mesh_of(self.positions.clone(), self.faces.clone())
    }

    /// Adds a repair of some elements, if there are any.
    pub fn note(&mut self, kind: RepairKind, mut elements: Elements) {
        if let Elements::Vertices(list) | Elements::Faces(list) = &mut elements {
            list.sort_unstable();
            list.dedup();
        }
        if !elements.is_empty() {
            self.repairs.push(Repair { kind, count: elements.len(), elements });
        }
    }

    /// Leaves out vertices without a face and numbers the others as the file does.
    pub fn number_as_file(&mut self, file: &PolygonMesh) {
        let polygons: Vec<&[u32]> = file.polygons().collect();
        // Every corner's vertex, the vertex of the file, and whether it is that itself.
        let mut known: Vec<(usize, u32, bool)> = Vec::with_capacity(3 * self.faces.len());
        for ((face, corners), polygon) in self.faces.iter().zip(&self.corners).zip(&self.face_origin) {
            let of_file = |corner: &Corner| polygons[*polygon as usize][corner.number as usize];
            known.extend(face.iter().zip(corners).map(|(v, c)| (*v as usize, of_file(c), c.is_own)));
        }
        let mut origin = vec![u32::MAX; self.positions.len()];
        // Corners that split an edge tell of a vertex only if nothing else does.
        for own in [true, false] {
            let mut found = vec![u32::MAX; self.positions.len()];
            known.iter().filter(|k| k.2 == own).for_each(|(v, f, _)| found[*v] = found[*v].min(*f));
            origin.iter_mut().zip(found).filter(|(o, _)| **o == u32::MAX).for_each(|(o, f)| *o = f);
        }
        let mut order: Vec<u32> =
            (0..origin.len() as u32).filter(|v| origin[*v as usize] != u32::MAX).collect();
        order.sort_by_key(|v| origin[*v as usize]);
        let mut number = vec![u32::MAX; origin.len()];
        order.iter().zip(0..).for_each(|(v, new)| number[*v as usize] = new);
        self.positions = order.iter().map(|v| self.positions[*v as usize]).collect();
        self.vertex_origin = order.iter().map(|v| origin[*v as usize]).collect();
        self.faces.iter_mut().flatten().for_each(|v| *v = number[*v as usize]);

        let mut became = vec![None; file.positions.len()];
        for (v, of_file, _) in known.iter().filter(|(_, _, is_own)| *is_own) {
            became[*of_file as usize].get_or_insert(number[*v]);
        }
        // What only faces that were dropped use is where the others at its place are.
        let mut at_place = vec![None; self.positions.len().max(self.welded.len())];
        for (v, place) in became.iter().zip(&self.welded).filter(|(v, _)| v.is_some()) {
            at_place[*place as usize] = at_place[*place as usize].or(*v);
        }
        for (v, place) in became.iter_mut().zip(&self.welded).filter(|(_, place)| **place != u32::MAX) {
            *v = v.or(at_place[*place as usize]);
        }
        self.vertex_of_file = became;
    }

    /// Leaves out all faces but those that `stays` names by their number; returns the polygons they were part of.
    pub fn drop_faces(&mut self, stays: impl Fn(usize) -> bool, file: &PolygonMesh) -> Vec<u32> {
        let mut dropped = Vec::new();
        let mut kept = Vec::new();
        for f in 0..self.faces.len() {
            if stays(f) { kept.push(f) } else { dropped.push(self.face_origin[f]) }
        }
        dropped.dedup();
        self.faces = kept.iter().map(|f| self.faces[*f]).collect();
        self.face_origin = kept.iter().map(|f| self.face_origin[*f]).collect();
        self.corners = kept.iter().map(|f| self.corners[*f]).collect();
        self.turned = kept.iter().map(|f| self.turned[*f]).collect();
        self.dropped_faces.extend(&dropped);
        self.number_as_file(file);
        dropped
    }

    /// Takes over other faces, of which each is part of its parent, over vertices that `became` others.
    pub fn split_faces(
        &mut self,
        positions: Vec<[f64; 3]>,
        faces: Vec<[u32; 3]>,
        parent: &[u32],
        became: &[u32],
    ) {
        let corners = faces.iter().zip(parent).map(|(face, parent)| {
            let whole = self.faces[*parent as usize].map(|v| became[v as usize]);
            let known = self.corners[*parent as usize];
            face.map(|v| match whole.iter().position(|w| *w == v) {
                Some(k) => known[k],
                None => {
                    let distance = |w: u32| norm_squared(sub(positions[w as usize], positions[v as usize]));
                    let mut ends = [0, 1, 2];
                    ends.sort_by(|a, b| distance(whole[*a]).total_cmp(&distance(whole[*b])));
                    Corner { is_own: false, ..known[ends[0]] }
                }
            })
        });
        self.corners = corners.collect();
        self.face_origin = parent.iter().map(|f| self.face_origin[*f as usize]).collect();
        self.turned = parent.iter().map(|f| self.turned[*f as usize]).collect();
        (self.positions, self.faces) = (positions, faces);
    }

    /// A seam by vertices of the file.
    pub fn named(&self, seam: &Seam) -> Seam {
        Seam { ends: seam.ends.map(|v| self.vertex_origin[v as usize]), ..*seam }
    }

    /// All borders, in the order of `topology`, which is the sheet's: their vertices in the file, ascending, and the seams that
    /// they are if they stay open.
    pub fn borders(&self, topology: &Topology) -> Vec<(Vec<u32>, Seam)> {
        let borders = topology.boundary_loops.iter().map(|border| {
            let from = |a: u32, b: u32| sub(self.positions[b as usize], self.positions[a as usize]);
            let farthest = |end: u32| {
                let of = border.iter().map(|v| (*v, norm(from(end, *v))));
                of.fold((end, 0.0), |best, v| if v.1 > best.1 { v } else { best })
            };
            let end = farthest(border[0]).0;
            let (other, length) = farthest(end);
            let along = normalized(from(end, other));
            let width = border.iter().map(|v| norm(cross(along, from(end, *v)))).fold(0.0, f64::max);
            let mut vertices: Vec<u32> = border.iter().map(|v| self.vertex_origin[*v as usize]).collect();
            vertices.sort_unstable();
            let ends = [vertices[0], vertices[vertices.len() - 1]];
            (vertices, Seam { length, gap: width, widest: width, ends, is_joined: false })
        });
        borders.collect()
    }

    /// Area of a face (in the square of the file's unit).
    pub fn area(&self, face: usize) -> f64 {
        let [a, b, c] = self.faces[face].map(|v| self.positions[v as usize]);
        0.5 * norm(cross(sub(b, a), sub(c, a)))
    }

    /// For each vertex of the file the place that it follows: the vertex it became; where its faces were left out on request, the
    /// nearest point of the sheet and how it stands on it (m, `metres` of the file's unit); otherwise the nearest vertex.
    pub fn followed(&self, file: &PolygonMesh, metres: f64) -> Vec<Attachment> {
        let mut follows: Vec<Option<Attachment>> =
            self.vertex_of_file.iter().map(|v| v.map(Attachment::to_vertex)).collect();
        let mut is_loose = vec![false; follows.len()];
        let mut dropped = vec![false; file.polygon_count()];
        self.dropped_faces.iter().for_each(|f| dropped[*f as usize] = true);
        for (_, polygon) in file.polygons().enumerate().filter(|(f, _)| dropped[*f]) {
            polygon.iter().for_each(|v| is_loose[*v as usize] = follows[*v as usize].is_none());
        }
        let loose: Vec<usize> = (0..follows.len()).filter(|v| is_loose[*v]).collect();
        let points: Vec<[f64; 3]> = loose.iter().map(|v| file.positions[*v]).collect();
        if !points.is_empty() {
            for (v, attached) in
                loose.iter().zip(attach(&points, &self.positions, &self.faces).into_iter().flatten())
            {
                follows[*v] = Some(attached.scaled(metres));
            }
        }
        if follows.iter().any(Option::is_none) {
            let index = VertexIndex::new(&self.positions);
            for (v, follows) in follows.iter_mut().enumerate().filter(|(_, f)| f.is_none()) {
                *follows = Some(Attachment::to_vertex(index.nearest(file.positions[v]).0));
            }
        }
        follows.into_iter().flatten().collect()
    }

    /// The faces as polygons of the file where they still are, else as triangles.
    pub fn file_faces(&self, file: &PolygonMesh) -> Vec<FileFace> {
        let polygons: Vec<&[u32]> = file.polygons().collect();
        let mut faces = Vec::with_capacity(polygons.len());
        let mut first = 0;
        for same in self.face_origin.chunk_by(|a, b| a == b) {
            let (face, range) = (same[0], first..first + same.len());
            first = range.end;
            match self.whole_polygon(range.clone(), polygons[face as usize].len() as u32) {
                Some(corners) => faces.push(FileFace { face, corners }),
                None => faces.extend(range.map(|f| {
                    let corners = self.faces[f].iter().zip(&self.corners[f]);
                    FileFace { face, corners: corners.map(|(v, corner)| [*v, corner.number]).collect() }
                })),
            }
        }
        faces
    }

    /// The corners of a polygon of `count` corners, if its triangles are all there, turned alike, and meet as they did.
    fn whole_polygon(&self, triangles: std::ops::Range<usize>, count: u32) -> Option<Vec<[u32; 2]>> {
        if triangles.len() + 2 != count as usize {
            return None;
        }
        let turned = self.turned[triangles.start];
        let mut vertices = vec![None; count as usize];
        for f in triangles.clone() {
            for (v, corner) in self.faces[f].iter().zip(&self.corners[f]) {
                let known = vertices[corner.number as usize].get_or_insert(*v);
                if *known != *v || !corner.is_own || self.turned[f] != turned {
                    return None;
                }
            }
        }
        // The first corner of the fan.
        let start = self.corners[triangles.start][0].number;
        let step = if turned { count - 1 } else { 1 };
        (0..count).map(|i| (start + i * step) % count).map(|k| Some([vertices[k as usize]?, k])).collect()
    }
}

/// A triangle mesh.
///
/// # Errors
/// [`FitError::Mesh`] when there is none.
pub(super) fn mesh_of(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<TriMesh, FitError> {
    TriMesh::new(positions, faces).map_err(|e| FitError::Mesh(e.to_string()))
}

#[cfg(test)]
mod tests;
