//! The shape of the target's model, in a pose of its limbs, that lies closest to a mesh of a person.

use super::icp::Similarity;
use crate::asset::{Body, NormalEquations, rotation};
use crate::fit::limb_pose::LimbPose;
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{add, cross, dot, sub};
use rayon::prelude::*;

/// Shape parameters of people lie within this.
const LARGEST_SHAPE: f64 = 3.0;
/// Vertices looked at.
const SHAPE_SAMPLES: usize = 2500;
/// Closest points farther away (m) are on another part of the body.
const SHAPE_REACH: f64 = 0.08;
/// Weight of small shape numbers against a distance of 1 cm of all samples.
const SMALL_SHAPE: f64 = 0.02;
/// Share of the samples that have a say.
const SHAPE_SHARE: f64 = 0.85;

impl LimbPose {
    /// The shape in the same pose that lies closest to `mesh`, which `motion` brings here, and the motion that goes
    /// with it, of the same scale: one Gauss–Newton step, since for a given pose vertices are linear in the shape. None
    /// where the body has one shape only.
    ///
    /// # Errors
    /// As [`LimbPose::new`].
    pub(super) fn closer_shape(
        &self,
        body: &Body,
        mesh: &Surface<f64>,
        motion: &Similarity,
    ) -> Result<Option<(Vec<f64>, Similarity)>, String> {
        let k = body.shape_count;
        if k == 0 {
            return Ok(None);
        }
        let step = body.vertex_count().div_ceil(SHAPE_SAMPLES).max(1);
        let start = Self::new(body, &[], self.angles)?.positions;
        let mut directions: Vec<Vec<[f64; 3]>> = Vec::with_capacity(k);
        for component in 0..k {
            let mut unit = vec![0.0; k];
            unit[component] = 1.0;
            let moved = Self::new(body, &unit, self.angles)?.positions;
            directions.push(moved.iter().zip(&start).step_by(step).map(|(m, s)| sub(*m, *s)).collect());
        }
        mesh.closest_point();
        let samples: Vec<usize> = (0..body.vertex_count()).step_by(step).collect();
        // Along the normal of the mesh: the plane it lies in, as the target sees it.
        let mut planes: Vec<(usize, [f64; 3], [f64; 3], f64)> = samples
            .par_iter()
            .enumerate()
            .filter_map(|(sample, v)| {
                let p = motion.inverse(self.positions[*v]);
                let found = mesh.closest_point().project_within(p, SHAPE_REACH / motion.scale)?;
                let normal = motion.turned(found.normal);
                let position = motion.apply(found.position);
                let now = dot(normal, sub(position, self.positions[*v]));
                Some((sample, normal, position, now))
            })
            .collect();
        planes.sort_by(|a, b| a.3.abs().total_cmp(&b.3.abs()));
        planes.truncate((SHAPE_SHARE * planes.len() as f64) as usize);
        let mut equations = NormalEquations::new(k + 6);
        for (sample, normal, position, _) in &planes {
            let of_shape = directions.iter().map(|d| dot(*normal, d[*sample]));
            let (turn, shift) = (cross(*position, *normal), *normal);
            let row: Vec<f64> = of_shape.chain(turn.map(|x| -x)).chain(shift.map(|x| -x)).collect();
            equations.add(&row, dot(*normal, sub(*position, start[sample * step])));
        }
        let small_shape = SMALL_SHAPE * 1e-4 * planes.len().max(1) as f64;
        let Some(x) = equations.solution(|i| if i < k { small_shape } else { 1e-9 }) else { return Ok(None) };
        let shape: Vec<f64> = x[..k].iter().map(|x| x.clamp(-LARGEST_SHAPE, LARGEST_SHAPE)).collect();
        let turn = rotation::matrix_from_axis_angle([x[k], x[k + 1], x[k + 2]]);
        let motion = Similarity {
            scale: motion.scale,
            rotation: rotation::product(&turn, &motion.rotation),
            translation: add(rotation::apply(&turn, motion.translation), [x[k + 3], x[k + 4], x[k + 5]]),
        };
        let is_finite = shape.iter().chain(&motion.translation).all(|x| x.is_finite());
        Ok(is_finite.then_some((shape, motion)))
    }
}
