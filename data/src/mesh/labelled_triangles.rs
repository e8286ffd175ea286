//! Surfaces cut along scalar fields.
//!
//! Each vertex carries a label: a bit set of the cut curves it lies on. Zero is an interior vertex, one bit a vertex of
//! that boundary curve, several bits a corner where curves meet.

use super::clean::{compact, pieces};
use super::triangle::triangle_normal;
use clothcombo_physics::vec3::{add, norm, scale, sub};
use std::collections::HashMap;

/// Triangle soup with labels, the form in which surfaces are clipped.
#[derive(Debug, Clone, Default)]
pub struct LabelledTriangles {
    /// Vertices `[V, 3]` (m).
    pub positions: Vec<[f64; 3]>,
    /// Label of each vertex.
    pub labels: Vec<u32>,
    /// Triangles.
    pub faces: Vec<[u32; 3]>,
}

impl LabelledTriangles {
    /// Keeps the part where `field ≥ 0`, cutting triangles where the linear interpolation of the field vanishes. New
    /// vertices get `bit`, and keep the bits of the boundary curve they split.
    pub fn clip(&self, field: impl Fn([f64; 3]) -> f64, bit: u32) -> Self {
        // An exact zero would make a vertex belong to both sides; a micrometre of offset does not matter.
        let values: Vec<f64> = self
            .positions
            .iter()
            .map(|p| {
                let value = field(*p);
                if value.abs() < 1e-9 { 1e-9 } else { value }
            })
            .collect();
        let mut boundary_edges: HashMap<[u32; 2], u32> = HashMap::new();
        for face in &self.faces {
            for corner in 0..3 {
                let [a, b] = [face[corner], face[(corner + 1) % 3]];
                if self.labels[a as usize] & self.labels[b as usize] != 0 {
                    *boundary_edges.entry([a.min(b), a.max(b)]).or_default() += 1;
                }
            }
        }
        let mut result = Self::default();
        let mut kept = vec![u32::MAX; self.positions.len()];
        for (v, value) in values.iter().enumerate() {
            if *value > 0.0 {
                kept[v] = result.positions.len() as u32;
                result.positions.push(self.positions[v]);
                result.labels.push(self.labels[v]);
            }
        }
        let mut crossing: HashMap<[u32; 2], u32> = HashMap::new();
        for face in &self.faces {
            let inside = face.map(|v| values[v as usize] > 0.0);
            let count = inside.iter().filter(|b| **b).count();
            if count == 0 {
                continue;
            }
            if count == 3 {
                result.faces.push(face.map(|v| kept[v as usize]));
                continue;
            }
            // Rotate so that corner 0 is the odd one out.
            let odd = (0..3).find(|c| inside[*c] == (count == 1)).unwrap_or(0);
            let [a, b, c] = [face[odd], face[(odd + 1) % 3], face[(odd + 2) % 3]];
            let mut cut = |a: u32, b: u32| -> u32 {
                let key = [a.min(b), a.max(b)];
                *crossing.entry(key).or_insert_with(|| {
                    let [a, b] = key.map(|v| v as usize);
                    let t = (values[a] / (values[a] - values[b])).clamp(0.01, 0.99);
                    let curve = if boundary_edges.get(&key) == Some(&1) {
                        self.labels[a] & self.labels[b]
                    } else {
                        0
                    };
                    result
                        .positions
                        .push(add(self.positions[a], scale(sub(self.positions[b], self.positions[a]), t)));
                    result.labels.push(bit | curve);
                    result.positions.len() as u32 - 1
                })
            };
            let (ab, ac) = (cut(a, b), cut(a, c));
            if count == 1 {
                result.faces.push([kept[a as usize], ab, ac]);
            } else {
                result.faces.push([ab, kept[b as usize], kept[c as usize]]);
                result.faces.push([ab, kept[c as usize], ac]);
            }
        }
        result
    }

    /// The connected component with the largest area, vertices renumbered.
    pub fn largest_component(&self) -> Self {
        let mut components = pieces(&self.faces, self.positions.len());
        let mut area = vec![0.0; self.positions.len()];
        for face in &self.faces {
            area[components.root(face[0]) as usize] += norm(self.normal(*face));
        }
        let Some(best) = (0..area.len()).max_by(|a, b| area[*a].total_cmp(&area[*b])) else {
            return Self::default();
        };
        let in_best = self.faces.iter().copied().filter(|f| components.root(f[0]) as usize == best);
        let (used, faces) = compact(in_best, self.positions.len());
        let used = || used.iter().map(|v| *v as usize);
        Self {
            positions: used().map(|v| self.positions[v]).collect(),
            labels: used().map(|v| self.labels[v]).collect(),
            faces,
        }
    }

    /// Surface area (m²).
    pub fn area(&self) -> f64 {
        self.faces.iter().map(|face| 0.5 * norm(self.normal(*face))).sum()
    }

    /// Unnormalised normal (twice the area) of a face.
    fn normal(&self, face: [u32; 3]) -> [f64; 3] {
        triangle_normal(face.map(|v| self.positions[v as usize]))
    }
}
