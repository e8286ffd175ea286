//! One drape: networks, post-process, refinement.

use super::bodies::BodyState;
use super::drape::{Drape, GarmentDrape};
use super::draper::Draper;
use super::network_drape::NetworkDrape;
use super::outfit::Outfit;
use super::phase_times::elapsed;
use super::reference::ReferenceScene;
use super::refine::{RefineSteps, refine};
use clothcombo_physics::contact::resolve::{
    Certificate, ResolveError, Resolved, resolve_after, resolve_along,
};
use clothcombo_physics::vec3::{add_scaled, sub};
use miette::{IntoDiagnostic, Report, miette};
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

/// Flaws that carrying on from another frame may leave.
#[derive(Clone, Copy, Debug)]
pub(super) struct RetryPolicy {
    intersections: usize,
    excess_strain: usize,
}

impl RetryPolicy {
    /// None at all.
    pub const NONE: Self = Self { intersections: 0, excess_strain: 0 };
    /// Any.
    pub const ALL: Self = Self { intersections: usize::MAX, excess_strain: usize::MAX };

    /// After a frame of which starting anew left these: excess strain must not grow from frame to frame.
    pub fn after(anew: &Certificate) -> Self {
        Self { intersections: usize::MAX, excess_strain: anew.excess_strain().saturating_add(1) }
    }

    pub fn is_met(self, certificate: &Certificate) -> bool {
        certificate.intersections() <= self.intersections && certificate.excess_strain() <= self.excess_strain
    }
}

/// Why a frame cannot be resolved.
enum PathError {
    /// A pose on its path cannot be draped.
    Sample(Report),
    /// The post-process refuses it.
    Resolve(ResolveError),
}

impl From<ResolveError> for PathError {
    fn from(error: ResolveError) -> Self {
        Self::Resolve(error)
    }
}

impl Draper {
    /// Drapes `outfit` on `body`.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape(&self, outfit: &Outfit, body: &BodyState) -> Result<Drape, Report> {
        let made = self.network_drape(outfit, body)?;
        let refine = self.refine_steps(1);
        self.drape_frame(outfit, Frame { body, refine, last: None }, made, &mut |_| ())
    }

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
    ) -> Result<Drape, Report> {
        let mut milliseconds = made.milliseconds;
        let clock = Instant::now();
        let (resolved, times, certificate) = match self.settings.resolve {
            true => {
                let done = self.resolved(outfit, frame, &made, watch).map_err(|error| match error {
                    PathError::Sample(report) => report,
                    PathError::Resolve(error) => outfit.named(error),
                })?;
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
                let scene = ReferenceScene::new(&self.trained.config.losses, &made.start.scene);
                let mut energy = scene.into_diagnostic()?.energy;
                energy.body = made.start.surface.clone();
                let energy = energy.pulled_back(&made.start.transforms);
                let (refined, done) = refine(&energy, &resolved.concat(), steps)
                    .map_err(|error| miette!("refinement: {error}"))?;
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
    ) -> Result<Resolved, PathError> {
        let (surface, settings) = (&*made.start.surface, &self.settings.post_process);
        let layers = outfit.layers(&outfit.split(&made.network));
        // Another pose on a path; the surface is given for the end only.
        let at = |pose, place| BodyState { shape: body.shape.clone(), pose, surface: None, place };
        let mut carried = None;
        if let Some(PreviousFrame { body: state, drape, retry }) = last {
            let between = |share: f64| {
                watch(share);
                match share {
                    1.0 => Ok::<_, PathError>(made.sample(outfit)),
                    _ => {
                        let place = add_scaled(state.place, share, sub(body.place, state.place));
                        let between = at(state.pose.between(&body.pose, share), place);
                        let made = self.network_drape(outfit, &between).map_err(PathError::Sample)?;
                        Ok(made.sample(outfit))
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
            match share {
                1.0 => Ok::<_, PathError>(made.start.sample(outfit)),
                _ => {
                    let body = at(body.pose.scaled_keeping_heading(share), body.place);
                    let start = self.skinned_outfit(outfit, &body).map_err(PathError::Sample)?;
                    Ok(start.sample(outfit))
                }
            }
        };
        let anew = resolve_along(surface, &layers, settings, from_t_pose)?;
        // What carries on does not pop.
        Ok(match carried {
            Some(carried) => carried.or(anew),
            None => anew,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn left(intersections: usize, strain: f64) -> Certificate {
        Certificate {
            body_triangle_pairs: intersections,
            strain_added: Some(strain),
            ..Certificate::default()
        }
    }

    #[test]
    fn after_a_frame_with_flaws_intersections_are_allowed_but_no_growing_strain() {
        for (certificate, at_first, after_intersections, after_strain) in [
            (left(0, 0.4), true, true, true),
            (left(0, -0.4), true, true, true),
            (left(3, 0.0), false, true, true),
            (left(0, 0.6), false, true, true),
            (left(0, 1.2), false, false, true),
            (left(9, 3.0), false, false, false),
        ] {
            assert_eq!(RetryPolicy::NONE.is_met(&certificate), at_first, "{certificate:?}");
            assert_eq!(
                RetryPolicy::after(&left(7, 0.0)).is_met(&certificate),
                after_intersections,
                "{certificate:?}"
            );
            assert_eq!(
                RetryPolicy::after(&left(0, 1.0)).is_met(&certificate),
                after_strain,
                "{certificate:?}"
            );
            assert!(RetryPolicy::ALL.is_met(&certificate));
        }
        assert!(RetryPolicy::after(&left(0, f64::INFINITY)).is_met(&left(1, f64::INFINITY)));
    }
}
