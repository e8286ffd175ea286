//! Temporal filter: what the networks make of the frames of a motion, averaged over neighbouring frames.
//!
//! A network knows one pose at a time, and a proposal is taken or not: from frame to frame a drape may jump by a millimetre
//! where the body hardly moves. What is averaged is as in [`super::smooth`]; the post-process comes after it.

use super::bodies::BodyState;
use super::draper::Draper;
use super::network_drape::{NetworkDrape, SkinnedOutfit};
use super::outfit::Outfit;
use super::smooth::{averaged, binomial, from_offsets, local_offsets};
use miette::Report;
use std::collections::{BTreeMap, VecDeque};

/// The frames of a motion as the networks make them, in order; each is made when it is first needed.
pub(super) struct TemporalFilter<'a> {
    draper: &'a Draper,
    outfit: &'a Outfit,
    bodies: &'a [BodyState],
    weights: Vec<f64>,
    /// The frame that comes next.
    next: usize,
    /// What was made of it and of frames after it.
    made: VecDeque<NetworkDrape>,
    /// Offsets from skinning in the frames of the skinning transforms, of those and of the frames before that are averaged.
    offsets: BTreeMap<usize, Vec<[f64; 3]>>,
}

impl<'a> TemporalFilter<'a> {
    /// For `bodies`, averaged over `radius` of them to each side.
    pub fn new(draper: &'a Draper, outfit: &'a Outfit, bodies: &'a [BodyState], radius: usize) -> Self {
        // One frame has no neighbours.
        let radius = if bodies.len() > 1 { radius } else { 0 };
        let (made, offsets) = (VecDeque::new(), BTreeMap::new());
        Self { draper, outfit, bodies, weights: binomial(radius), next: 0, made, offsets }
    }

    /// Makes what is missing for the next frame.
    fn make(&mut self) -> Result<(), Report> {
        let radius = self.weights.len() / 2;
        for frame in self.next + self.made.len()..self.bodies.len().min(self.next + radius + 1) {
            let made = self.draper.network_drape(self.outfit, &self.bodies[frame])?;
            if radius > 0 {
                let SkinnedOutfit { skinned, transforms, .. } = &made.start;
                self.offsets.insert(frame, local_offsets(&made.network, skinned, transforms));
            }
            self.made.push_back(made);
        }
        self.offsets.retain(|frame, _| frame + radius >= self.next);
        Ok(())
    }
}

impl Iterator for TemporalFilter<'_> {
    type Item = Result<NetworkDrape, Report>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(error) = self.make() {
            return Some(Err(error));
        }
        let mut made = self.made.pop_front()?;
        if !self.offsets.is_empty() {
            let mean = averaged(|other| &self.offsets[&other], self.bodies.len(), self.next, &self.weights);
            made.network = from_offsets(&made.start.skinned, &made.start.transforms, mean);
        }
        self.next += 1;
        Some(Ok(made))
    }
}
