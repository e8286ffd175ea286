//! Neighbours of every vertex of a garment, and means over them.

use rayon::prelude::*;

use crate::mesh::Topology;

/// The neighbours of every vertex, one and two edges away.
#[derive(Debug, Clone)]
pub struct Rings {
    one: Lists,
    two: Lists,
}

/// A list for every vertex, one after the other.
#[derive(Debug, Clone, Default)]
struct Lists {
    ends: Vec<u32>,
    vertices: Vec<u32>,
}

impl Lists {
    fn push(&mut self, list: impl IntoIterator<Item = u32>) {
        self.vertices.extend(list);
        self.ends.push(self.vertices.len() as u32);
    }

    fn of(&self, v: usize) -> &[u32] {
        let start = v.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.vertices[start as usize..self.ends[v] as usize]
    }
}

impl Rings {
    /// Of a garment with this topology.
    pub fn new(topology: &Topology) -> Self {
        let (mut one, mut two) = (Lists::default(), Lists::default());
        for v in 0..topology.vertex_count() {
            let ring = topology.ring(v);
            one.push(ring.iter().copied());
            let mut patch: Vec<u32> = ring.iter().flat_map(|&n| topology.ring(n as usize)).copied().collect();
            patch.extend_from_slice(ring);
            patch.push(v as u32);
            patch.sort_unstable();
            patch.dedup();
            two.push(patch);
        }
        Self { one, two }
    }

    /// `v` itself and the vertices one and two edges away, ascending.
    pub(super) fn patch(&self, v: u32) -> &[u32] {
        self.two.of(v as usize)
    }

    /// Half of every vertex's own values and half of the mean of its neighbours'; a constant stays what it is.
    pub(super) fn averaged<const N: usize>(&self, values: &[[f64; N]]) -> Vec<[f64; N]> {
        let mean = |v: usize| {
            let ring = self.one.of(v);
            if ring.is_empty() {
                return values[v];
            }
            let mut sum = [0.0; N];
            for &n in ring {
                sum.iter_mut().zip(&values[n as usize]).for_each(|(s, x)| *s += x);
            }
            let share = 0.5 / ring.len() as f64;
            std::array::from_fn(|k| 0.5 * values[v][k] + share * sum[k])
        };
        (0..values.len()).into_par_iter().with_min_len(128).map(mean).collect()
    }
}
