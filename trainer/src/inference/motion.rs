//! A motion: each frame carries on from the one before, and what that leaves over from the one after.

use super::bodies::{Bodies, BodyState, Moment};
use super::drape::Drape;
use super::draper::Draper;
use super::frame::{Frame, PreviousFrame, RetryPolicy};
use super::outfit::Outfit;
use super::smooth::{Smoothing, smooth};
use super::temporal_filter::TemporalFilter;
use clothcombo_physics::contact::resolve::Certificate;
use miette::Report;

/// So many frames after one that was left with flaws only carry on: poses change slowly, and starting anew takes seconds.
const FRAMES_WITHOUT_RETRY: usize = 15;

/// Frames this near to each other show the same cloth (s); a little more than 0.05, for rounding.
const CLOSE_FRAMES: f64 = 0.050_001;

/// Frames to each side over which a motion is smoothed: where nothing else is asked for, two of frames that are
/// [close](CLOSE_FRAMES), so that only what trembles is averaged.
fn smoothing_radius(asked: Option<u16>, moments: &[Moment]) -> usize {
    let is_close = |pair: &[Moment]| pair[1].seconds - pair[0].seconds <= CLOSE_FRAMES;
    let usual = if moments.windows(2).all(is_close) { 2 } else { 0 };
    asked.map_or(usual, usize::from)
}

/// How far [`Draper::drape_motion`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrapeProgress {
    /// The post-process looks at a pose at this share of the continuation path to the frame: from the one before it,
    /// or, where that leaves intersections, from the T-pose.
    Continuation(f64),
    /// One more frame is draped.
    Draped,
    /// The frame of this number is draped once more, from the one after it.
    Again(usize),
}

impl Draper {
    /// Drapes `outfit` on all of `bodies`, as [`drape_motion`](Self::drape_motion). A motion is smoothed over `radius` frames to
    /// each side; `None`: over two where they are at most 0.05 s apart, else not.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape_bodies(
        &self,
        outfit: &Outfit,
        bodies: &Bodies,
        radius: Option<u16>,
        progress: impl FnMut(DrapeProgress),
    ) -> Result<(Vec<Drape>, Option<Smoothing>), Report> {
        let radius = smoothing_radius(radius, &bodies.moments);
        let mut drapes = self.drape_motion(outfit, &bodies.states, radius, progress)?;
        let is_smoothed = radius > 0 && !bodies.moments.is_empty();
        let smoothing = is_smoothed.then(|| smooth(self, outfit, &mut drapes, radius)).transpose()?;
        Ok((drapes, smoothing))
    }

    /// Drapes `outfit` on each of `bodies`, the frames of a motion. What the networks make is averaged over `radius`
    /// frames to each side before the post-process; 0 takes each frame as it is. The post-process carries on from frame
    /// to frame; where a frame is left with intersections or excess strain, and the one after it with less and no intersections,
    /// it carries on backwards from that one as well. `progress` is called on the path to each frame, after it, and
    /// before each that is draped once more.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape_motion(
        &self,
        outfit: &Outfit,
        bodies: &[BodyState],
        radius: usize,
        mut progress: impl FnMut(DrapeProgress),
    ) -> Result<Vec<Drape>, Report> {
        let mut drapes: Vec<Drape> = Vec::with_capacity(bodies.len());
        let (mut retry, mut frames_without_retry) = (RetryPolicy::NONE, 0);
        let refine = self.refine_steps(bodies.len());
        let filtered = TemporalFilter::new(self, outfit, bodies, radius);
        for ((frame, body), made) in bodies.iter().enumerate().zip(filtered) {
            let last = drapes.last().map(|drape| PreviousFrame { body: &bodies[frame - 1], drape, retry });
            let mut watch = |share| progress(DrapeProgress::Continuation(share));
            let mut drape = self.drape_frame(outfit, Frame { body, refine, last }, made?, &mut watch)?;
            if !retry.is_met(&drape.certificate) {
                (retry, frames_without_retry) =
                    (RetryPolicy::after(&drape.certificate), FRAMES_WITHOUT_RETRY);
            } else if frames_without_retry > 1 {
                frames_without_retry -= 1;
            } else {
                (retry, frames_without_retry) = (RetryPolicy::NONE, 0);
            }
            if bodies.len() > 1 {
                drape.slim();
            }
            drapes.push(drape);
            progress(DrapeProgress::Draped);
        }
        if !self.settings.resolve {
            return Ok(drapes);
        }
        carry_back(
            &mut drapes,
            |drape| &drape.certificate,
            |frame, own, after| {
                progress(DrapeProgress::Again(frame));
                let last = PreviousFrame { body: &bodies[frame + 1], drape: after, retry: RetryPolicy::ALL };
                let mut watch = |share| progress(DrapeProgress::Continuation(share));
                let body = &bodies[frame];
                let mut made = self.network_drape(outfit, body)?;
                made.network = own.garments.iter().flat_map(|garment| &garment.network).copied().collect();
                let mut again =
                    self.drape_frame(outfit, Frame { body, refine, last: Some(last) }, made, &mut watch)?;
                again.slim();
                if again.certificate.defects() < own.certificate.defects() {
                    std::mem::swap(own, &mut again);
                }
                own.milliseconds += again.milliseconds;
                for (garment, other) in own.garments.iter_mut().zip(&again.garments) {
                    garment.resolve_ms += other.resolve_ms;
                }
                Ok::<_, Report>(())
            },
        )?;
        Ok(drapes)
    }
}

/// From the last frame to the first: `again` improves what has flaws, from the frame after it, where that has fewer and no
/// intersections.
fn carry_back<T, E>(
    frames: &mut [T],
    certificate: impl Fn(&T) -> &Certificate,
    mut again: impl FnMut(usize, &mut T, &T) -> Result<(), E>,
) -> Result<(), E> {
    for frame in (0..frames.len().saturating_sub(1)).rev() {
        let (own, after) = frames.split_at_mut(frame + 1);
        let (own, after) = (&mut own[frame], &after[0]);
        let (now, next) = (certificate(own), certificate(after));
        if !RetryPolicy::NONE.is_met(now) && next.defects() < now.defects() && next.intersections() == 0 {
            again(frame, own, after)?;
        }
    }
    Ok(())
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
    fn frames_with_flaws_are_improved_from_clear_ones_after_them() {
        let intersections =
            |frames: &[Certificate]| frames.iter().map(Certificate::intersections).collect::<Vec<_>>();
        let mut frames = [5, 4, 3, 0, 2, 0, 7].map(|intersections| left(intersections, 0.0));
        let mut asked = Vec::new();
        let found: Result<(), String> = carry_back(
            &mut frames,
            |frame| frame,
            |frame, own, after| {
                assert_eq!(after.intersections(), 0);
                asked.push((frame, own.intersections()));
                *own = left(usize::from(frame == 1), 0.0);
                Ok(())
            },
        );
        assert!(found.is_ok());
        assert_eq!(asked, [(4, 2), (2, 3), (1, 4)]);
        assert_eq!(intersections(&frames), [5, 1, 0, 0, 0, 0, 7]);
        // So is excess strain, from a frame that has less of it.
        let mut strained = [left(0, 2.0), left(0, 1.5), left(2, 0.0), left(0, 0.5)];
        let mut asked = Vec::new();
        let found: Result<(), String> = carry_back(
            &mut strained,
            |frame| frame,
            |frame, own, _| {
                asked.push(frame);
                own.body_triangle_pairs = 0;
                Ok(())
            },
        );
        assert!(found.is_ok());
        assert_eq!(asked, [2, 1, 0]);
        let failed = carry_back(&mut frames, |frame| frame, |_, _, _| Err("an error comes back"));
        assert_eq!(failed, Err("an error comes back"));
        assert!(carry_back(&mut [], |frame: &Certificate| frame, |_, _, _| Err("none")).is_ok());
    }

    #[test]
    fn frames_far_from_each_other_are_only_smoothed_if_asked_for() {
        let moments = |rate: f64| -> Vec<Moment> {
            (0..5).map(|frame| Moment { frame, seconds: frame as f64 / rate }).collect()
        };
        assert_eq!(
            [60.0, 30.0, 20.0, 19.0, 3.0].map(|rate| smoothing_radius(None, &moments(rate))),
            [2, 2, 2, 0, 0]
        );
        assert_eq!([0, 3].map(|asked| smoothing_radius(Some(asked), &moments(3.0))), [0, 3]);
    }
}
