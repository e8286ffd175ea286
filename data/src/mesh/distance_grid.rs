//! Signed distance to a closed body surface on a regular grid.
//!
//! The generator and the placement search ask for the distance to the body a million times per garment; a grid answers in
//! constant time. Node values are exact within two steps of the surface, right to about a millimetre within a wider band, and
//! constant beyond.
//! The inside is what rays in two of three axis directions call inside, so that a small hole in a scanned body costs
//! nothing.

use super::clean::bounds;
use super::isosurface::Lattice;
use clothcombo_physics::vec3::{add, cross, dot, norm_squared, scale, sub};
use std::collections::VecDeque;

/// Trilinearly interpolated signed distance (m), positive outside.
#[derive(Debug, Clone)]
pub(crate) struct DistanceGrid {
    lattice: Lattice,
    values: Vec<f32>,
    band: f64,
}

impl DistanceGrid {
    /// Nodes are `step` (m) apart; distances are clamped to `band` (m).
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]], step: f64, band: f64) -> Self {
        Self::with_attribute(positions, faces, step, band, |_| 0.0).0
    }

    /// The same, and a grid of what the nearest face has, 0 beyond the band.
    pub fn with_attribute(
        positions: &[[f64; 3]],
        faces: &[[u32; 3]],
        step: f64,
        band: f64,
        attribute: impl Fn(usize) -> f64,
    ) -> (Self, Self) {
        let [low, high] = bounds(positions);
        let lattice = Lattice::covering(low.map(|x| x - band - step), high.map(|x| x + band + step), step);
        let corners = |f: usize| faces[f].map(|v| positions[v as usize]);
        let mut nearest = vec![u32::MAX; lattice.len()];
        let mut squared = vec![band * band; lattice.len()];
        let mut front = VecDeque::new();
        for f in 0..faces.len() {
            let triangle = corners(f);
            let range = node_range(&lattice, &triangle, 2.0);
            for k in range[2].clone() {
                for j in range[1].clone() {
                    for i in range[0].clone() {
                        let node = lattice.index([i, j, k]);
                        let d = distance_squared_to_triangle(lattice.position([i, j, k]), triangle);
                        if d < squared[node] {
                            squared[node] = d;
                            if nearest[node] == u32::MAX {
                                front.push_back([i, j, k]);
                            }
                            nearest[node] = f as u32;
                        }
                    }
                }
            }
        }
        // Brush fire: a node's nearest triangle is nearly always the nearest triangle of one of its neighbours.
        while let Some(at) = front.pop_front() {
            let face = nearest[lattice.index(at)];
            let triangle = corners(face as usize);
            for axis in 0..3 {
                for forward in [false, true] {
                    let mut next = at;
                    if forward {
                        next[axis] += 1;
                    } else {
                        next[axis] = next[axis].wrapping_sub(1);
                    }
                    if next[axis] >= lattice.nodes[axis] {
                        continue;
                    }
                    let node = lattice.index(next);
                    if nearest[node] == face {
                        continue;
                    }
                    let d = distance_squared_to_triangle(lattice.position(next), triangle);
                    if d < squared[node] {
                        squared[node] = d;
                        nearest[node] = face;
                        front.push_back(next);
                    }
                }
            }
        }
        let inside = votes(&lattice, positions, faces);
        let values = squared
            .iter()
            .zip(inside)
            .map(|(d, votes)| if votes >= 2 { -d.sqrt() as f32 } else { d.sqrt() as f32 })
            .collect();
        let of_face = |f: &u32| if *f == u32::MAX { 0.0 } else { attribute(*f as usize) as f32 };
        let attributes = nearest.iter().map(of_face).collect();
        (Self { lattice, values, band }, Self { lattice, values: attributes, band: 0.0 })
    }

    /// Takes the smaller of the distance and `other` (m) at every node.
    pub fn unite(&mut self, other: impl Fn([f64; 3]) -> f64) {
        let [nx, ny, nz] = self.lattice.nodes;
        for k in 0..nz {
            for j in 0..ny {
                for i in 0..nx {
                    let value = &mut self.values[self.lattice.index([i, j, k])];
                    *value = value.min(other(self.lattice.position([i, j, k])) as f32);
                }
            }
        }
    }

    /// Value at `p`: the signed distance (m), clamped to the band.
    pub fn distance(&self, p: [f64; 3]) -> f64 {
        let mut cell = [0; 3];
        let mut t = [0.0; 3];
        for axis in 0..3 {
            let x = (p[axis] - self.lattice.origin[axis]) / self.lattice.step;
            if !(x >= 0.0 && x < (self.lattice.nodes[axis] - 1) as f64) {
                return self.band;
            }
            cell[axis] = x as usize;
            t[axis] = x - cell[axis] as f64;
        }
        let base = self.lattice.index(cell);
        let (dy, dz) = (self.lattice.nodes[0], self.lattice.nodes[0] * self.lattice.nodes[1]);
        let along = |at: usize| {
            let (a, b) = (f64::from(self.values[at]), f64::from(self.values[at + 1]));
            a + t[0] * (b - a)
        };
        let (a, b) = (along(base), along(base + dy));
        let (c, d) = (along(base + dz), along(base + dz + dy));
        let (near, far) = (a + t[1] * (b - a), c + t[1] * (d - c));
        near + t[2] * (far - near)
    }
}

/// Nodes in the bounding box of a triangle, widened by `margin` cells.
fn node_range(lattice: &Lattice, triangle: &[[f64; 3]; 3], margin: f64) -> [std::ops::Range<usize>; 3] {
    std::array::from_fn(|axis| {
        let low = triangle.iter().map(|p| p[axis]).fold(f64::MAX, f64::min);
        let high = triangle.iter().map(|p| p[axis]).fold(f64::MIN, f64::max);
        let node = |x: f64| (x - lattice.origin[axis]) / lattice.step;
        let first = (node(low) - margin).ceil().max(0.0) as usize;
        let end = ((node(high) + margin).floor().max(0.0) as usize + 1).min(lattice.nodes[axis]);
        first..end
    })
}

/// How many of the three axis directions see each node inside by the parity of crossings.
fn votes(lattice: &Lattice, positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<u8> {
    let mut votes = vec![0u8; lattice.len()];
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut parity = vec![false; lattice.len()];
        // Rays miss the nodes' own lines by a hair, so that they do not pass through edges of symmetric bodies.
        let offset = [1.37e-7, 2.19e-7];
        for face in faces {
            let triangle = face.map(|i| positions[i as usize]);
            let range = node_range(lattice, &triangle, 0.01);
            let [a, b, c] = triangle;
            let area = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
            if area == 0.0 {
                continue;
            }
            for iu in range[u].clone() {
                for iv in range[v].clone() {
                    let x = lattice.origin[u] + lattice.step * iu as f64 + offset[0];
                    let y = lattice.origin[v] + lattice.step * iv as f64 + offset[1];
                    let wb = ((x - a[u]) * (c[v] - a[v]) - (y - a[v]) * (c[u] - a[u])) / area;
                    let wc = ((b[u] - a[u]) * (y - a[v]) - (b[v] - a[v]) * (x - a[u])) / area;
                    if wb < 0.0 || wc < 0.0 || wb + wc > 1.0 {
                        continue;
                    }
                    let height = a[axis] + wb * (b[axis] - a[axis]) + wc * (c[axis] - a[axis]);
                    let first = ((height - lattice.origin[axis]) / lattice.step).ceil().max(0.0) as usize;
                    if first < lattice.nodes[axis] {
                        let mut node = [0; 3];
                        (node[axis], node[u], node[v]) = (first, iu, iv);
                        parity[lattice.index(node)] ^= true;
                    }
                }
            }
        }
        let stride = [1, lattice.nodes[0], lattice.nodes[0] * lattice.nodes[1]][axis];
        for at in 0..parity.len() {
            if !(at / stride).is_multiple_of(lattice.nodes[axis]) {
                parity[at] ^= parity[at - stride];
            }
            votes[at] += u8::from(parity[at]);
        }
    }
    votes
}

/// Ericson, "Real-Time Collision Detection", 2005, §5.1.5.
fn distance_squared_to_triangle(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return norm_squared(ap);
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return norm_squared(bp);
    }
    let to = |origin: [f64; 3], direction: [f64; 3], t: f64| {
        norm_squared(sub(p, add(origin, scale(direction, t))))
    };
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return to(a, ab, d1 / (d1 - d3));
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return norm_squared(cp);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return to(a, ac, d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        return to(b, sub(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let n = cross(ab, ac);
    let height = dot(ap, n);
    height * height / norm_squared(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_a_sphere_inside_and_outside() {
        let radius = 0.15;
        let field = |p: [f64; 3]| norm_squared(p).sqrt() - radius;
        let lattice = Lattice::covering([-0.2; 3], [0.2; 3], 0.01);
        let (mut positions, faces) = super::super::isosurface::extract(&lattice, &lattice.sample(field));
        for p in &mut positions {
            *p = scale(*p, radius / norm_squared(*p).sqrt());
        }
        let grid = DistanceGrid::new(&positions, &faces, 0.012, 0.06);
        for i in 0..500 {
            let t = i as f64;
            let direction = [(t * 0.37).sin(), (t * 0.73).cos(), (t * 1.31).sin()];
            let p = scale(direction, (radius - 0.02 + 0.00014 * t) / norm_squared(direction).sqrt());
            assert!((grid.distance(p) - field(p)).abs() < 8e-4, "{p:?}: {} {}", grid.distance(p), field(p));
        }
        assert_eq!(grid.distance([3.0, 0.0, 0.0]), 0.06);
    }
}
