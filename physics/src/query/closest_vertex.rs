//! Nearest vertex, on a kd-tree.

use crate::real::Real;
use crate::vec3;

/// A fixed set of points `[N, 3]` (m), ready for nearest-point queries.
#[derive(Debug)]
pub struct VertexIndex<T: Real> {
    tree: Option<T::Tree>,
    /// Original indices of the points in the tree, when some had to be left out.
    kept: Option<Vec<u32>>,
}

impl<T: Real> VertexIndex<T> {
    /// Builds the index in O(N log N). Points with a NaN or infinite coordinate are never found.
    pub fn new(points: &[[T; 3]]) -> Self {
        if points.iter().all(|p| can_be_found(*p)) {
            return Self { tree: T::build_tree(points), kept: None };
        }
        let kept: Vec<u32> = (0..points.len() as u32).filter(|&i| can_be_found(points[i as usize])).collect();
        let finite: Vec<[T; 3]> = kept.iter().map(|&i| points[i as usize]).collect();
        Self { tree: T::build_tree(&finite), kept: Some(kept) }
    }

    /// Index of the point nearest to `p` and its squared distance (m²); the lowest index of several equally near.
    ///
    /// A `p` that is not finite has no nearest point: the answer is then any valid index and a NaN distance, so that a run
    /// that diverged shows NaN instead of ending here. Without any finite point the answer is `(u32::MAX, ∞)`.
    pub fn nearest(&self, p: [T; 3]) -> (u32, T) {
        let Some(tree) = &self.tree else { return (u32::MAX, T::infinity()) };
        if !vec3::is_finite(p) {
            return (self.original(0), T::nan());
        }
        let (mut item, distance) = T::nearest(tree, p);
        // Points that tie are met in tree order; a second look inside the found radius makes the answer independent of it.
        T::visit_within(tree, p, distance, |other| item = item.min(other));
        (self.original(item), distance)
    }

    fn original(&self, item: u32) -> u32 {
        self.kept.as_ref().map_or(item, |kept| kept[item as usize])
    }
}

/// The tree keeps the largest finite value for itself, as padding.
fn can_be_found<T: Real>(point: [T; 3]) -> bool {
    point.iter().all(|x| x.abs() < T::max_value())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::brute_force;

    fn random_points<T: Real>(count: usize, extent: f64, seed: u64) -> Vec<[T; 3]> {
        let mut random = SplitMix::new(seed);
        (0..count).map(|_| std::array::from_fn(|_| T::from_f64(extent * random.symmetric()))).collect()
    }

    /// The query against exhaustive search, bit for bit.
    fn agree<T: Real>(points: &[[T; 3]], queries: &[[T; 3]]) {
        let index = VertexIndex::new(points);
        for &p in queries {
            assert_eq!(index.nearest(p), brute_force::nearest(points, p));
        }
    }

    #[test]
    fn equals_brute_force_in_both_precisions() {
        for (count, seed) in [(1, 1), (2, 2), (31, 3), (33, 4), (700, 5), (5000, 6)] {
            agree::<f32>(&random_points(count, 1.0, seed), &random_points(200, 1.3, seed + 100));
            agree::<f64>(&random_points(count, 1.0, seed), &random_points(200, 1.3, seed + 100));
        }
    }

    #[test]
    fn exact_ties_go_to_the_lowest_index() {
        // Lattices queried at cell centres and corners: up to eight points tie exactly.
        let lattice: Vec<[f32; 3]> =
            (0..1728).map(|i| [(i % 12) as f32, (i / 12 % 12) as f32, (i / 144) as f32]).collect();
        let centres: Vec<[f32; 3]> = lattice.iter().map(|p| p.map(|x| x + 0.5)).collect();
        agree(&lattice, &centres);
        agree(&lattice, &lattice);
        let mirrored: Vec<[f32; 3]> = lattice.iter().rev().copied().collect();
        agree(&mirrored, &centres);
    }

    #[test]
    fn survives_many_identical_points_and_planes() {
        let queries = random_points::<f32>(40, 1.0, 8);
        agree(&vec![[0.25f32, -0.5, 0.75]; 10_000], &queries);
        // A plane: 10,000 equal coordinates on one axis. A line: on two.
        let plane: Vec<[f32; 3]> =
            shapes::grid(1.0, 1.0, 99, 99).positions().iter().map(|p| p.map(|x| x as f32)).collect();
        agree(&plane, &queries);
        let line: Vec<[f32; 3]> = plane.iter().map(|p| [p[0], 0.0, 0.0]).collect();
        agree(&line, &queries);
        // Half of the points in one place, the rest spread out.
        let mut mixed = random_points::<f32>(3000, 1.0, 9);
        mixed.extend(vec![[0.1f32, 0.1, 0.1]; 3000]);
        agree(&mixed, &queries);
    }

    #[test]
    fn huge_and_tiny_coordinates() {
        for extent in [1e-6, 1e6] {
            let points = random_points::<f32>(2000, extent, 12);
            agree(&points, &random_points(100, extent, 13));
        }
        // Squared distances overflow: any answer, but a valid one.
        let index = VertexIndex::new(&random_points::<f32>(100, 1e30, 17));
        assert!(index.nearest([-1e30, 1e30, 0.0]).0 < 100);
        let index = VertexIndex::new(&[[f32::MAX; 3], [1.0, 2.0, 3.0], [f32::MIN, 0.0, 0.0]]);
        assert_eq!(index.nearest([1.0, 2.0, 4.0]), (1, 1.0));
    }

    #[test]
    fn points_that_are_not_finite_are_never_found() {
        let mut points = random_points::<f64>(500, 1.0, 14);
        for i in (0..500).step_by(7) {
            points[i][i % 3] = if i % 2 == 0 { f64::NAN } else { f64::INFINITY };
        }
        agree(&points, &random_points(100, 1.0, 15));
    }

    #[test]
    fn queries_without_an_answer() {
        let index = VertexIndex::new(&random_points::<f32>(50, 1.0, 16));
        let (item, distance) = index.nearest([f32::NAN, 0.0, 0.0]);
        assert!(item < 50 && distance.is_nan());
        let empty = VertexIndex::<f32>::new(&[]);
        assert_eq!(empty.nearest([0.0; 3]), (u32::MAX, f32::INFINITY));
    }
}
