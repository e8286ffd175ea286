//! Whether two elements stay apart while their vertices move in straight lines: a moving plane between them.
//!
//! With unit vectors n₀ and n₁ at the start and at the end, and D₀ and D₁ the vectors from a corner of one element to a corner of
//! the other, the height of one over the other along (1 − t)·n₀ + t·n₁ is a quadratic in t with the Bernstein coefficients n₀·D₀,
//! ½(n₀·D₁ + n₁·D₀) and n₁·D₁. Where all of them, for all corners, are at least m, both are at least m apart throughout. n₀ and
//! n₁ are the directions between the closest points, so that elements that turn together pass as a whole.

use super::contact_mesh::ElementPair;
use crate::query::closest_on_triangle;
use crate::vec3::{add_scaled, cross, dot, norm, norm_squared, scale, sub};

/// Positions of the four vertices of a pair of elements (m).
pub(crate) type Corners = [[f64; 3]; 4];

/// The shortest vector from the second element of a pair to the first (m).
pub(crate) fn gap_vector(has_face: bool, [a, b, c, d]: &Corners) -> [f64; 3] {
    if has_face {
        return sub(*a, closest_on_triangle(*a, [*b, *c, *d]).position);
    }
    let [s, t] = closest_on_edges([*a, *b], [*c, *d]);
    sub(add_scaled(*a, s, sub(*b, *a)), add_scaled(*c, t, sub(*d, *c)))
}

/// Where two edges are closest, 0–1 on each (Ericson, *Real-Time Collision Detection*, §5.1.9).
pub(crate) fn closest_on_edges([p, q]: [[f64; 3]; 2], [r, s]: [[f64; 3]; 2]) -> [f64; 2] {
    let (first, second, between) = (sub(q, p), sub(s, r), sub(p, r));
    let (a, e) = (norm_squared(first), norm_squared(second));
    let (c, f) = (dot(first, between), dot(second, between));
    let share = |x: f64, of: f64| if of > 0.0 { (x / of).clamp(0.0, 1.0) } else { 0.0 };
    let b = dot(first, second);
    let across = a * e - b * b;
    let on_first = if across > 1e-12 * a * e { ((b * f - c * e) / across).clamp(0.0, 1.0) } else { 0.0 };
    let on_second = if e > 0.0 { (b * on_first + f) / e } else { 0.0 };
    match on_second {
        t if t < 0.0 => [share(-c, a), 0.0],
        t if t > 1.0 => [share(b - c, a), 1.0],
        t => [share(b * t - c, a), t],
    }
}

/// How often a motion is halved where no single plane is found.
const HALVINGS: u32 = 3;
/// Elements nearer than this (m) have no direction from one to the other that rounding leaves right: they stay where they are.
const TOUCHING_ELEMENTS: f64 = 1e-9;
/// A step ends no nearer than this (m), however little room there is: ten times what rounding to f32, or to the digits of an
/// OBJ file, moves a vertex of a person.
pub(super) const NEAREST: f64 = 1e-6;
/// What f64 rounds the distance between elements of a person by, some times (m).
const DISTANCE_ROUNDING: f64 = 1e-14;

/// Whether the elements of `pair` stay apart from `x` to `y`: on the way by `margin`, or half the distance they have at the start
/// where that is less; at the end no less than [`NEAREST`] either, and where they start nearer, no nearer than they start.
pub(crate) fn stay_apart(pair: &ElementPair, x: &Corners, y: &Corners, margin: f64) -> bool {
    if x == y || is_along_axis(pair.first(), x, y, margin.max(NEAREST)) {
        return true;
    }
    let gap = gap_vector(pair.has_face, x);
    let distance = norm(gap);
    if distance < TOUCHING_ELEMENTS {
        return false;
    }
    let least = margin.min(0.5 * distance);
    norm(gap_vector(pair.has_face, y)) >= NEAREST.min(distance - DISTANCE_ROUNDING)
        && is_separated(pair, scale(gap, 1.0 / distance), x, y, least, HALVINGS)
}

fn is_separated(
    pair: &ElementPair,
    start: [f64; 3],
    x: &Corners,
    y: &Corners,
    least: f64,
    halvings: u32,
) -> bool {
    let direction = |corners: &Corners| {
        let gap = gap_vector(pair.has_face, corners);
        let distance = norm(gap);
        (distance >= least).then(|| scale(gap, 1.0 / distance))
    };
    let end = direction(y);
    if end.is_some_and(|end| is_plane(pair, [start, end], x, y, least))
        || is_plane(pair, [start, start], x, y, least)
    {
        return true;
    }
    if halvings == 0 || end.is_none() {
        return false;
    }
    let middle: Corners = std::array::from_fn(|k| scale(add_scaled(x[k], 1.0, y[k]), 0.5));
    let Some(between) = direction(&middle) else { return false };
    is_separated(pair, start, x, &middle, least, halvings - 1)
        && is_separated(pair, between, &middle, y, least, halvings - 1)
}

/// Whether the plane that turns from `n0` to `n1` keeps the elements apart.
#[inline]
fn is_plane(pair: &ElementPair, [n0, n1]: [[f64; 3]; 2], x: &Corners, y: &Corners, least: f64) -> bool {
    let first = pair.first();
    (0..first).all(|i| {
        (first..4).all(|j| {
            let (d0, d1) = (sub(x[i], x[j]), sub(y[i], y[j]));
            dot(n0, d0) >= least && dot(n1, d1) >= least && 0.5 * (dot(n0, d1) + dot(n1, d0)) >= least
        })
    })
}

/// Whether a plane across an axis keeps the elements `margin` apart, as it does for most: cheaper than their closest points.
#[inline]
fn is_along_axis(first: usize, x: &Corners, y: &Corners, margin: f64) -> bool {
    let range = |corners: &[[f64; 3]], k: usize| {
        let start = (f64::INFINITY, f64::NEG_INFINITY);
        corners.iter().fold(start, |(low, high), p| (low.min(p[k]), high.max(p[k])))
    };
    (0..3).any(|k| {
        let [(a_low, a_high), (c_low, c_high)] = [x, y].map(|corners| range(&corners[..first], k));
        let [(b_low, b_high), (d_low, d_high)] = [x, y].map(|corners| range(&corners[first..], k));
        a_low - b_high >= margin && c_low - d_high >= margin
            || b_low - a_high >= margin && d_low - c_high >= margin
    })
}

/// Corners of two triangles (m).
pub(crate) type TrianglePair = [[[f64; 3]; 3]; 2];

/// Whether the plane of one of two triangles, or the one across the line between their middles, keeps them `margin` apart all the
/// way from `x` to `y` as it turns: true of most sheets that lie over each other, and of most triangles beside each other in a
/// sheet, and it says so of all their elements at once. `false` says nothing.
pub(crate) fn triangles_stay_apart(x: &TrianglePair, y: &TrianglePair, margin: f64) -> bool {
    let turns = |at_start: Option<[f64; 3]>, at_end: Option<[f64; 3]>| {
        at_start.zip(at_end).is_some_and(|normals| is_between(normals.into(), x, y, margin))
    };
    turns(between_middles(x), between_middles(y))
        || turns(unit_normal(&x[0]), unit_normal(&y[0]))
        || turns(unit_normal(&x[1]), unit_normal(&y[1]))
}

/// Whether the plane that turns from `n0` to `n1` keeps two triangles `margin` apart, whichever is over it.
#[inline(always)]
fn is_between([n0, n1]: [[f64; 3]; 2], x: &TrianglePair, y: &TrianglePair, margin: f64) -> bool {
    // Bernstein coefficients of the heights of all corners.
    let mut heights = [[[0.0; 3]; 2]; 3];
    for t in 0..2 {
        for i in 0..3 {
            let (p, q) = (x[t][i], y[t][i]);
            heights[0][t][i] = dot(n0, p);
            heights[1][t][i] = dot(n1, q);
            heights[2][t][i] = 0.5 * (dot(n0, q) + dot(n1, p));
        }
    }
    let low = |h: &[f64; 3]| h[0].min(h[1]).min(h[2]);
    let high = |h: &[f64; 3]| h[0].max(h[1]).max(h[2]);
    heights.iter().all(|[a, b]| low(a) - high(b) >= margin)
        || heights.iter().all(|[a, b]| low(b) - high(a) >= margin)
}

/// The direction from the middle of the second triangle to that of the first.
fn between_middles([a, b]: &TrianglePair) -> Option<[f64; 3]> {
    let middle = |t: &[[f64; 3]; 3]| std::array::from_fn(|k| t[0][k] + t[1][k] + t[2][k]);
    let between: [f64; 3] = sub(middle(a), middle(b));
    let length = norm(between);
    (length > TOUCHING_ELEMENTS).then(|| scale(between, 1.0 / length))
}

fn unit_normal([a, b, c]: &[[f64; 3]; 3]) -> Option<[f64; 3]> {
    let area = cross(sub(*b, *a), sub(*c, *a));
    let length = norm(area);
    (length > 1e-12).then(|| scale(area, 1.0 / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;
    use crate::vec3::add;

    fn at(x: &Corners, y: &Corners, t: f64) -> Corners {
        std::array::from_fn(|k| add_scaled(x[k], t, sub(y[k], x[k])))
    }

    fn random_pair(random: &mut SplitMix, size: f64) -> [Corners; 2] {
        let x: Corners = std::array::from_fn(|_| std::array::from_fn(|_| random.symmetric()));
        let y = x.map(|p| add(p, std::array::from_fn(|_| size * random.symmetric())));
        [x, y]
    }

    #[test]
    fn the_closest_places_of_two_edges_beat_a_dense_sampling() {
        let mut random = SplitMix::new(4);
        for round in 0..300 {
            let [mut x, _] = random_pair(&mut random, 0.0);
            if round % 3 == 0 {
                // Parallel.
                x[3] = add(x[2], scale(sub(x[1], x[0]), random.symmetric()));
            }
            let found = norm(gap_vector(false, &x));
            let place = |p: [f64; 3], q: [f64; 3], i: u32| add_scaled(p, f64::from(i) / 50.0, sub(q, p));
            let all = (0..=50).flat_map(|i| (0..=50).map(move |j| (i, j)));
            let best = all
                .map(|(i, j)| norm(sub(place(x[0], x[1], i), place(x[2], x[3], j))))
                .fold(f64::INFINITY, f64::min);
            assert!(found <= best + 1e-9 && found > best - 0.1, "{found} {best}");
        }
    }

    #[test]
    fn what_passes_stays_apart_at_every_time() {
        let mut random = SplitMix::new(9);
        let mut passed = 0;
        for round in 0..4000 {
            let [x, y] = random_pair(&mut random, [0.05, 0.4, 2.0][round % 3]);
            let pair = ElementPair { vertices: [0, 1, 2, 3], has_face: round % 2 == 0 };
            let before = norm(gap_vector(pair.has_face, &x));
            if stay_apart(&pair, &x, &y, 0.01) {
                passed += 1;
                let nearest = (0..=64)
                    .map(|i| norm(gap_vector(pair.has_face, &at(&x, &y, f64::from(i) / 64.0))))
                    .fold(f64::INFINITY, f64::min);
                assert!(nearest >= 0.01_f64.min(0.5 * before) - 1e-12);
            }
        }
        assert!((1000..3900).contains(&passed), "{passed}");
    }

    /// Steps that press elements together bring them no nearer than a micrometre, and those that start nearer no nearer than
    /// that: rounded to f32 they are still apart.
    #[test]
    fn elements_keep_what_rounding_needs() {
        let place = [0.7, 1.6, 0.3];
        for (start, kept) in [(3e-6, NEAREST), (8e-7, 8e-7), (4e-7, 4e-7)] {
            for has_face in [true, false] {
                let below = [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.0, 0.02, 0.0]];
                let x: Corners = match has_face {
                    true => [[5e-3, 5e-3, start], below[0], below[1], below[2]],
                    false => [[5e-3, -0.01, start], [5e-3, 0.01, start], below[0], below[1]],
                };
                let pair = ElementPair { vertices: [0, 1, 2, 3], has_face };
                let mut x = x.map(|p| add(p, place));
                for step in 0..1500 {
                    // A turn about the vertical with the pressure, so that distances are rounded.
                    let mut y = x.map(|p| add(p, scale([1e-3, -1e-3, 0.0], f64::from(step % 3 - 1))));
                    y[..pair.first()].iter_mut().for_each(|p| p[2] -= 1e-3 * start);
                    match stay_apart(&pair, &x, &y, 5e-5) {
                        true => x = y,
                        false => y[..pair.first()].iter_mut().zip(&x).for_each(|(p, q)| p[2] = q[2]),
                    }
                }
                let distance = norm(gap_vector(has_face, &x));
                assert!(distance >= kept - 1e-10 && distance < kept + 1.1e-3 * start, "{start}: {distance}");
                let rounded = x.map(|p| p.map(|x| f64::from(x as f32)));
                assert!(rounded[..pair.first()].iter().all(|p| p[2] > rounded[3][2]), "{rounded:?}");
            }
        }
        // Touching elements stay where they are, even as one.
        let x = [[0.2, 0.2, 1e-10], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let pair = ElementPair { vertices: [0, 1, 2, 3], has_face: true };
        assert!(stay_apart(&pair, &x, &x, 5e-5));
        assert!(!stay_apart(&pair, &x, &x.map(|p| add(p, [0.1, 0.0, 0.0])), 5e-5));
    }

    #[test]
    fn rigid_motion_and_rest_pass_and_going_through_does_not() {
        let x = [[0.2, 0.2, 1e-4], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let pair = ElementPair { vertices: [0, 1, 2, 3], has_face: true };
        let (sin, cos) = 0.5_f64.sin_cos();
        let turned = x.map(|[x, y, z]| [x + 0.7, cos * y - sin * z, sin * y + cos * z]);
        assert!(stay_apart(&pair, &x, &turned, 5e-5) && stay_apart(&pair, &x, &x, 5e-5));
        let mut through = x;
        through[0][2] = -1e-4;
        assert!(!stay_apart(&pair, &x, &through, 5e-5));
        // Beside the face it may.
        through[0][0] = 3.0;
        let mut beside = x;
        beside[0][0] = 3.0;
        assert!(stay_apart(&pair, &beside, &through, 5e-5));
    }

    #[test]
    fn triangles_that_pass_as_a_whole_pass_by_their_elements() {
        let mut random = SplitMix::new(11);
        // Over each other, and beside each other.
        let mut passed = [0, 0];
        for round in 0..3000 {
            let (aside, lift) = [(0.0, 0.5), (2.0, 0.0)][round % 2];
            let mut triangle = |share: f64| -> [[f64; 3]; 3] {
                std::array::from_fn(|_| {
                    let flat = [random.symmetric() + share * aside, random.symmetric()];
                    [flat[0], flat[1], share * lift + 0.2 * random.symmetric()]
                })
            };
            let (a, b, c, d) = (triangle(1.0), triangle(0.0), triangle(1.0), triangle(0.1));
            if triangles_stay_apart(&[a, b], &[c, d], 0.05) {
                passed[round % 2] += 1;
                for i in 0..=64 {
                    let t = f64::from(i) / 64.0;
                    let between = |p: &[[f64; 3]; 3], q: &[[f64; 3]; 3]| {
                        std::array::from_fn(|k| add_scaled(p[k], t, sub(q[k], p[k])))
                    };
                    let (one, other) = (between(&a, &c), between(&b, &d));
                    assert!(!crate::contact::triangles_intersect(&one, &other));
                }
            }
        }
        assert!(passed.iter().all(|count| *count > 300), "{passed:?}");
    }
}
