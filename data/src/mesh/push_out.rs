//! Moves a garment that starts inside the body to its outside, smoothly.

use clothcombo_physics::query::{Distance, Surface};
use clothcombo_physics::vec3::{add, add_scaled, scale};
use rayon::prelude::*;

/// How far inside, how often.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyClearance {
    /// Vertices inside the body.
    pub inside: usize,
    /// Smallest gap of a vertex (m).
    pub least_gap: f64,
}

/// Signed distance of every point to the closest point of a body (m), positive outside.
pub fn gaps_to(points: &[[f64; 3]], body: &Surface<f64>) -> Vec<f64> {
    // Built before it is shared.
    body.closest_point();
    points.par_iter().with_min_len(64).map(|p| body.gap(*p, Distance::ClosestPoint).gap).collect()
}

/// How a mesh lies to a body.
pub fn contact(positions: &[[f64; 3]], body: &Surface<f64>) -> BodyClearance {
    let gaps = gaps_to(positions, body);
    BodyClearance {
        inside: gaps.iter().filter(|g| **g < 0.0).count(),
        least_gap: gaps.into_iter().fold(f64::MAX, f64::min),
    }
}

/// Pushes vertices along the body's normal until every vertex is `clearance` (m) away and no face centre touches the body. The
/// displacement is smoothed over the garment, so that its neighbourhood comes along instead of leaving a dent.
pub fn push_out(positions: &mut [[f64; 3]], faces: &[[u32; 3]], body: &Surface<f64>, clearance: f64) {
    let rings = one_rings(positions.len(), faces);
    const PUSH_ROUNDS: usize = 40;
    for round in 0..PUSH_ROUNDS {
        let mut displacement: Vec<[f64; 3]> =
            positions.par_iter().map(|p| missing(*p, clearance, body)).collect();
        // Face centres: a large triangle can cut a bulge while its corners are outside.
        let centres: Vec<[f64; 3]> = faces
            .par_iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| positions[v as usize]);
                missing(scale(add(add(a, b), c), 1.0 / 3.0), 0.6 * clearance, body)
            })
            .collect();
        for (f, d) in faces.iter().zip(centres) {
            if d != [0.0; 3] {
                for v in f {
                    // The largest wish counts; summing would overshoot by the valence.
                    let own = &mut displacement[*v as usize];
                    for a in 0..3 {
                        if d[a].abs() > own[a].abs() {
                            own[a] = d[a];
                        }
                    }
                }
            }
        }
        if displacement.iter().all(|d| *d == [0.0; 3]) {
            return;
        }
        // Wide smoothing first, exact pushes last.
        let smoothing = if round < PUSH_ROUNDS / 4 {
            8
        } else if round < PUSH_ROUNDS / 2 {
            2
        } else {
            0
        };
        let exact = displacement.clone();
        for _ in 0..smoothing {
            displacement = displacement
                .iter()
                .zip(&rings)
                .map(|(d, ring)| {
                    let share = 0.5 / ring.len().max(1) as f64;
                    ring.iter()
                        .fold(scale(*d, 0.5), |sum, n| add_scaled(sum, share, displacement[*n as usize]))
                })
                .collect();
        }
        for ((p, d), e) in positions.iter_mut().zip(&displacement).zip(&exact) {
            // Smoothing thins single pushes out: add half of what was asked for.
            let d = if smoothing > 0 { add_scaled(*d, 0.5, *e) } else { *e };
            *p = add(*p, d);
        }
    }
}

/// The step that brings a point to `clearance` outside the body; zero if it is.
fn missing(p: [f64; 3], clearance: f64, body: &Surface<f64>) -> [f64; 3] {
    let gap = body.gap(p, Distance::ClosestPoint);
    // A little more than needed, so that rounding does not ask for another round.
    if gap.gap < clearance { scale(gap.gradient, clearance * 1.02 - gap.gap) } else { [0.0; 3] }
}

/// The neighbours of every vertex, ascending.
pub fn one_rings(vertices: usize, faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut rings: Vec<Vec<u32>> = vec![Vec::new(); vertices];
    for f in faces {
        for i in 0..3 {
            rings[f[i] as usize].extend([f[(i + 1) % 3], f[(i + 2) % 3]]);
        }
    }
    for ring in &mut rings {
        ring.sort_unstable();
        ring.dedup();
    }
    rings
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLEARANCE: f64 = 0.004;
    use clothcombo_physics::mesh::shapes::{icosphere, tube};

    #[test]
    fn a_belt_partly_inside_a_ball_comes_out_and_what_was_outside_stays() {
        let ball = Surface::from_mesh(&icosphere(0.2, 4));
        let belt = tube(0.199, 0.2, 48, 16);
        let mut positions = belt.positions().to_vec();
        assert!(contact(&positions, &ball).inside > 0);
        push_out(&mut positions, belt.faces(), &ball, CLEARANCE);
        let after = contact(&positions, &ball);
        assert_eq!(after.inside, 0);
        assert!(after.least_gap > 0.9 * CLEARANCE, "{after:?}");
        let moved =
            |v: usize| (0..3).map(|a| (positions[v][a] - belt.positions()[v][a]).powi(2)).sum::<f64>().sqrt();
        assert!((0..positions.len()).all(|v| moved(v) < 0.03));

        let far = tube(0.5, 0.2, 16, 4);
        let mut same = far.positions().to_vec();
        push_out(&mut same, far.faces(), &ball, CLEARANCE);
        assert_eq!(same, far.positions());
    }
}
