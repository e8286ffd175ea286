//! Balls, domes and what is worn on the head: one opening or none.

use super::Kind;
use super::draw::Draw;
use super::shape::Shape;
use std::f64::consts::{PI, TAU};

pub(super) const KINDS: [Kind; 7] = [
    Kind::new("ball", ball),
    Kind::new("ball with a hole", ball_with_a_hole),
    Kind::new("half ball", half_ball),
    Kind::new("beanie", beanie),
    Kind::new("brimmed hat", brimmed_hat),
    Kind::new("cap with a visor", cap),
    Kind::new("hood", hood),
];

/// Where a hat sits: around the forehead (m).
const FOREHEAD: [f64; 3] = [0.0, 0.68, -0.006];

/// Part of a sphere around the y axis from the pole at the top down to `angle`.
fn dome(radius: f64, height: f64, angle: f64, depth: f64, triangles: usize) -> Shape {
    let point = |i: usize| {
        let a = angle * i as f64 / 40.0;
        // Exactly closed at both poles.
        let r = if i == 0 || (i == 40 && angle == PI) { 0.0 } else { radius * a.sin() };
        [r, height * a.cos()]
    };
    let profile: Vec<[f64; 2]> = (0..=40).map(point).collect();
    Shape::lathe(&profile, depth, triangles)
}

/// Somewhere within reach of the hands, or around the trunk (m).
fn near(draw: &mut Draw) -> [f64; 3] {
    match draw.chance(0.3) {
        true => [0.0, draw.between(-0.3, 0.4), 0.0],
        false => [draw.sign() * draw.between(0.3, 0.6), draw.between(-0.8, 0.5), draw.between(-0.1, 0.5)],
    }
}

fn ball(draw: &mut Draw) -> Shape {
    let radius = draw.between(0.05, 0.45);
    let (height, depth) = (radius * draw.between(0.8, 1.25), draw.between(0.8, 1.2));
    let place = near(draw);
    dome(radius, height, PI, depth, draw.triangles).at(place)
}

fn ball_with_a_hole(draw: &mut Draw) -> Shape {
    let radius = draw.between(0.05, 0.45);
    let (angle, depth) = (PI * draw.between(0.7, 0.97), draw.between(0.8, 1.2));
    let place = near(draw);
    let turn = draw.any(&[-1.0, 1.0]);
    dome(radius, radius, angle, depth, draw.triangles).map(|[x, y, z]| [x, turn * y, turn * z]).at(place)
}

fn half_ball(draw: &mut Draw) -> Shape {
    let radius = draw.between(0.08, 0.5);
    let place = near(draw);
    let turn = draw.any(&[-1.0, 1.0]);
    dome(radius, radius, 0.5 * PI, 1.0, draw.triangles).map(|[x, y, z]| [x, turn * y, turn * z]).at(place)
}

fn beanie(draw: &mut Draw) -> Shape {
    let (radius, height) = (draw.between(0.08, 0.1), draw.between(0.1, 0.2));
    dome(radius, height, draw.between(0.5, 0.58) * PI, 1.2, draw.triangles).at(FOREHEAD)
}

fn brimmed_hat(draw: &mut Draw) -> Shape {
    let (r, h, brim) = (draw.between(0.08, 0.095), draw.between(0.08, 0.18), draw.between(0.04, 0.22));
    let sag = draw.between(-0.03, 0.05);
    let profile = [[0.0, h], [0.6 * r, h], [0.9 * r, 0.93 * h], [r, 0.0], [r + brim, -sag]];
    Shape::lathe(&profile, 1.2, draw.triangles.max(500)).at(FOREHEAD)
}

fn cap(draw: &mut Draw) -> Shape {
    let (r, h, visor) = (draw.between(0.08, 0.095), draw.between(0.09, 0.13), draw.between(0.05, 0.09));
    let rows = (draw.triangles as f64 / 4.0).sqrt() as usize;
    Shape::grid([2 * rows, rows], true, |u, v| {
        let (s, c) = (TAU * u).sin_cos();
        let crown = (v / 0.75).min(1.0);
        let out = 0.004 + visor * c.max(0.0).powf(0.7);
        let reach = out * ((v - 0.75) / 0.25).max(0.0);
        let (a, b) = (0.5 * PI * crown).sin_cos();
        [(r * a + 0.3 * reach) * s, h * b - 0.2 * reach, 1.2 * r * a * c + reach * c.max(0.0)]
    })
    .at(FOREHEAD)
}

fn hood(draw: &mut Draw) -> Shape {
    let (radius, angle) = (draw.between(0.11, 0.14), draw.between(0.55, 0.68) * PI);
    let tilt: f64 = draw.between(0.1, 0.5);
    let longer = draw.between(1.0, 1.4);
    let (s, c) = tilt.sin_cos();
    // The pole is at the back of the head.
    let back = |[x, y, z]: [f64; 3]| [x, longer * (c * z + s * y), s * z - c * y];
    dome(radius, radius * 1.1, angle, 1.1, draw.triangles).map(back).at([0.0, 0.64, -0.02])
}
