//! Angle-weighted pseudo-normals, computed where a query asks for one: few features are ever the closest, and a posed body is
//! asked only until it moves.

use super::triangle_point::Feature;
use crate::rows::CompressedRows;
use crate::vec3;

/// A sum of unit normals shorter than this is rounding: the faces lie on each other.
const VANISHED: f64 = 1e-9;

/// A surface with the faces at its vertices.
#[derive(Clone, Copy)]
pub(super) struct PseudoNormals<'a> {
    pub positions: &'a [[f64; 3]],
    pub faces: &'a [[u32; 3]],
    pub at_vertex: &'a CompressedRows<u32>,
}

impl PseudoNormals<'_> {
    /// That of a part of face `f`.
    pub fn at(&self, f: u32, part: Feature) -> [f64; 3] {
        let face = self.faces[f as usize];
        match part {
            Feature::Vertex(corner) => self.vertex(face[corner]),
            Feature::Edge(edge) => self.edge(face[edge], face[(edge + 1) % 3]),
            Feature::Face => self.face(f),
        }
    }

    /// Unit normal of face `f`; zero where it has no area.
    pub fn face(&self, f: u32) -> [f64; 3] {
        let [a, b, c] = self.faces[f as usize].map(|v| self.positions[v as usize]);
        vec3::normalized(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)))
    }

    /// That of vertex `v`: the normals of its faces, weighted by their angles there.
    pub fn vertex(&self, v: u32) -> [f64; 3] {
        let here = self.positions[v as usize];
        let mut sum = [0.0; 3];
        for &f in self.at_vertex.row(v as usize) {
            let face = self.faces[f as usize];
            // A face that has the vertex twice has no area and adds nothing.
            let corner = face.iter().position(|&w| w == v).unwrap_or(0);
            let [next, previous] = [1, 2].map(|step| self.positions[face[(corner + step) % 3] as usize]);
            let (along, back) = (vec3::sub(next, here), vec3::sub(previous, here));
            let angle = vec3::norm(vec3::cross(along, back)).atan2(vec3::dot(along, back));
            vec3::axpy(&mut sum, angle, self.face(f));
        }
        vec3::normalized(sum)
    }

    /// That of the edge from `a` to `b`: the sum over the faces that share it; where it vanishes, that of its ends.
    pub fn edge(&self, a: u32, b: u32) -> [f64; 3] {
        let shared = self.at_vertex.row(a as usize).iter().filter(|f| self.faces[**f as usize].contains(&b));
        let sum = shared.fold([0.0; 3], |sum, &f| vec3::add(sum, self.face(f)));
        if vec3::norm_squared(sum) < VANISHED * VANISHED {
            vec3::normalized(vec3::add(self.vertex(a), self.vertex(b)))
        } else {
            vec3::normalized(sum)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::rows::faces_at_vertices;

    /// Sums over all faces, edge by edge and corner by corner, without an index.
    #[test]
    fn normals_equal_sums_over_all_faces() {
        let tube = shapes::tube(0.3, 0.8, 14, 9);
        let (positions, mut faces) = (tube.positions().to_vec(), tube.faces().to_vec());
        // A face without area, and one that folds back onto another: the normals of their edges vanish.
        faces.push([0, 0, 1]);
        faces.push([faces[5][1], faces[5][0], faces[5][2]]);
        let at_vertex = faces_at_vertices(positions.len(), &faces, 0..faces.len() as u32);
        let normals = PseudoNormals { positions: &positions, faces: &faces, at_vertex: &at_vertex };
        let close = |a: [f64; 3], b: [f64; 3]| assert!(vec3::norm(vec3::sub(a, b)) < 1e-12, "{a:?} {b:?}");
        let mut at = vec![[0.0; 3]; positions.len()];
        for (f, face) in (0u32..).zip(&faces) {
            for k in 0..3 {
                let [here, next, last] = [0, 1, 2].map(|step| positions[face[(k + step) % 3] as usize]);
                let (along, back) = (vec3::sub(next, here), vec3::sub(last, here));
                let cosine = vec3::dot(along, back) / (vec3::norm(along) * vec3::norm(back));
                let angle = if cosine.is_nan() { 0.0 } else { cosine.clamp(-1.0, 1.0).acos() };
                let corner = &mut at[face[k] as usize];
                *corner = vec3::add(*corner, vec3::scale(normals.face(f), angle));
            }
        }
        let at: Vec<[f64; 3]> = at.into_iter().map(vec3::normalized).collect();
        (0u32..).zip(&at).for_each(|(v, expected)| close(normals.vertex(v), *expected));
        for face in &faces {
            for (a, b) in [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])] {
                let shared = (0u32..).zip(&faces).filter(|(_, f)| f.contains(&a) && f.contains(&b));
                let sum = shared.fold([0.0; 3], |sum, (f, _)| vec3::add(sum, normals.face(f)));
                let ends = vec3::add(at[a as usize], at[b as usize]);
                let expected = if vec3::norm(sum) < VANISHED { ends } else { sum };
                close(normals.edge(a, b), vec3::normalized(expected));
            }
        }
    }
}
