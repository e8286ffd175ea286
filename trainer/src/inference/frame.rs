//! One drape: networks, post-process, refinement.

use super::motion::RetryPolicy;
use super::network_drape::{NetworkDrape, Pass};
use super::{
    BodyState, Certificate, Drape, Draper, DraperError, GarmentDrape, Outfit, RefineSteps, elapsed, refine,
};
use crate::inference::reference::ReferenceScene;
use clothcombo_physics::Surface;
use clothcombo_physics::contact::resolve::{PathSample, Resolved, resolve_after, resolve_along};
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
        let NetworkDrape { scene, surface, heading, transforms, skinned, network, mut milliseconds } = made;

        let clock = Instant::now();
        let parts = outfit.split(&network);
        let (resolved, times, certificate) = match self.settings.resolve {
            true => {
                let final_sample = || PathSample {
                    body: surface.clone(),
                    draped: parts.iter().map(|p| p.to_vec()).collect(),
                    transforms: transforms.clone(),
                };
                let done = self.resolved(outfit, frame, watch, &surface, &parts, &final_sample);
                let done = done.map_err(|error| outfit.named(error))?;
                let times = done.garments.iter().map(|g| 1e3 * g.time.as_secs_f64()).collect();
                (done.positions, times, done.certificate)
            }
            false => {
                (parts.iter().map(|p| p.to_vec()).collect(), vec![0.0; parts.len()], Certificate::default())
            }
        };
        milliseconds.resolve = elapsed(clock);

        let clock = Instant::now();
        let (refined, refinement) = match frame.refine {
            RefineSteps::AtMost(0) => (resolved.concat(), None),
            steps => {
                let mut energy = ReferenceScene::new(&self.trained.config.losses, &scene)?.energy;
                energy.body = surface.clone();
                let (positions, done) = refine(&energy.pulled_back(&transforms), &resolved.concat(), steps)?;
                (positions, Some(done))
            }
        };
        milliseconds.refine = elapsed(clock);

        let (skinned, refined) = (outfit.split(&skinned), outfit.split(&refined));
        let transforms = outfit.split(&transforms);
        let garments = resolved
            .into_iter()
            .enumerate()
            .map(|(g, resolved)| GarmentDrape {
                skinned: skinned[g].to_vec(),
                network: parts[g].to_vec(),
                positions: refined[g].to_vec(),
                resolved,
                transforms: transforms[g].to_vec(),
                resolve_ms: times[g],
            })
            .collect();
        let mut drape = Drape {
            body: surface.positions.clone(),
            heading,
            garments,
            milliseconds,
            refinement,
            certificate,
            surface: Some(surface),
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
        watch: &mut dyn FnMut(f64),
        surface: &Surface<f64>,
        parts: &[&[[f64; 3]]],
        final_sample: &dyn Fn() -> PathSample,
    ) -> Result<Resolved, DraperError> {
        let (layers, settings) = (outfit.layers(parts), &self.settings.post_process);
        let mut carried = None;
        if let Some(PreviousFrame { body: state, drape, retry }) = last {
            let between = |share: f64| {
                watch(share);
                match share {
                    1.0 => Ok(final_sample()),
                    _ => {
                        let place = add_scaled(state.place, share, sub(body.place, state.place));
                        self.stage(Pass::Accepted, outfit, body, state.pose.between(&body.pose, share), place)
                    }
                }
            };
            carried = resolve_after(drape.reached(), surface, &layers, settings, between)?;
            if let Some(done) = carried.take_if(|done| retry.is_met(&done.certificate)) {
                return Ok(done);
            }
        }
        let from_t_pose = |share: f64| {
            watch(share);
            let pose = body.pose.scaled_keeping_heading(share);
            let stage = self.stage(Pass::ForwardPass, outfit, body, pose, body.place)?;
            Ok::<_, DraperError>(match share {
                // The surface is known here only.
                1.0 => PathSample { draped: stage.draped, ..final_sample() },
                _ => stage,
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
