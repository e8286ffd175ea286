//! Neighbours of every vertex of a garment, and means over them.

use rayon::prelude::*;

use crate::mesh::Topology;
use crate::rows::CompressedRows;

/// The neighbours of every vertex, one and two edges away.
#[derive(Debug, Clone)]
pub struct Rings {
    one: CompressedRows<u32>,
    two: CompressedRows<u32>,
}

impl Rings {
    /// Of a garment with this topology.
    pub fn new(topology: &Topology) -> Self {
        let patch = |v: usize| {
            let ring = topology.ring(v);
            let mut patch: Vec<u32> = ring.iter().flat_map(|&n| topology.ring(n as usize)).copied().collect();
            patch.extend_from_slice(ring);
            patch.push(v as u32);
            patch.sort_unstable();
            patch.dedup();
            patch
        };
        let count = topology.vertex_count();
        let one = CompressedRows::from_fn(count, |v| topology.ring(v).iter().copied());
        Self { one, two: CompressedRows::from_fn(count, patch) }
    }

    /// `v` itself and the vertices one and two edges away, ascending.
    pub(super) fn patch(&self, v: u32) -> &[u32] {
        self.two.row(v as usize)
    }

    /// Half of every vertex's own values and half of the mean of its neighbours'; a constant stays what it is.
    pub(super) fn averaged<const N: usize>(&self, values: &[[f64; N]]) -> Vec<[f64; N]> {
        let mean = |v: usize| {
            let ring = self.one.row(v);
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
