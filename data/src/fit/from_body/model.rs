//! The target's model with a shape, its arms lowered and its legs spread: what a mesh of a person is compared with.

use super::super::limb_pose::limb_pose;
use super::icp::Similarity;
use crate::asset::{Body, rotation};
use clothcombo_physics::Surface;
use clothcombo_physics::vec3::{add, cross, dot, sub};
use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use rayon::prelude::*;

/// Shape parameters of people lie within this.
const LARGEST: f64 = 3.0;
/// Vertices looked at.
const SAMPLES: usize = 2500;
/// Closest points farther away (m) are on another part of the body.
const REACH: f64 = 0.08;
/// Weight of small shape numbers against a distance of 1 cm of all samples.
const PRIOR: f64 = 0.02;
/// Share of the samples that have a say.
const TRIM: f64 = 0.85;

/// A shaped and posed body.
#[derive(Clone)]
pub(super) struct Model {
    /// How far the arms hang down and the legs are spread (degrees).
    pub angles: [f64; 2],
    pub shape: Vec<f64>,
    /// Posed vertices (m).
    pub positions: Vec<[f64; 3]>,
    pub bones: Vec<[[f64; 4]; 3]>,
}

impl Model {
    /// # Errors
    /// When the shape has more numbers than the body.
    pub fn new(body: &Body, shape: &[f64], angles: [f64; 2]) -> Result<Self, String> {
        let posed = body.posed(shape, &limb_pose(body, angles)).map_err(|e| e.to_string())?;
        Ok(Self { angles, shape: shape.to_vec(), positions: posed.positions, bones: posed.bones })
    }

    pub fn surface(&self, body: &Body) -> Surface<f64> {
        Surface::new(self.positions.clone(), body.faces.clone())
    }

    /// The shape in the same pose that lies closest to `mesh`, which `motion` brings here, and the motion that goes
    /// with it, of the same scale: one Gauss–Newton step, since for a given pose vertices are linear in the shape. None
    /// where the body has one shape only.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn closer_shape(
        &self,
        body: &Body,
        mesh: &Surface<f64>,
        motion: &Similarity,
    ) -> Result<Option<(Vec<f64>, Similarity)>, String> {
        let k = body.shape_count;
        if k == 0 {
            return Ok(None);
        }
        let step = body.vertex_count().div_ceil(SAMPLES).max(1);
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
                let found = mesh.closest_point().project_within(p, REACH / motion.scale)?;
                let normal = motion.turned(found.normal);
                let position = motion.apply(found.position);
                let now = dot(normal, sub(position, self.positions[*v]));
                Some((sample, normal, position, now))
            })
            .collect();
        planes.sort_by(|a, b| a.3.abs().total_cmp(&b.3.abs()));
        planes.truncate((TRIM * planes.len() as f64) as usize);
        let size = k + 6;
        let mut gram = vec![vec![0.0; size]; size];
        let mut right = vec![0.0; size];
        for (sample, normal, position, _) in &planes {
            let of_shape = directions.iter().map(|d| dot(*normal, d[*sample]));
            let (turn, shift) = (cross(*position, *normal), *normal);
            let row: Vec<f64> = of_shape.chain(turn.map(|x| -x)).chain(shift.map(|x| -x)).collect();
            let wanted = dot(*normal, sub(*position, start[sample * step]));
            for i in 0..size {
                right[i] += row[i] * wanted;
                (0..size).for_each(|j| gram[i][j] += row[i] * row[j]);
            }
        }
        let prior = PRIOR * 1e-4 * planes.len().max(1) as f64;
        let ridge = |i: usize| if i < k { prior } else { 1e-9 };
        let gram = Mat::from_fn(size, size, |i, j| gram[i][j] + if i == j { ridge(i) } else { 0.0 });
        let Ok(factor) = gram.llt(Side::Lower) else { return Ok(None) };
        let solution = factor.solve(Mat::from_fn(size, 1, |i, _| right[i]));
        let x = |i: usize| solution[(i, 0)];
        let shape: Vec<f64> = (0..k).map(|i| x(i).clamp(-LARGEST, LARGEST)).collect();
        let turn = rotation::matrix_from_axis_angle([x(k), x(k + 1), x(k + 2)]);
        let motion = Similarity {
            scale: motion.scale,
            rotation: rotation::product(&turn, &motion.rotation),
            translation: add(rotation::apply(&turn, motion.translation), [x(k + 3), x(k + 4), x(k + 5)]),
        };
        let is_finite = shape.iter().chain(&motion.translation).all(|x| x.is_finite());
        Ok(is_finite.then_some((shape, motion)))
    }
}
