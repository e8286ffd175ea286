//! Where contact with the body is not smooth.
//!
//! Between a torso and an arm the distance is the least of the distances `d_k` to both, and has a crease where they are
//! equal. The energy is convex across it: cloth that is pressed into a crease comes to rest on it, where the gradient
//! knows one side only and does not vanish. The minimum is where *some* convex combination of the forces of all sides
//! balances the rest (Clarke's subdifferential). So it is on a face that is buried in another part of the body, with
//! the inside on both of its sides.
//!
//! The sides are those that the point has been on (`NearFaces`): what a step has run against, the next one knows. They
//! are the cutting planes of bundle methods (Lemaréchal, "Bundle methods in nonsmooth optimization", 1978), for every
//! point apart.
//!
//! [`Creases::smooth`] gives a solver the model of the smooth minimum `−w log Σ exp(−d_k/w)` of width `w`: the derivative
//! `n = Σ λ_k n_k` with weights `λ_k ~ exp(−d_k/w)`, and the curvature `−(Σ λ_k n_k n_kᵀ − n nᵀ)/w`, which the penalty
//! turns positive. A step then goes along the crease and not across. [`Creases::balance`] takes the convex combinations
//! that leave least: what counts as convergence. The energy itself stays as it is.

use super::curvature::{CurvatureSink, Scaled, outer};
use super::scene_sum::BodyMemory;
use super::{ContactPoints, EnergySettings, SceneEnergy, Term};
use crate::real::Real;
use crate::vec3::{add, add_scaled, axpy, dot, norm_squared, scale, sub, to_f64};

/// Sides farther than this beyond the nearest one, in widths, have no weight.
const SMOOTH_WIDTHS: f64 = 12.0;

/// Sweeps over all creases until their combinations are least.
const CREASE_SWEEPS: usize = 30;

/// All points in contact with two or more sides.
pub(crate) struct Creases<'a>(Vec<Crease<'a>>);

struct Crease<'a> {
    points: &'a ContactPoints,
    point: usize,
    /// Of the first vertex of the garment.
    offset: usize,
    /// Weighted force of the contact (N).
    force: f64,
    /// Distance and its gradient on every side, nearest first; the gradient of the energy knows the first.
    sides: Vec<(f64, [f64; 3])>,
}

impl<T: Real> SceneEnergy<T> {
    /// The creases near which points at `posed` lie, of which `memory` has just seen the energy; of sides `within` a band (m)
    /// beyond the nearest, and seen no farther than a reach (m) away.
    pub(crate) fn creases(&self, posed: &[[T; 3]], memory: &BodyMemory, within: [f64; 2]) -> Creases<'_> {
        let mut creases = Vec::new();
        let samples = self.settings.body_samples;
        for ((garment, range), near) in self.garments.iter().zip(self.ranges()).zip(memory) {
            let (points, offset) = (garment.energies.contact_points(), range.start);
            let weight = garment.weights[Term::BodyCollision] * points.share(samples);
            if weight <= 0.0 {
                continue;
            }
            let margin = garment.body_margin(&self.settings);
            for (point, (p, near)) in points.at(&posed[range], samples).iter().zip(near).enumerate() {
                let sides = near.sides(to_f64(*p), within);
                let epsilon = margin + points.mean(&garment.thickness_below, point);
                let excess = sides.first().map_or(0.0, |(distance, _)| epsilon - distance);
                if sides.len() > 1 && excess > 0.0 {
                    let force = 3.0 * weight * excess * excess;
                    creases.push(Crease { points, point, offset, force, sides });
                }
            }
        }
        Creases(creases)
    }

    /// Shows `memory` what is around points in contact at `posed` (m), `radius` (m) away along axes and diagonals.
    pub(crate) fn look_around(&self, posed: &[[T; 3]], memory: &mut BodyMemory, radius: f64) {
        let EnergySettings { body_samples, distance, .. } = self.settings;
        for ((garment, range), near) in self.garments.iter().zip(self.ranges()).zip(memory) {
            let points = garment.energies.contact_points();
            let margin = garment.body_margin(&self.settings);
            for (point, (p, near)) in points.at(&posed[range], body_samples).iter().zip(near).enumerate() {
                let epsilon = margin + points.mean(&garment.thickness_below, point);
                let mut see = |p| self.body.gap_near(p, distance, epsilon, near).gap.to_f64();
                if see(*p) >= epsilon {
                    continue;
                }
                for k in 0..27 {
                    let to = [k / 9, k / 3 % 3, k % 3].map(|c| T::from_f64(radius * f64::from(c - 1)));
                    see(add(*p, to));
                }
                see(*p);
            }
        }
    }
}

impl Creases<'_> {
    /// Adds to `gradient` and to `sink` what makes the contact smooth over `width` (m); see the module.
    pub fn smooth(&self, width: f64, gradient: &mut [[f64; 3]], sink: &mut dyn CurvatureSink) {
        for crease in &self.0 {
            let (nearest, normal) = crease.sides[0];
            let weights = crease.sides.iter().map(|(d, _)| ((nearest - d) / width).exp());
            let sum: f64 = weights.clone().sum();
            let (mut mean, mut square) = ([0.0; 3], [[0.0; 3]; 3]);
            for ((_, n), weight) in crease.sides.iter().zip(weights) {
                axpy(&mut mean, weight / sum, *n);
                let part = outer(weight / sum, *n, *n);
                (0..3).for_each(|r| axpy(&mut square[r], 1.0, part[r]));
            }
            crease.add(gradient, scale(sub(normal, mean), crease.force));
            let of_mean = outer(1.0, mean, mean);
            let curvature = std::array::from_fn(|r| sub(square[r], of_mean[r]));
            let mut sink = Scaled { sink, offset: crease.offset, weight: crease.force / width };
            crease.points.add_curvature(&mut sink, crease.point, curvature);
        }
    }

    /// Replaces the forces of the nearest sides in `gradient` by the convex combinations of those of all sides that
    /// make it least.
    pub fn balance(&self, gradient: &mut [[f64; 3]]) {
        let first = |crease: &Crease<'_>| {
            let mut weights = vec![0.0; crease.sides.len()];
            weights[0] = 1.0;
            weights
        };
        let mut weights: Vec<Vec<f64>> = self.0.iter().map(first).collect();
        for _ in 0..CREASE_SWEEPS {
            for (crease, weights) in self.0.iter().zip(&mut weights) {
                for k in 0..weights.len() {
                    for l in 0..k {
                        // Moving a weight from l to k changes the gradient at the point by as much of this.
                        let change = scale(sub(crease.sides[l].1, crease.sides[k].1), crease.force);
                        let corners = crease.points.corners(crease.point);
                        let along: f64 =
                            corners.iter().map(|v| dot(gradient[crease.offset + v], change)).sum();
                        let size = norm_squared(change);
                        if size == 0.0 {
                            continue;
                        }
                        // With c corners, each has 1/c of the change: |change|²/c in all, against along/c.
                        let moved = (-along / size).clamp(-weights[k], weights[l]);
                        crease.add(gradient, scale(change, moved));
                        weights[k] += moved;
                        weights[l] -= moved;
                    }
                }
            }
        }
    }
}

impl Crease<'_> {
    /// Adds a gradient at the point.
    fn add(&self, gradient: &mut [[f64; 3]], force: [f64; 3]) {
        let corners = self.points.corners(self.point);
        for v in corners.iter() {
            let to = &mut gradient[self.offset + v];
            *to = add_scaled(*to, corners.weight(), force);
        }
    }
}

/// How far apart the sides of a crease may be for [`Creases::smooth`] with `width` (m) to notice.
pub(crate) fn reach(width: f64) -> f64 {
    SMOOTH_WIDTHS * width
}
