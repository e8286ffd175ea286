//! Curves through a few points, with a radius.

use clothcombo_physics::vec3::{cross, dot, norm, scale, sub};

/// A point of a tube's axis and the tube's radius there (m).
pub(super) type Knot = [f64; 4];

fn mix(a: Knot, b: Knot, t: f64) -> Knot {
    std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
}

fn distance(a: Knot, b: Knot) -> f64 {
    (0..4).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Length, changes of the radius included (m).
pub(super) fn length(knots: &[Knot]) -> f64 {
    knots.windows(2).map(|k| distance(k[0], k[1])).sum()
}

/// Cut at the corners three times; the ends stay.
pub(super) fn rounded(knots: &[Knot]) -> Vec<Knot> {
    let mut knots = knots.to_vec();
    for _ in 0..3 {
        let cut = knots.windows(2).flat_map(|k| [mix(k[0], k[1], 0.25), mix(k[0], k[1], 0.75)]);
        knots = [knots[0]].into_iter().chain(cut).chain(knots.last().copied()).collect();
    }
    knots
}

/// `count + 1` points at equal distances along a polygon.
pub(super) fn resample(knots: &[Knot], count: usize) -> Vec<Knot> {
    let total = length(knots);
    let (mut segment, mut before) = (0, 0.0);
    let mut at = |i: usize| {
        let wanted = total * i as f64 / count as f64;
        loop {
            let here = distance(knots[segment], knots[segment + 1]);
            if before + here >= wanted || segment + 2 == knots.len() {
                let t = if here > 0.0 { ((wanted - before) / here).clamp(0.0, 1.0) } else { 0.0 };
                return mix(knots[segment], knots[segment + 1], t);
            }
            (segment, before) = (segment + 1, before + here);
        }
    };
    let mut points: Vec<Knot> = (0..=count).map(&mut at).collect();
    points[count] = knots[knots.len() - 1];
    points
}

/// Two directions across the curve at each point, turning as little as possible.
pub(super) fn frames(rows: &[Knot]) -> Vec<[[f64; 3]; 2]> {
    let point = |i: usize| [rows[i][0], rows[i][1], rows[i][2]];
    let last = rows.len() - 1;
    let unit = |v: [f64; 3]| scale(v, 1.0 / norm(v).max(1e-12));
    let along = |i: usize| unit(sub(point((i + 1).min(last)), point(i.saturating_sub(1))));
    let first = along(0);
    let thinnest = (0..3).min_by(|a, b| first[*a].abs().total_cmp(&first[*b].abs())).unwrap_or(0);
    let mut side = [0.0; 3];
    side[thinnest] = 1.0;
    let frame = |i: usize| {
        let t = along(i);
        side = unit(sub(side, scale(t, dot(side, t))));
        [side, cross(t, side)]
    };
    (0..rows.len()).map(frame).collect()
}
