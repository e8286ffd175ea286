//! Garments put in order before they are draped: over every vertex of the body, the outer one lies higher.
//!
//! Garments that were each made on the bare body cross where they lie over each other. Sorted by height over the body, the least
//! squares answer moves the inner one down and the outer one up to where they meet: isotonic regression, by pooling adjacent
//! violators (Ayer et al. 1955). It depends on the rest garments alone, so that no pose and no shape changes it.

use super::body::Body;
use super::footprint::Footprint;

/// Displacements (m) of garments, inner → outer, `[V]` each, that put them `spacing` (m) apart, or farther, in their order over every
/// vertex of the body, fading at hems. Along the normals of the zero body; zero where nothing is out of order.
pub fn order_layers(footprints: &[&Footprint], body: &Body, spacing: f64) -> Vec<Vec<[f32; 3]>> {
    let chart = body.chart();
    let mut moves = vec![vec![0.0_f32; body.vertex_count()]; footprints.len()];
    let (mut over, mut heights) = (Vec::new(), Vec::new());
    for b in 0..body.vertex_count() {
        over.clear();
        heights.clear();
        for (garment, footprint) in footprints.iter().enumerate() {
            if let Some(height) = footprint.height[b] {
                heights.push(f64::from(height) - spacing * over.len() as f64);
                over.push(garment);
            }
        }
        if over.len() < 2 {
            continue;
        }
        let ordered = isotonic_regression(&heights);
        for ((garment, to), from) in over.iter().zip(ordered).zip(&heights) {
            moves[*garment][b] = (to - from) as f32;
        }
    }
    let displaced = |(footprint, mut moves): (&&Footprint, Vec<f32>)| {
        if moves.iter().any(|by| *by != 0.0) {
            chart.fade(&mut moves);
        }
        let along = |&b: &u32| chart.normals[b as usize].map(|n| n as f32 * moves[b as usize]);
        footprint.nearest.iter().map(along).collect()
    };
    footprints.iter().zip(moves).map(displaced).collect()
}

/// The nondecreasing sequence nearest to `values` in the sum of squares.
fn isotonic_regression(values: &[f64]) -> Vec<f64> {
    // Pools of neighbours that share their mean: (mean, number).
    let mut pools: Vec<(f64, usize)> = Vec::with_capacity(values.len());
    for &value in values {
        let mut pool = (value, 1);
        while let Some((mean, count)) = pools.pop_if(|below| below.0 > pool.0) {
            let total = count + pool.1;
            pool = ((mean * count as f64 + pool.0 * pool.1 as f64) / total as f64, total);
        }
        pools.push(pool);
    }
    pools.into_iter().flat_map(|(mean, count)| std::iter::repeat_n(mean, count)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::footprint::tests::band;
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::vec3::norm;

    /// Max–min formula of isotonic regression (Robertson, Wright, Dykstra 1988, theorem 1.4.4).
    fn by_means(values: &[f64]) -> Vec<f64> {
        let mean = |i: usize, j: usize| values[i..=j].iter().sum::<f64>() / (j - i + 1) as f64;
        let n = values.len();
        let lowest = |i: usize, k: usize| (k..n).map(|j| mean(i, j)).fold(f64::MAX, f64::min);
        (0..n).map(|k| (0..=k).map(|i| lowest(i, k)).fold(f64::MIN, f64::max)).collect()
    }

    #[test]
    fn pooling_gives_the_isotonic_regression() {
        let mut state = 7_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        };
        for round in 0..300 {
            let values: Vec<f64> = (0..round % 9).map(|_| next()).collect();
            let fitted = isotonic_regression(&values);
            assert!(fitted.iter().zip(by_means(&values)).all(|(a, b)| (a - b).abs() < 1e-12), "{values:?}");
        }
        assert_eq!(isotonic_regression(&[1.0, 2.0, 2.0]), [1.0, 2.0, 2.0]);
    }

    #[test]
    fn what_is_in_order_stays_and_what_is_not_meets_half_way() {
        let body = mannequin();
        let hips = body.joint_place("pelvis").unwrap()[1];
        let [narrow, wide] = [0.2, 0.24].map(|radius| band(radius, hips - 0.2, hips + 0.2));
        let [below, above] = [&narrow, &wide].map(|garment| Footprint::new(garment, &body));
        let still = order_layers(&[&below, &above], &body, 0.004);
        assert!(still.iter().flatten().all(|by| *by == [0.0; 3]));

        let moved = order_layers(&[&above, &below], &body, 0.004);
        let mut met = 0;
        for (garment, by) in [&wide, &narrow].into_iter().zip(&moved) {
            for (p, by) in garment.rest.positions().iter().zip(by) {
                let height = p[1] - hips;
                if !(-0.1..0.1).contains(&height) {
                    continue;
                }
                // Where the body faces the tubes, the gap of 4 cm closes from both sides, and 4 mm more.
                let [from, to] =
                    [*p, std::array::from_fn(|k| p[k] + f64::from(by[k]))].map(|p| p[0].hypot(p[2]));
                let outwards = to - from;
                assert!(if from > 0.22 { outwards < 0.0 } else { outwards > 0.0 }, "{from} by {outwards}");
                met += usize::from((outwards.abs() - 0.022).abs() < 0.004);
                assert!(norm(by.map(f64::from)) < 0.04);
            }
        }
        assert!(met > 100, "{met}");
    }
}
