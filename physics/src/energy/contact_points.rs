//! Where contact is evaluated: at the vertices of a garment, and between them.

use super::{CurvatureSink, Weighted};
use crate::mesh::{Topology, TriMesh};
use crate::real::Real;
use crate::vec3::{add, scale};

/// Which points of a garment the collisions are summed over. The sum is divided by how many there are for each vertex,
/// so that its weight means the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ContactSamples {
    /// Vertices: the paper's form. What is between them can intersect unnoticed.
    #[default]
    Vertices,
    /// Also the centres of the faces.
    Faces,
    /// Also the midpoints of the edges.
    FacesAndEdges,
}

/// The contact points of one garment: all vertices, then the centres of all faces, then the midpoints of all edges.
#[derive(Debug, Clone)]
pub struct ContactPoints {
    vertices: usize,
    faces: Vec<[u32; 3]>,
    edges: Vec<[u32; 2]>,
}

impl ContactPoints {
    pub(super) fn new(rest: &TriMesh, topology: &Topology) -> Self {
        Self { vertices: rest.vertex_count(), faces: rest.faces().to_vec(), edges: topology.edges.clone() }
    }

    /// Of points without faces.
    #[cfg(test)]
    pub(crate) fn of_vertices(vertices: usize) -> Self {
        Self { vertices, faces: Vec::new(), edges: Vec::new() }
    }

    /// The faces of the garment.
    pub(crate) fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// How many points there are.
    pub fn count(&self, samples: ContactSamples) -> usize {
        self.vertices
            + match samples {
                ContactSamples::Vertices => 0,
                ContactSamples::Faces => self.faces.len(),
                ContactSamples::FacesAndEdges => self.faces.len() + self.edges.len(),
            }
    }

    /// The share of a vertex that a point stands for.
    pub fn share(&self, samples: ContactSamples) -> f64 {
        self.vertices as f64 / self.count(samples).max(1) as f64
    }

    /// The points of a garment at `positions` `[V, 3]` (m).
    pub fn at<T: Real>(&self, positions: &[[T; 3]], samples: ContactSamples) -> Vec<[T; 3]> {
        let (third, half) = (T::from_f64(1.0 / 3.0), T::from_f64(0.5));
        let p = |v: u32| positions[v as usize];
        let mut points = positions.to_vec();
        if samples != ContactSamples::Vertices {
            points.extend(self.faces.iter().map(|&[a, b, c]| scale(add(add(p(a), p(b)), p(c)), third)));
        }
        if samples == ContactSamples::FacesAndEdges {
            points.extend(self.edges.iter().map(|&[a, b]| scale(add(p(a), p(b)), half)));
        }
        points
    }

    /// The vertices whose mean a point is.
    #[inline(always)]
    pub fn corners(&self, point: usize) -> Corners {
        let (face, edge) =
            (point.wrapping_sub(self.vertices), point.wrapping_sub(self.vertices + self.faces.len()));
        if point < self.vertices {
            Corners { vertices: [point as u32; 3], count: 1 }
        } else if let Some(&vertices) = self.faces.get(face) {
            Corners { vertices, count: 3 }
        } else {
            let [a, b] = self.edges[edge];
            Corners { vertices: [a, b, b], count: 2 }
        }
    }

    /// The mean of `values` `[V]` over the corners of a point; 0 where there are none.
    #[inline(always)]
    pub(super) fn mean<T: Real>(&self, values: &[T], point: usize) -> f64 {
        if values.is_empty() {
            return 0.0;
        }
        let corners = self.corners(point);
        corners.iter().map(|v| values[v].to_f64()).sum::<f64>() * corners.weight()
    }

    /// `gradient[corners] += weight·g` for the gradient `g` at a point.
    #[inline(always)]
    pub(super) fn add<T: Real>(&self, target: &mut Weighted<'_, T>, point: usize, g: [f64; 3]) {
        let corners = self.corners(point);
        let g = scale(g, corners.weight());
        corners.iter().for_each(|v| target.add(v, g));
    }

    /// Adds the second derivatives `block` at a point.
    pub(crate) fn add_curvature(&self, sink: &mut dyn CurvatureSink, point: usize, block: [[f64; 3]; 3]) {
        let corners = self.corners(point);
        let block = block.map(|row| scale(row, corners.weight() * corners.weight()));
        for (k, i) in corners.iter().enumerate() {
            corners.iter().take(k + 1).for_each(|j| sink.add(i, j, block));
        }
    }
}

/// One to three vertices of equal weight.
#[derive(Debug, Clone, Copy)]
pub struct Corners {
    vertices: [u32; 3],
    count: usize,
}

impl Corners {
    /// The vertices.
    pub fn iter(&self) -> impl Iterator<Item = usize> + '_ {
        self.vertices[..self.count].iter().map(|v| *v as usize)
    }

    /// The weight of each.
    pub fn weight(&self) -> f64 {
        1.0 / self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn points_are_the_means_of_their_corners_and_stand_for_all_vertices_together() {
        let mesh = shapes::irregular_grid(0.3, 0.2, 4, 3, 0.2, 1);
        let topology = Topology::new(&mesh);
        let points = ContactPoints::new(&mesh, &topology);
        let (v, f, e) = (mesh.vertex_count(), mesh.face_count(), topology.edges.len());
        for (samples, count) in [
            (ContactSamples::Vertices, v),
            (ContactSamples::Faces, v + f),
            (ContactSamples::FacesAndEdges, v + f + e),
        ] {
            let at = points.at(mesh.positions(), samples);
            assert_eq!((at.len(), points.count(samples)), (count, count));
            assert!((points.share(samples) * count as f64 - v as f64).abs() < 1e-12);
            for (point, p) in at.iter().enumerate() {
                let corners = points.corners(point);
                let sum = corners.iter().map(|v| mesh.positions()[v]).fold([0.0; 3], add);
                let mean = scale(sum, corners.weight());
                assert!(crate::vec3::distance_squared(mean, *p) < 1e-24);
            }
        }
    }
}
