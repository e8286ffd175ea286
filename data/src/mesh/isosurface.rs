//! Zero level set of a scalar field by marching tetrahedra.
//!
//! Every cube of a regular grid is cut into six tetrahedra along its main diagonal (Kuhn's subdivision), which is
//! consistent across cubes. A piecewise linear field without exact zeros at the nodes therefore has a level set
//! that is a 2-manifold by construction, with no ambiguous case: this matters more here than triangle shape, because
//! the remesher repairs triangles but cannot repair topology.

use clothcombo_physics::vec3::{add, cross, dot, scale, sub};
use rayon::prelude::*;

/// A regular grid: node `(i, j, k)` lies at `origin + step · (i, j, k)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lattice {
    /// Position of node (0, 0, 0) in metres.
    pub origin: [f64; 3],
    /// Node spacing in metres.
    pub step: f64,
    /// Number of nodes along each axis, at least 2.
    pub nodes: [usize; 3],
}

impl Lattice {
    /// The smallest lattice of spacing `step` that covers the box `[low, high]`.
    pub fn covering(low: [f64; 3], high: [f64; 3], step: f64) -> Self {
        let count = |axis: usize| ((high[axis] - low[axis]) / step).ceil().max(1.0) as usize + 1;
        Self { origin: low, step, nodes: [count(0), count(1), count(2)] }
    }

    /// Total number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.iter().product()
    }

    /// Row-major index, x fastest.
    pub fn index(&self, node: [usize; 3]) -> usize {
        (node[2] * self.nodes[1] + node[1]) * self.nodes[0] + node[0]
    }

    /// Position of a node in metres.
    pub fn position(&self, node: [usize; 3]) -> [f64; 3] {
        std::array::from_fn(|axis| self.origin[axis] + self.step * node[axis] as f64)
    }

    /// The field at every node, in index order.
    pub fn sample(&self, field: impl Fn([f64; 3]) -> f64 + Sync) -> Vec<f64> {
        let row = self.nodes[0];
        let mut values = vec![0.0; self.len()];
        values.par_chunks_mut(row).with_min_len(32).enumerate().for_each(|(r, chunk)| {
            let (j, k) = (r % self.nodes[1], r / self.nodes[1]);
            for (i, value) in chunk.iter_mut().enumerate() {
                *value = field(self.position([i, j, k]));
            }
        });
        values
    }
}

/// The six tetrahedra of a cube as paths 000 → 111; corner bit 0 = x, 1 = y, 2 = z.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// Triangles (outward where the field grows) of the level set `field = 0`, without shared degeneracies: crossings
/// keep a distance of 3 % of a grid edge from the nodes. Open where the level set leaves the lattice.
pub(crate) fn extract(lattice: &Lattice, values: &[f64]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    // Every grid edge starts at its lexicographically smallest node and goes to one of seven neighbours.
    let mut crossing = vec![u32::MAX; lattice.len() * 8];
    let [nx, ny, nz] = lattice.nodes;
    let stride = [1, nx, nx * ny];
    for k in 0..nz - 1 {
        for j in 0..ny - 1 {
            for i in 0..nx - 1 {
                let base = lattice.index([i, j, k]);
                let corner: [usize; 8] = std::array::from_fn(|c| {
                    base + (c & 1) * stride[0] + (c >> 1 & 1) * stride[1] + (c >> 2 & 1) * stride[2]
                });
                let inside: [bool; 8] = std::array::from_fn(|c| values[corner[c]] < 0.0);
                if inside.iter().all(|&b| b == inside[0]) {
                    continue;
                }
                let node_position =
                    |c: usize| lattice.position([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2 & 1)]);
                let mut vertex = |a: usize, b: usize| -> u32 {
                    let (a, b) = if a < b { (a, b) } else { (b, a) };
                    // Along a Kuhn path corner b contains all bits of corner a, so the difference names the edge.
                    let slot = corner[a] * 8 + (b ^ a);
                    if crossing[slot] == u32::MAX {
                        let (fa, fb) = (values[corner[a]], values[corner[b]]);
                        let t = (fa / (fa - fb)).clamp(0.03, 0.97);
                        let (pa, pb) = (node_position(a), node_position(b));
                        crossing[slot] = positions.len() as u32;
                        positions.push(add(pa, scale(sub(pb, pa), t)));
                    }
                    crossing[slot]
                };
                let mut triangles: [([u32; 3], usize, usize); 12] = [([0; 3], 0, 0); 12];
                let mut count = 0;
                for tetrahedron in TETRAHEDRA {
                    let (mut inner, mut outer) = ([0; 4], [0; 4]);
                    let (mut inner_count, mut outer_count) = (0, 0);
                    for c in tetrahedron {
                        if inside[c] {
                            inner[inner_count] = c;
                            inner_count += 1;
                        } else {
                            outer[outer_count] = c;
                            outer_count += 1;
                        }
                    }
                    let mut emit = |t: [u32; 3]| {
                        triangles[count] = (t, inner[0], outer[0]);
                        count += 1;
                    };
                    match inner_count {
                        1 => emit([0, 1, 2].map(|o| vertex(inner[0], outer[o]))),
                        3 => emit([0, 1, 2].map(|n| vertex(inner[n], outer[0]))),
                        2 => {
                            let a = vertex(inner[0], outer[0]);
                            let b = vertex(inner[0], outer[1]);
                            let c = vertex(inner[1], outer[1]);
                            let d = vertex(inner[1], outer[0]);
                            emit([a, b, c]);
                            emit([a, c, d]);
                        }
                        _ => {}
                    }
                }
                for &(t, inner, outer) in &triangles[..count] {
                    let [a, b, c] = t.map(|v| positions[v as usize]);
                    let outward = sub(node_position(outer), node_position(inner));
                    let upright = dot(cross(sub(b, a), sub(c, a)), outward) > 0.0;
                    faces.push(if upright { t } else { [t[0], t[2], t[1]] });
                }
            }
        }
    }
    (positions, faces)
}
