//! The shape of one body model that looks most like another body.
//!
//! Shape numbers mean something in the space of their model only. What two models share is the surface in T-pose: the shape is
//! found whose surface lies closest to the other one, by iterated closest points with point-to-plane distances.

use super::body::Body;
use super::normal_equations::NormalEquations;
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{dot, sub};
use std::sync::Arc;

/// Rounds of closest points.
const ROUNDS: usize = 8;
/// Vertices looked at.
const SAMPLES: usize = 2000;
/// Closest points that are farther away are on another part of the body (m).
const REACH: f64 = 0.1;
/// A distance (m) that counts as much, on average over the vertices, as a shape number of 1 does with [`PRIOR`].
const TOLERANCE: f64 = 0.01;
/// Weight of small shape numbers: decides only what the surface leaves open.
const PRIOR: f64 = 0.02;

/// A shape that looks like another body.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeMatch {
    /// Shape parameters β `[K]`.
    pub shape: Vec<f64>,
    /// Mean distance of its surface to that of the other body (m).
    pub mean_distance: f64,
}

/// The shape of `body`, with numbers in `range`, that looks most like the surface `positions` `[V, 3]` (m) with
/// `faces`: a body in T-pose, its pelvis at the origin.
pub fn match_shape(
    body: &Body,
    range: [f64; 2],
    positions: Vec<[f64; 3]>,
    faces: Arc<[[u32; 3]]>,
) -> ShapeMatch {
    let target = Surface::new(positions, faces);
    let k = body.shape_count;
    let step = body.vertex_count().div_ceil(SAMPLES).max(1);
    let mut shape = vec![0.0; k];
    let mut mean_distance = f64::INFINITY;
    for round in 0..=ROUNDS {
        let surface: Vec<[f64; 3]> = (0..body.vertex_count())
            .step_by(step)
            .map(|v| {
                std::array::from_fn(|a| {
                    let row = &body.shape_directions[(3 * v + a) * k..(3 * v + a + 1) * k];
                    body.template[v][a] + row.iter().zip(&shape).map(|(d, b)| f64::from(*d) * b).sum::<f64>()
                })
            })
            .collect();
        let closest: Vec<_> =
            surface.iter().map(|p| target.closest_point().project_within(*p, REACH)).collect();
        let distances =
            closest.iter().map(|found| found.as_ref().map_or(REACH, |f| f.distance_squared.sqrt()));
        mean_distance = distances.sum::<f64>() / surface.len().max(1) as f64;
        if k == 0 || round == ROUNDS {
            break;
        }
        let mut equations = NormalEquations::new(k);
        let mut count = 0.0;
        for (sample, found) in closest.iter().enumerate() {
            let Some(found) = found else { continue };
            let v = sample * step;
            let row: Vec<f64> = (0..k)
                .map(|i| {
                    let direction =
                        std::array::from_fn(|a| f64::from(body.shape_directions[(3 * v + a) * k + i]));
                    dot(found.normal, direction)
                })
                .collect();
            // Where the plane would have the template: the shape is solved for anew in every round.
            equations.add(&row, dot(found.normal, sub(found.position, body.template[v])));
            count += 1.0;
        }
        let prior = PRIOR * TOLERANCE * TOLERANCE * f64::max(count, 1.0);
        let Some(solution) = equations.solution(|_| prior) else { break };
        shape = solution.into_iter().map(|x| x.clamp(range[0], range[1])).collect();
    }
    ShapeMatch { shape, mean_distance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;

    #[test]
    fn the_shape_of_a_body_of_the_same_model_is_found() {
        let body = mannequin();
        let beta: Vec<f64> = (0..body.shape_count).map(|i| [1.2, -0.8, 0.5][i % 3]).collect();
        let shaped = body.shaped(&beta).unwrap().positions;
        let found = match_shape(&body, [-2.0, 2.0], shaped.clone(), body.faces.clone());
        let own = body.shaped(&found.shape).unwrap().positions;
        let mean = own.iter().zip(&shaped).map(|(a, b)| dot(sub(*a, *b), sub(*a, *b)).sqrt()).sum::<f64>()
            / shaped.len() as f64;
        assert!(mean < 0.004 && found.mean_distance < 0.004, "{mean} {found:?}");
        // The mean body is the mean shape, and numbers stay in the range.
        let mean = match_shape(&body, [-2.0, 2.0], body.template.clone(), body.faces.clone());
        assert!(mean.shape.iter().all(|b| b.abs() < 0.05), "{mean:?}");
        let narrow = match_shape(&body, [-0.1, 0.1], shaped, body.faces.clone());
        assert!(narrow.shape.iter().all(|b| b.abs() <= 0.1));
    }

    #[test]
    fn a_body_without_shapes_has_one() {
        let body = mannequin().with_shape_components(0);
        let found = match_shape(&body, [-2.0, 2.0], body.template.clone(), body.faces.clone());
        assert!(found.shape.is_empty() && found.mean_distance < 1e-6, "{found:?}");
    }
}
