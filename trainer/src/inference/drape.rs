//! An outfit on one body: what a draper made, sample by sample.

use super::draper::Draper;
use super::outfit::Outfit;
use super::phase_times::PhaseTimes;
use super::refine::Refinement;
use clothcombo_physics::Surface;
use clothcombo_physics::contact::resolve::{Certificate, ContactState, certify};
use clothcombo_physics::transform::Transform;
use miette::Report;
use std::sync::Arc;

/// One garment on one body, vertices as in its [`OutfitGarment`](super::OutfitGarment).
#[derive(Clone, Debug)]
pub struct GarmentDrape {
    /// Linear blend skinning of the start state, which has learned nothing `[V, 3]` (m).
    pub skinned: Vec<[f64; 3]>,
    /// What the networks made of it, in a motion averaged over frames if that was asked for `[V, 3]` (m).
    pub network: Vec<[f64; 3]>,
    /// What the post-process made of that, where a refinement follows `[V, 3]` (m).
    pub resolved: Option<Vec<[f64; 3]>>,
    /// The result `[V, 3]` (m).
    pub positions: Vec<[f64; 3]>,
    /// Blended skinning transform of every vertex, canonical → posed.
    pub transforms: Vec<Transform>,
    /// Wall time of the post-process (ms).
    pub resolve_ms: f64,
}

/// An outfit on one body.
#[derive(Clone, Debug)]
pub struct Drape {
    /// The posed body `[V, 3]` (m).
    pub body: Vec<[f64; 3]>,
    /// Where it faces: angle about the vertical from +z towards +x (radians).
    pub heading: f64,
    /// The garments, inner → outer.
    pub garments: Vec<GarmentDrape>,
    /// Wall time of the phases.
    pub milliseconds: PhaseTimes,
    /// What the refinement did, if there was one.
    pub refinement: Option<Refinement>,
    /// Exact counts of what intersects in the result.
    pub certificate: Certificate,
    /// The body with its search trees, as long as they are worth their memory.
    pub(super) surface: Option<Arc<Surface<f64>>>,
}

impl Drape {
    /// The body's surface, with its search trees if they were kept.
    pub(super) fn surface(&self, draper: &Draper) -> Arc<Surface<f64>> {
        let make = || Arc::new(Surface::new(self.body.clone(), draper.body().faces.clone()));
        self.surface.clone().unwrap_or_else(make)
    }

    /// Where the next frame starts.
    pub(super) fn contact_state(&self) -> ContactState {
        let garments = || self.garments.iter();
        ContactState {
            draped: garments().map(|g| g.network.clone()).collect(),
            positions: garments().map(|g| g.positions.clone()).collect(),
            transforms: garments().flat_map(|g| g.transforms.iter().copied()).collect(),
            intersections: self.certificate.intersections(),
        }
    }

    /// Drops what can be made again at any time: some megabytes, which add up over the frames of a motion.
    pub fn slim(&mut self) {
        self.surface = None;
    }

    fn network(&self) -> Vec<&[[f64; 3]]> {
        self.garments.iter().map(|g| g.network.as_slice()).collect()
    }

    /// What intersected before the post-process.
    pub(super) fn certificate_before(&self, draper: &Draper, outfit: &Outfit) -> Result<Certificate, Report> {
        let layers = outfit.layers(&self.network());
        certify(&self.surface(draper), &layers).map_err(|error| outfit.named(error))
    }

    /// Brings the positions to what files hold, and counts what intersects there.
    pub(super) fn settle(&mut self, draper: &Draper, outfit: &Outfit) -> Result<(), Report> {
        self.garments.iter_mut().for_each(|garment| round(&mut garment.positions));
        let before = self.network();
        let after: Vec<&[[f64; 3]]> = self.garments.iter().map(|g| g.positions.as_slice()).collect();
        let certified = certify(&self.surface(draper), &outfit.layers(&after));
        let mut certificate = certified.map_err(|error| outfit.named(error))?;
        certificate.compare_strain(&outfit.layers(&before));
        certificate.is_stopped = self.certificate.is_stopped;
        self.certificate = certificate;
        Ok(())
    }
}

/// To the 0.1 µm that OBJ files hold: what is certified is then, to the bit, what is read from them.
pub(super) fn round(positions: &mut [[f64; 3]]) {
    for x in positions.as_flattened_mut() {
        *x = (*x * 1e7).round() / 1e7;
    }
}
