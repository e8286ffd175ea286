//! Temporal smoothing of a motion that makes no intersection and no excess strain.
//!
//! What is smoothed is each vertex's offset from linear blend skinning in the frame of its own skinning transform, so that
//! cloth that merely follows the body stays as it is. Every smoothed frame is counted exactly; where it intersects more than the
//! frame as it was, or has more excess strain, less of the smoothing is applied, and none if need be.

use super::drape::Drape;
use super::draper::Draper;
use super::outfit::Outfit;
use clothcombo_physics::transform::{Transform, into_frame, out_of_frame};
use clothcombo_physics::vec3::{add, scale, sub};
use miette::Report;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Shares of the smoothing that are tried, in this order.
const SMOOTHING_SHARES: [f64; 3] = [1.0, 0.5, 0.25];

/// Most frames to each side: at 60 frames a second all that moves in three seconds would be averaged.
pub const MOST_RADIUS: u16 = 100;

/// What smoothing did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Smoothing {
    /// Frames to each side that are averaged, by binomial weights.
    pub radius: usize,
    /// Frames that were smoothed wholly.
    pub whole: usize,
    /// Frames that were smoothed in part.
    pub partly: usize,
    /// Frames that were left as they were, because smoothing would have made intersections or excess strain.
    pub left: usize,
}

/// Smooths `drapes`, consecutive frames of one motion, over `radius` frames to each side.
///
/// # Errors
/// When a state cannot be counted: a garment has exploded.
pub fn smooth(
    draper: &Draper,
    outfit: &Outfit,
    drapes: &mut [Drape],
    radius: usize,
) -> Result<Smoothing, Report> {
    let mut done = Smoothing { radius, whole: 0, partly: 0, left: 0 };
    if radius == 0 || drapes.len() < 2 {
        done.left = drapes.len();
        return Ok(done);
    }
    let of_drape = |drape: &Drape| -> Vec<Vec<[f64; 3]>> {
        let garments = drape.garments.iter();
        garments.map(|g| local_offsets(&g.positions, &g.skinned, &g.transforms)).collect()
    };
    let offsets: Vec<_> = drapes.par_iter().map(of_drape).collect();
    let weights = binomial(radius);
    let smoothed: Vec<Option<(usize, Drape)>> = (0..drapes.len())
        .into_par_iter()
        .map(|frame| smoothed_frame(draper, outfit, drapes, &offsets, frame, &weights))
        .collect::<Result<_, _>>()?;
    for (drape, smoothed) in drapes.iter_mut().zip(smoothed) {
        match smoothed {
            Some((share, better)) => {
                *drape = better;
                *(if share == 0 { &mut done.whole } else { &mut done.partly }) += 1;
            }
            None => done.left += 1,
        }
    }
    Ok(done)
}

/// The frame with as much smoothing as makes no intersection, and which share that is; `None` for none at all.
fn smoothed_frame(
    draper: &Draper,
    outfit: &Outfit,
    drapes: &[Drape],
    offsets: &[Vec<Vec<[f64; 3]>>],
    frame: usize,
    weights: &[f64],
) -> Result<Option<(usize, Drape)>, Report> {
    let drape = &drapes[frame];
    let wanted: Vec<Vec<[f64; 3]>> = drape
        .garments
        .iter()
        .enumerate()
        .map(|(g, garment)| {
            let mean = averaged(|other| &offsets[other][g], offsets.len(), frame, weights);
            from_offsets(&garment.skinned, &garment.transforms, mean)
        })
        .collect();
    for (number, share) in SMOOTHING_SHARES.into_iter().enumerate() {
        let mut candidate = drape.clone();
        for (garment, wanted) in candidate.garments.iter_mut().zip(&wanted) {
            let towards = |(p, w): (&[f64; 3], &[f64; 3])| add(*p, scale(sub(*w, *p), share));
            garment.positions = garment.positions.iter().zip(wanted).map(towards).collect();
        }
        candidate.settle(draper, outfit)?;
        let (now, before) = (&candidate.certificate, &drape.certificate);
        let is_no_worse = now.body_triangle_pairs <= before.body_triangle_pairs
            && now.layer_triangle_pairs <= before.layer_triangle_pairs
            && now.self_triangle_pairs <= before.self_triangle_pairs
            && now.excess_strain() <= before.excess_strain()
            && now.defects() <= before.defects();
        if is_no_worse {
            return Ok(Some((number, candidate)));
        }
    }
    Ok(None)
}

/// Binomial weights −radius…radius, not yet normalised.
pub(super) fn binomial(radius: usize) -> Vec<f64> {
    let mut row = vec![1.0];
    for _ in 0..2 * radius {
        row = std::iter::once(1.0)
            .chain(row.windows(2).map(|pair| pair[0] + pair[1]))
            .chain(std::iter::once(1.0))
            .collect();
    }
    row
}

/// The mean of `offsets` around `frame` of `count`.
pub(super) fn averaged<'a>(
    offsets: impl Fn(usize) -> &'a Vec<[f64; 3]>,
    count: usize,
    frame: usize,
    weights: &[f64],
) -> Vec<[f64; 3]> {
    let radius = weights.len() / 2;
    let mut sum = vec![[0.0; 3]; offsets(frame).len()];
    let mut total = 0.0;
    // Symmetric about the frame also near the ends, so that steady movement stays where it is.
    let reach = radius.min(frame).min(count - 1 - frame);
    for other in frame - reach..=frame + reach {
        let weight = weights[radius + other - frame];
        total += weight;
        for (sum, offset) in sum.iter_mut().zip(offsets(other)) {
            *sum = add(*sum, scale(*offset, weight));
        }
    }
    sum.into_iter().map(|s| scale(s, 1.0 / total)).collect()
}

/// Offsets of `positions` from skinning, each in the frame of its skinning transform.
pub(super) fn local_offsets(
    positions: &[[f64; 3]],
    skinned: &[[f64; 3]],
    transforms: &[Transform],
) -> Vec<[f64; 3]> {
    let vertices = positions.iter().zip(skinned).zip(transforms);
    vertices.map(|((p, start), transform)| into_frame(transform, sub(*p, *start))).collect()
}

/// The positions that have these [`local_offsets`].
pub(super) fn from_offsets(
    skinned: &[[f64; 3]],
    transforms: &[Transform],
    offsets: Vec<[f64; 3]>,
) -> Vec<[f64; 3]> {
    let vertices = skinned.iter().zip(transforms).zip(offsets);
    vertices.map(|((start, transform), offset)| add(*start, out_of_frame(transform, offset))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_binomial() {
        assert_eq!(binomial(2), [1.0, 4.0, 6.0, 4.0, 1.0]);
    }

    #[test]
    fn steady_movement_stays_and_a_jerk_is_damped() {
        let line = |f: usize| vec![[f as f64, -2.0 * f as f64, 1.0]];
        let mut offsets: Vec<_> = (0..7).map(line).collect();
        for frame in 0..7 {
            assert_eq!(averaged(|other| &offsets[other], 7, frame, &binomial(2)), line(frame));
        }
        offsets[3][0][0] += 1.6;
        let jerk = averaged(|other| &offsets[other], 7, 3, &binomial(2))[0][0] - 3.0;
        assert!((jerk - 0.6).abs() < 1e-12, "{jerk}");
    }
}
