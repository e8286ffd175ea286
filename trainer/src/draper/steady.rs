//! Networks that hold still: what they make of the frames of a motion, averaged over neighbouring frames.
//!
//! A network knows one pose at a time, and a correction is taken or not: from frame to frame a drape may jump by a millimetre
//! where the body hardly moves. What is averaged is as in [`super::smooth`]; the post-process comes after it.

use super::networked::Networked;
use super::smooth::{averaged, binomial};
use super::{BodyState, Draper, DraperError, Outfit};
use clothcombo_physics::transform::{into_frame, out_of_frame};
use clothcombo_physics::vec3::{add, sub};
use std::collections::BTreeMap;

/// The frames of a motion as the networks make them, in order.
pub(super) struct Steady<'a> {
    draper: &'a Draper,
    outfit: &'a Outfit,
    bodies: &'a [BodyState],
    weights: Vec<f64>,
    /// Frames around the last that was asked for.
    near: BTreeMap<usize, Near>,
}

struct Near {
    /// Until it was asked for.
    made: Option<Networked>,
    /// Offsets from skinning in the frames of the skinning transforms.
    offsets: Vec<[f64; 3]>,
}

impl<'a> Steady<'a> {
    /// For `bodies`, averaged over `radius` of them to each side.
    pub fn new(draper: &'a Draper, outfit: &'a Outfit, bodies: &'a [BodyState], radius: usize) -> Self {
        // One frame has no neighbours.
        let radius = if bodies.len() > 1 { radius } else { 0 };
        Self { draper, outfit, bodies, weights: binomial(radius), near: BTreeMap::new() }
    }

    /// The next frame. Each is asked for once, in ascending order.
    pub fn at(&mut self, frame: usize) -> Result<Networked, DraperError> {
        let (radius, count) = (self.weights.len() / 2, self.bodies.len());
        if radius == 0 {
            return self.draper.networked(&self.draper.model, self.outfit, &self.bodies[frame]);
        }
        self.near.retain(|other, _| other + radius >= frame);
        for other in frame..count.min(frame + radius + 1) {
            if !self.near.contains_key(&other) {
                let made = self.draper.networked(&self.draper.model, self.outfit, &self.bodies[other])?;
                let offsets = offsets(&made);
                self.near.insert(other, Near { made: Some(made), offsets });
            }
        }
        let mean = averaged(|other| &self.near[&other].offsets, count, frame, &self.weights);
        let made = self.near.get_mut(&frame).and_then(|near| near.made.take());
        let mut made = match made {
            Some(made) => made,
            None => self.draper.networked(&self.draper.model, self.outfit, &self.bodies[frame])?,
        };
        let vertices = made.skinned.iter().zip(&made.transforms).zip(mean);
        made.network = vertices.map(|((p, t), offset)| add(*p, out_of_frame(t, offset))).collect();
        Ok(made)
    }
}

fn offsets(made: &Networked) -> Vec<[f64; 3]> {
    let vertices = made.network.iter().zip(&made.skinned).zip(&made.transforms);
    vertices.map(|((p, start), transform)| into_frame(transform, sub(*p, *start))).collect()
}
