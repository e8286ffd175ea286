//! A motion: each frame carries on from the one before, and what that leaves over from the one after.

use super::{BodyState, Drape, Draper, DraperError, Last, Outfit};

/// So many frames after one that was left with crossings only carry on: poses change slowly, and starting anew takes seconds.
const FRAMES_CARRIED: usize = 15;

/// How far [`Draper::drape_motion`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionProgress {
    /// One more frame is draped.
    Draped,
    /// The frame of this number is draped once more, from the one after it.
    Again(usize),
}

impl Draper {
    /// Drapes `outfit` on each of `bodies`, the frames of a motion. The post-process carries on from frame to frame; where frames
    /// are left with crossings and a later one has none, it carries on backwards from that one as well. `progress` is called
    /// after each frame, and before each that is draped once more.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape_motion(
        &self,
        outfit: &Outfit,
        bodies: &[BodyState],
        mut progress: impl FnMut(MotionProgress),
    ) -> Result<Vec<Drape>, DraperError> {
        let crossings = |drape: &Drape| drape.certificate.crossings();
        let mut drapes: Vec<Drape> = Vec::with_capacity(bodies.len());
        let mut only_carried = 0;
        for (frame, body) in bodies.iter().enumerate() {
            let may_start_anew = only_carried == 0;
            let last = drapes.last().map(|drape| Last { body: &bodies[frame - 1], drape, may_start_anew });
            let mut drape = self.drape_frame(outfit, body, last)?;
            only_carried = match may_start_anew && crossings(&drape) > 0 {
                true => FRAMES_CARRIED,
                false => only_carried.saturating_sub(1),
            };
            if bodies.len() > 1 {
                drape.slim();
            }
            drapes.push(drape);
            progress(MotionProgress::Draped);
        }
        if !self.settings.resolve {
            return Ok(drapes);
        }
        carry_back(&mut drapes, crossings, |frame, own, after| {
            progress(MotionProgress::Again(frame));
            let last = Last { body: &bodies[frame + 1], drape: after, may_start_anew: false };
            let mut again = self.drape_frame(outfit, &bodies[frame], Some(last))?;
            again.slim();
            if crossings(&again) < crossings(own) {
                std::mem::swap(own, &mut again);
            }
            own.milliseconds += again.milliseconds;
            for (garment, other) in own.garments.iter_mut().zip(&again.garments) {
                garment.resolve_ms += other.resolve_ms;
            }
            Ok::<_, DraperError>(())
        })?;
        Ok(drapes)
    }
}

/// From the last frame to the first: `again` makes better what has crossings, from the frame after it, where that has none.
fn carry_back<T, E>(
    frames: &mut [T],
    crossings: impl Fn(&T) -> usize,
    mut again: impl FnMut(usize, &mut T, &T) -> Result<(), E>,
) -> Result<(), E> {
    for frame in (0..frames.len().saturating_sub(1)).rev() {
        let (own, after) = frames.split_at_mut(frame + 1);
        let (own, after) = (&mut own[frame], &after[0]);
        if crossings(own) > 0 && crossings(after) == 0 {
            again(frame, own, after)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_mended_from_clear_ones_after_them_as_far_as_that_goes() {
        // How many crossings each frame has.
        let mut frames = [5, 4, 3, 0, 2, 0, 7];
        let mut asked = Vec::new();
        let found: Result<(), String> = carry_back(
            &mut frames,
            |crossings| *crossings,
            |frame, own, after| {
                assert_eq!(*after, 0);
                asked.push((frame, *own));
                *own = usize::from(frame == 1);
                Ok(())
            },
        );
        assert!(found.is_ok());
        assert_eq!(asked, [(4, 2), (2, 3), (1, 4)]);
        assert_eq!(frames, [5, 1, 0, 0, 0, 0, 7]);
        let failed = carry_back(&mut frames, |c| *c, |_, _, _| Err("an error comes back"));
        assert_eq!(failed, Err("an error comes back"));
        assert!(carry_back(&mut [0; 0], |c| *c, |_, _, _| Err("none")).is_ok());
    }
}
