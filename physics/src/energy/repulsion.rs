//! Repulsion: vertices of one garment that come close repel each other (paper, equation for L_r).
//!
//! `Σ −log d²` over unordered pairs of vertices that no edge joins and that are closer than a radius. The paper's weights
//! and magnitudes need this sum divided by the number of vertices, which is the default; the printed form is a switch.
//!
//! **Near d = 0** the logarithm has no value. Below [`CONTACT_DISTANCE`] it continues as the line in `d²` that touches
//! it there, `−log δ² + 1 − d²/δ²`: continuously differentiable, bounded, gradient at most `2/δ`; two vertices at one
//! point have no direction to part in and get none from each other. **At the radius** the printed term jumps from 4.6
//! to 0; this is kept, and the gradient is that of the pairs inside. [`EnergySettings::repulsion_continuous`] drops the
//! jump without touching the gradient: pairs inside count `−log d²/r²`. Training, which follows gradients, cannot tell
//! the two forms apart; a line search can, because in the printed form every pair that comes closer than the radius
//! stops it.
//!
//! **No all-pairs work.** Vertices are sorted into cells of half or a quarter of the radius; those of one cell share a list of
//! candidates, which the inner loop runs through in fixed lanes, with the widest vectors the processor has (the operations
//! and their order are the same for all of them, and so are the results). `Σ log d²` is the logarithm of a product, kept as
//! mantissa and exponent: one logarithm per vertex. Pairs joined by an edge are not looked for inside that loop but
//! subtracted after it. What grows is the number of pairs within the radius: at a fixed edge length it is proportional to
//! `N`, for a fixed garment that is resolved more finely to `N²`; the random subset is proportional to `N` always.

use rayon::prelude::*;

use super::cell_grid::CellGrid;
use super::elements::GRAIN;
use super::pair_kernel::{Candidates, Kernel, VertexResponse};
use super::{EnergySettings, GarmentState, GarmentTerm, Weighted};
use crate::mesh::Topology;
use crate::mesh::shapes::SplitMix;
use crate::real::Real;
use crate::rows::CompressedRows;
use crate::vec3::{axpy, sub, zero};

pub use super::pair_kernel::CONTACT_DISTANCE;

/// The repulsion energy of one garment; radius, form and subset are settings of the scene.
#[derive(Debug, Clone)]
pub struct Repulsion {
    /// Per vertex those that do not count: itself and its neighbours.
    excluded: CompressedRows<u32>,
}

impl Repulsion {
    /// For a garment with this topology.
    pub fn new(topology: &Topology) -> Self {
        let excluded = |v| topology.ring(v).iter().copied().chain([v as u32]);
        Self { excluded: CompressedRows::from_fn(topology.vertex_count(), excluded) }
    }

    /// Energy at `positions` `[V, 3]` (m) by the `repulsion_…` of `settings`; adds its weighted gradient to `target`. A vertex
    /// that is not finite repels nothing.
    pub fn evaluate<T: Real>(
        &self,
        positions: &[[T; 3]],
        settings: &EnergySettings,
        target: Option<Weighted<'_, T>>,
    ) -> f64 {
        let (count, radius) = (positions.len(), settings.repulsion_radius);
        // Squared lengths in units of the squared radius have no logarithm there.
        let unit = if settings.repulsion_continuous { 1.0 / (radius * radius) } else { 1.0 };
        let kernel = Kernel::<T>::new(radius, unit);
        // On the sum over unordered pairs.
        let mut factor = if settings.repulsion_normalised { 1.0 / count.max(1) as f64 } else { 1.0 };
        let (twice, responses) = match settings.repulsion_subset {
            // Otherwise every vertex would meet every other one: nothing is saved.
            Some(reach) if 2 * reach + 1 < count => {
                // Of the N−1 others a vertex meets `2·reach`.
                factor *= (count - 1) as f64 / (2 * reach) as f64;
                let sample = PairSample::new(settings.repulsion_sample, count, reach);
                sampled_pairs(positions, &self.excluded, &sample, kernel)
            }
            _ => all_pairs(positions, &self.excluded, kernel),
        };
        if let Some(target) = target {
            let weight = T::from_f64(target.weight * factor);
            for (v, pull) in responses {
                axpy(&mut target.gradient[v as usize], weight, pull);
            }
        }
        // Every pair was met from both ends.
        0.5 * factor * twice
    }
}

impl<T: Real> GarmentTerm<T> for Repulsion {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.posed, state.settings, target)
    }
}

/// A random sample of pairs: all vertices on a circle in random order, each with the nearest ones on both sides. Every vertex
/// meets equally many, no pair comes twice, and over the samples each pair is as likely as any other.
struct PairSample {
    circle: Vec<u32>,
    place: Vec<u32>,
    reach: usize,
}

impl PairSample {
    fn new(number: u32, count: usize, reach: usize) -> Self {
        let mut random = SplitMix::new(u64::from(number));
        let mut circle: Vec<u32> = (0..count as u32).collect();
        for last in (1..count).rev() {
            // Uniform over the places up to `last`: multiply-shift keeps the bias below 2⁻³².
            let other = ((u128::from(random.next_u64()) * (last + 1) as u128) >> 64) as usize;
            circle.swap(last, other);
        }
        let mut place = vec![0; count];
        for (i, &v) in circle.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        Self { circle, place, reach }
    }

    fn partners(&self, v: usize) -> impl Iterator<Item = u32> {
        let (count, place) = (self.circle.len(), self.place[v] as usize);
        let both = (1..=self.reach).flat_map(move |k| [place + k, place + count - k]);
        both.map(move |at| self.circle[at % count])
    }
}

/// Twice the sum over close pairs and, per vertex, its derivative.
fn all_pairs<T: Real>(
    positions: &[[T; 3]],
    excluded: &CompressedRows<u32>,
    kernel: Kernel<T>,
) -> (f64, Vec<(u32, [T; 3])>) {
    let grid = CellGrid::new(positions, kernel.radius);
    let per_cell: Vec<Vec<VertexResponse<T>>> = (0..grid.cell_count())
        .into_par_iter()
        .map_init(Candidates::default, |candidates, cell| {
            candidates.clear();
            grid.for_each_range_around(cell, |range| candidates.extend(&grid.axes, range));
            candidates.pad();
            let points = &grid.points[grid.range(cell)];
            let mut responses = kernel.all(points, candidates);
            for ((k, &p), (energy, pull)) in grid.range(cell).zip(points).zip(&mut responses) {
                let neighbours = excluded.row(grid.order[k] as usize);
                let (e, g) = kernel.few(p, neighbours.iter().map(|&v| positions[v as usize]));
                *energy -= e;
                *pull = sub(*pull, g);
                // Less than half a pair: no pair at all, and what is left is the rounding of those subtracted.
                if energy.abs() < 0.5 * kernel.least_energy {
                    (*energy, *pull) = (0.0, zero());
                }
            }
            responses
        })
        .collect();
    let responses = per_cell.iter().flatten();
    let twice = responses.clone().map(|(energy, _)| energy).sum();
    (twice, grid.order.iter().copied().zip(responses.map(|(_, pull)| *pull)).collect())
}

/// The same over the pairs of `sample`.
fn sampled_pairs<T: Real>(
    positions: &[[T; 3]],
    excluded: &CompressedRows<u32>,
    sample: &PairSample,
    kernel: Kernel<T>,
) -> (f64, Vec<(u32, [T; 3])>) {
    let response = |v: usize| {
        let counts = |partner: &u32| !excluded.row(v).contains(partner);
        kernel.few(positions[v], sample.partners(v).filter(counts).map(|partner| positions[partner as usize]))
    };
    let responses: Vec<VertexResponse<T>> =
        (0..positions.len()).into_par_iter().with_min_len(GRAIN / 8).map(response).collect();
    let twice = responses.iter().map(|(energy, _)| energy).sum();
    (twice, responses.into_iter().enumerate().map(|(v, (_, pull))| (v as u32, pull)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn in_a_sample_every_vertex_meets_equally_many_and_each_of_them_once() {
        for (count, reach) in [(9, 4), (10, 4), (57, 8)] {
            let sample = PairSample::new(3, count, reach);
            for v in 0..count {
                let mut partners: Vec<u32> = sample.partners(v).collect();
                for &partner in &partners {
                    assert!(partner != v as u32 && sample.partners(partner as usize).any(|p| p == v as u32));
                }
                partners.sort_unstable();
                partners.dedup();
                assert_eq!(partners.len(), 2 * reach);
            }
        }
        assert!(PairSample::new(3, 57, 8).circle != PairSample::new(4, 57, 8).circle);
    }
}
