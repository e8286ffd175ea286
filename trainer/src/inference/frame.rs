//! One drape: networks, post-process, refinement.

use super::motion::RetryPolicy;
use super::network_drape::NetworkDrape;
use super::{
    BodyState, Certificate, Drape, Draper, DraperError, GarmentDrape, Outfit, RefineSteps, elapsed, refine,
};
use crate::inference::reference::ReferenceScene;
use clothcombo_physics::contact::resolve::{Resolved, resolve_after, resolve_along};
use clothcombo_physics::vec3::{add_scaled, sub};
use std::time::Instant;

/// What is to be draped.
#[derive(Clone, Copy)]
pub(super) struct Frame<'a> {
    pub body: &'a BodyState,
    pub refine: RefineSteps,
    /// Where the post-process carries on from, if anywhere.
    pub last: Option<PreviousFrame<'a>>,
}

/// Another frame of the same motion, which a drape carries on from.
#[derive(Clone, Copy)]
pub(super) struct PreviousFrame<'a> {
    pub body: &'a BodyState,
    pub drape: &'a Drape,
    /// What carrying on may leave. Where it leaves more, the drape is also resolved anew, on a continuation path from the T-pose:
    /// that takes seconds.
    pub retry: RetryPolicy,
}

impl Draper {
    /// Steps of the refinement of each of so many frames.
    pub(super) fn refine_steps(&self, frames: usize) -> RefineSteps {
        self.settings.refine.unwrap_or_else(|| RefineSteps::default_of(frames))
    }

    /// Drapes `outfit` on `frame`, of which the networks have `made` this. `watch` is called for every pose that the post-process
    /// looks at, with its share of the path there.
    pub(super) fn drape_frame(
        &self,
        outfit: &Outfit,
        frame: Frame<'_>,
        made: NetworkDrape,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Drape, DraperError> {
        let mut milliseconds = made.milliseconds;
        let clock = Instant::now();
        let (resolved, times, certificate) = match self.settings.resolve {
            true => {
                let done = self.resolved(outfit, frame, &made, watch).map_err(|error| outfit.named(error))?;
                let times = done.garments.iter().map(|g| 1e3 * g.time.as_secs_f64()).collect();
                (done.positions, times, done.certificate)
            }
            false => {
                (outfit.to_parts(&made.network), vec![0.0; outfit.garments.len()], Certificate::default())
            }
        };
        milliseconds.resolve = elapsed(clock);

        let clock = Instant::now();
        let (positions, resolved, refinement) = match frame.refine {
            RefineSteps::AtMost(0) => (resolved, None, None),
            steps => {
                let mut energy = ReferenceScene::new(&self.trained.config.losses, &made.start.scene)?.energy;
                energy.body = made.start.surface.clone();
                let energy = energy.pulled_back(&made.start.transforms);
                let (refined, done) = refine(&energy, &resolved.concat(), steps)?;
                (outfit.to_parts(&refined), Some(resolved), Some(done))
            }
        };
        milliseconds.refine = elapsed(clock);

        let [skinned, network] = [&made.start.skinned, &made.network].map(|packed| outfit.split(packed));
        let transforms = outfit.split(&made.start.transforms);
        let mut resolved = resolved.into_iter().flatten();
        let garments = positions.into_iter().enumerate().map(|(g, positions)| GarmentDrape {
            skinned: skinned[g].to_vec(),
            network: network[g].to_vec(),
            resolved: resolved.next(),
            positions,
            transforms: transforms[g].to_vec(),
            resolve_ms: times[g],
        });
        let mut drape = Drape {
            body: made.start.surface.positions.clone(),
            heading: made.start.heading,
            garments: garments.collect(),
            milliseconds,
            refinement,
            certificate,
            surface: Some(made.start.surface),
        };
        let clock = Instant::now();
        drape.settle(self, outfit)?;
        drape.milliseconds.certificate = elapsed(clock);
        Ok(drape)
    }

    /// The post-process, from the last frame on if there is one.
    fn resolved(
        &self,
        outfit: &Outfit,
        Frame { body, last, .. }: Frame<'_>,
        made: &NetworkDrape,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Resolved, DraperError> {
        let (surface, settings) = (&*made.start.surface, &self.settings.post_process);
        let layers = outfit.layers(&outfit.split(&made.network));
        // Another pose on a path; the surface is given for the end only.
        let at = |pose, place| BodyState { shape: body.shape.clone(), pose, surface: None, place };
        let mut carried = None;
        if let Some(PreviousFrame { body: state, drape, retry }) = last {
            let between = |share: f64| {
                watch(share);
                match share {
                    1.0 => Ok::<_, DraperError>(made.sample(outfit)),
                    _ => {
                        let place = add_scaled(state.place, share, sub(body.place, state.place));
                        let between = at(state.pose.between(&body.pose, share), place);
                        Ok(self.network_drape(outfit, &between)?.sample(outfit))
                    }
                }
            };
            carried = resolve_after(drape.contact_state(), surface, &layers, settings, between)?;
            if let Some(done) = carried.take_if(|done| retry.is_met(&done.certificate)) {
                return Ok(done);
            }
        }
        let from_t_pose = |share: f64| {
            watch(share);
            Ok::<_, DraperError>(match share {
                1.0 => made.start.sample(outfit),
                _ => {
                    let body = at(body.pose.scaled_keeping_heading(share), body.place);
                    self.skinned_outfit(outfit, &body)?.sample(outfit)
                }
            })
        };
        let anew = resolve_along(surface, &layers, settings, from_t_pose)?;
        // What carries on does not pop.
        Ok(match carried {
            Some(carried) => carried.or(anew),
            None => anew,
        })
    }
}
