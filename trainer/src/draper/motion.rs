//! A motion: each frame carries on from the one before, and what that leaves over from the one after.

use super::{BodyState, Drape, Draper, DraperError, FRAMES_WITHOUT_WAY, Outfit};

impl Draper {
    /// Drapes `outfit` on each of `bodies`, the frames of a motion. The post-process carries on from frame to frame; where frames
    /// are left with crossings and a later one is clear, it carries on backwards from that one as well. `done` is called after
    /// each frame.
    ///
    /// # Errors
    /// When shape or pose do not fit the body model, or the networks diverge.
    pub fn drape_motion(
        &self,
        outfit: &Outfit,
        bodies: &[BodyState],
        mut done: impl FnMut(),
    ) -> Result<Vec<Drape>, DraperError> {
        let mut drapes: Vec<Drape> = Vec::with_capacity(bodies.len());
        for (frame, body) in bodies.iter().enumerate() {
            let before = drapes.last().map(|drape| (&bodies[frame - 1], drape));
            let mut drape = self.drape_frame(outfit, body, before)?;
            if bodies.len() > 1 {
                drape.slim();
            }
            drapes.push(drape);
            done();
        }
        carry_back(
            &mut drapes,
            |drape| drape.certificate.is_clear(),
            |frame, drape, after| {
                // The way from the T-pose has been tried.
                after.frames_without_way = FRAMES_WITHOUT_WAY;
                let mut again =
                    self.drape_frame(outfit, &bodies[frame], Some((&bodies[frame + 1], after)))?;
                again.milliseconds += drape.milliseconds;
                again.slim();
                Ok::<_, DraperError>(again)
            },
        )?;
        Ok(drapes)
    }
}

/// From the last frame to the first: one that is not clear is made `again` from a clear one after it, and replaced if that
/// makes it clear.
fn carry_back<T, E>(
    frames: &mut [T],
    is_clear: impl Fn(&T) -> bool,
    mut again: impl FnMut(usize, &T, &mut T) -> Result<T, E>,
) -> Result<(), E> {
    for frame in (1..frames.len()).rev().map(|after| after - 1) {
        let [own, after] = &mut frames[frame..=frame + 1] else { continue };
        if is_clear(own) || !is_clear(after) {
            continue;
        }
        let made = again(frame, own, after)?;
        if is_clear(&made) {
            *own = made;
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
            |crossings| *crossings == 0,
            |frame, own, after| {
                assert_eq!(*after, 0);
                asked.push((frame, *own));
                Ok(if frame == 1 { 9 } else { 0 })
            },
        );
        assert!(found.is_ok());
        assert_eq!(asked, [(4, 2), (2, 3), (1, 4)]);
        assert_eq!(frames, [5, 4, 0, 0, 0, 0, 7]);
        let failed = carry_back(&mut frames, |c| *c == 0, |_, _, _| Err("an error comes back"));
        assert!(failed.is_err());
        assert!(carry_back(&mut [0; 0], |_| true, |_, _, _| Err("none")).is_ok());
    }
}
