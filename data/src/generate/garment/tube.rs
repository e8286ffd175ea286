//! A tube around one bone axis: convex star-shaped outlines, one per slice.

use super::super::field::smooth_step;

/// Directions per outline.
const DIRECTIONS: usize = 32;
/// Distance between slices (m).
const TUBE_SLICE: f64 = 0.015;

/// Outlines along a coordinate axis. In slice coordinates a point is `(s, u, v)`: `s = side · p[axis]`, and `u`, `v` the
/// other two axes in cyclic order.
#[derive(Debug, Clone)]
pub(crate) struct Tube {
    axis: usize,
    side: f64,
    start: f64,
    /// Middle of each slice in (u, v).
    pub centres: Vec<[f64; 2]>,
    /// Radius (m) per slice and direction.
    pub radii: Vec<[f64; DIRECTIONS]>,
}

impl Tube {
    /// Measures the points slice by slice. With `symmetric` the slices stay centred at x = 0.
    ///
    /// Outlines come from support functions, so that they are convex and need few points. `None` if the points span less
    /// than three slices.
    pub fn measure(
        points: &[[f64; 3]],
        axis: usize,
        side: f64,
        range: [f64; 2],
        symmetric: bool,
    ) -> Option<Self> {
        let count = ((range[1] - range[0]) / TUBE_SLICE).floor();
        if !(3.0..=2000.0).contains(&count) {
            return None;
        }
        let count = count as usize + 1;
        let mut tube = Self { axis, side, start: range[0], centres: Vec::new(), radii: Vec::new() };
        let mut slices: Vec<Vec<[f64; 2]>> = vec![Vec::new(); count];
        for p in points {
            let (s, u, v) = tube.coordinates(*p);
            // Each point serves every slice within reach, which bridges coarse bodies.
            let reach = 1.2;
            let at = (s - range[0]) / TUBE_SLICE;
            let first = (at - reach).ceil().max(0.0) as usize;
            let last = (at + reach).floor();
            if last < 0.0 {
                continue;
            }
            for slice in slices.iter_mut().take((last as usize + 1).min(count)).skip(first) {
                slice.push([u, v]);
            }
        }
        let filled: Vec<usize> = (0..count).filter(|k| slices[*k].len() >= 4).collect();
        if filled.len() < 3 {
            return None;
        }
        // Slices without points (the ends) repeat the nearest measured one.
        let source = |k: usize| filled[filled.partition_point(|f| *f < k).min(filled.len() - 1)];
        for k in 0..count {
            let points = &slices[source(k)];
            let middle = |c: usize| {
                let low = points.iter().map(|p| p[c]).fold(f64::MAX, f64::min);
                let high = points.iter().map(|p| p[c]).fold(f64::MIN, f64::max);
                0.5 * (low + high)
            };
            // For a vertical tube (axis y) the cyclic order is u = z, v = x.
            tube.centres.push([middle(0), if symmetric { 0.0 } else { middle(1) }]);
        }
        for _ in 0..3 {
            smooth_slices(&mut tube.centres);
        }
        for k in 0..count {
            let centre = tube.centres[k];
            let support: [f64; DIRECTIONS] = std::array::from_fn(|i| {
                let (sin, cos) = angle(i).sin_cos();
                slices[source(k)]
                    .iter()
                    .map(|p| (p[0] - centre[0]) * cos + (p[1] - centre[1]) * sin)
                    .fold(0.01, f64::max)
            });
            tube.radii.push(std::array::from_fn(|i| {
                (0..DIRECTIONS)
                    .filter_map(|j| {
                        let cos = (angle(i) - angle(j)).cos();
                        (cos > 0.2).then(|| support[j] / cos)
                    })
                    .fold(f64::MAX, f64::min)
            }));
        }
        for _ in 0..2 {
            smooth_slices(&mut tube.radii);
            for row in &mut tube.radii {
                let old = *row;
                for i in 0..DIRECTIONS {
                    let (before, after) = (old[(i + DIRECTIONS - 1) % DIRECTIONS], old[(i + 1) % DIRECTIONS]);
                    row[i] = 0.25 * before + 0.5 * old[i] + 0.25 * after;
                }
            }
        }
        Some(tube)
    }

    fn coordinates(&self, p: [f64; 3]) -> (f64, f64, f64) {
        (self.side * p[self.axis], p[(self.axis + 1) % 3], p[(self.axis + 2) % 3])
    }

    /// The coordinate `s` of a slice.
    pub fn position(&self, slice: usize) -> f64 {
        self.start + TUBE_SLICE * slice as f64
    }

    fn locate(&self, s: f64) -> (usize, f64) {
        let last = self.centres.len() - 1;
        let at = ((s - self.start) / TUBE_SLICE).clamp(0.0, last as f64);
        let k = (at as usize).min(last - 1);
        (k, at - k as f64)
    }

    /// Middle of the tube at `s`, in (u, v).
    pub fn centre(&self, s: f64) -> [f64; 2] {
        let (k, t) = self.locate(s);
        std::array::from_fn(|c| self.centres[k][c] + t * (self.centres[k + 1][c] - self.centres[k][c]))
    }

    /// Radius at `s` in the direction of `(u, v)` from the centre.
    pub fn radius(&self, s: f64, u: f64, v: f64) -> f64 {
        self.radius_at(s, v.atan2(u))
    }

    fn radius_at(&self, s: f64, angle: f64) -> f64 {
        let (k, t) = self.locate(s);
        let turn = angle / std::f64::consts::TAU * DIRECTIONS as f64;
        let turn = if turn < 0.0 { turn + DIRECTIONS as f64 } else { turn };
        let i = turn as usize % DIRECTIONS;
        let j = (i + 1) % DIRECTIONS;
        let r = turn.fract();
        let low = self.radii[k][i] + r * (self.radii[k][j] - self.radii[k][i]);
        let high = self.radii[k + 1][i] + r * (self.radii[k + 1][j] - self.radii[k + 1][i]);
        low + t * (high - low)
    }

    /// Distance-like value to the tube's side (m), negative inside; the ends are open.
    pub fn value(&self, p: [f64; 3]) -> f64 {
        self.value_of_wider(p, |_, _, _| 0.0)
    }

    /// As [`Self::value`] for a tube whose radius at `(s, direction angle, own radius)` is larger by `extra`: for detail that the
    /// stored directions are too few for.
    pub fn value_of_wider(&self, p: [f64; 3], extra: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let (s, u, v) = self.coordinates(p);
        let [cu, cv] = self.centre(s);
        let (du, dv) = (u - cu, v - cv);
        let angle = dv.atan2(du);
        let radius = self.radius_at(s, angle);
        du.hypot(dv) - radius - extra(s, angle, radius)
    }

    /// Replaces every radius by `outline(s, direction angle, radius)`.
    pub fn map(mut self, mut outline: impl FnMut(f64, f64, f64) -> f64) -> Self {
        for k in 0..self.radii.len() {
            let s = self.position(k);
            for i in 0..DIRECTIONS {
                self.radii[k][i] = outline(s, angle(i), self.radii[k][i]);
            }
        }
        self
    }

    /// Replaces every radius by `outline(s, radius, radius of other)`; `other` has the same slices.
    pub fn map_with(mut self, other: &Self, outline: impl Fn(f64, f64, f64) -> f64) -> Self {
        for k in 0..self.radii.len() {
            let s = self.position(k);
            for (radius, limb) in self.radii[k].iter_mut().zip(&other.radii[k]) {
                *radius = outline(s, *radius, *limb);
            }
        }
        self
    }

    /// Lets the outline hang: going down from slice `from` (to lower `s`), radii shrink only by the share `1 − hang` of what
    /// the body does.
    pub fn hang(mut self, from: f64, hang: impl Fn(f64) -> f64) -> Self {
        let mut widest = [0.0f64; DIRECTIONS];
        for k in (0..self.radii.len()).rev() {
            let s = self.position(k);
            let share = hang(s);
            for i in 0..DIRECTIONS {
                let r = self.radii[k][i];
                if s <= from {
                    widest[i] = widest[i].max(r);
                    // Fades in over the first 5 cm so that the start leaves no ledge.
                    let fade = smooth_step(from, from - 0.05, s);
                    self.radii[k][i] = r + share * fade * (widest[i] - r);
                }
            }
        }
        smooth_slices(&mut self.radii);
        self
    }
}

/// Angle of direction `i` in the (u, v) plane.
pub(crate) fn angle(i: usize) -> f64 {
    i as f64 * std::f64::consts::TAU / DIRECTIONS as f64
}

/// One binomial smoothing step along the slices.
fn smooth_slices<const N: usize>(rows: &mut [[f64; N]]) {
    let old = rows.to_vec();
    let last = rows.len() - 1;
    for k in 0..rows.len() {
        let (before, after) = (&old[k.saturating_sub(1)], &old[(k + 1).min(last)]);
        for c in 0..N {
            rows[k][c] = 0.25 * before[c] + 0.5 * old[k][c] + 0.25 * after[c];
        }
    }
}
