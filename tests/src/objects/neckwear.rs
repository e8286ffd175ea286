//! Rings and strips of cloth around the neck, the head or the waist.

use super::Kind;
use super::draw::Draw;
use super::shape::Shape;
use clothcombo_physics::vec3::{add, cross, norm, scale, sub};
use std::f64::consts::{PI, TAU};

pub(super) const KINDS: [Kind; 5] = [
    Kind::new("belt", belt),
    Kind::new("headband", headband),
    Kind::small("scarf as a ring", scarf_ring),
    Kind::new("scarf as a strip", scarf_strip),
    Kind::small("choker", choker),
];

/// An open ring of cloth of this height (m), half as wide and deep as `radii` (m).
fn ring(radii: [f64; 2], height: f64, triangles: usize) -> Shape {
    let rows = ((triangles as f64 / 2.0 * height / (TAU * radii[0])).sqrt() as usize).max(2);
    Shape::grid([(triangles / 2 / rows).max(12), rows], true, |u, v| {
        let (s, c) = (TAU * u).sin_cos();
        [radii[0] * s, height * (v - 0.5), radii[1] * c]
    })
}

fn belt(draw: &mut Draw) -> Shape {
    let slack = draw.between(0.003, 0.025);
    let (height, y) = (draw.between(0.03, 0.06), draw.between(0.02, 0.16));
    ring([0.145 + slack, 0.105 + slack], height, draw.triangles).at([0.0, y, 0.0])
}

fn headband(draw: &mut Draw) -> Shape {
    let slack = draw.between(0.002, 0.01);
    let height = draw.between(0.03, 0.07);
    ring([0.076 + slack, 0.096 + slack], height, draw.triangles).at([0.0, 0.7, -0.006])
}

fn scarf_ring(draw: &mut Draw) -> Shape {
    let (radius, height, fold) =
        (draw.between(0.075, 0.11), draw.between(0.15, 0.25), draw.between(0.0, 0.012));
    let folds = draw.between(30.0, 70.0);
    // Folds run around the neck.
    let bulged = |[x, y, z]: [f64; 3]| {
        let out = 1.0 + fold * (folds * y).sin() / radius;
        [x * out, y, z * out]
    };
    ring([radius, 1.05 * radius], height, draw.triangles).map(bulged).at([0.0, 0.52, -0.01])
}

fn scarf_strip(draw: &mut Draw) -> Shape {
    let (radius, width) = (draw.between(0.085, 0.12), draw.between(0.12, 0.22));
    let ends = [draw.between(0.2, 0.6), draw.between(0.2, 0.6)];
    let total = ends[0] + ends[1] + PI * radius;
    // Down the front on the right, around the back of the neck, down the front on the left.
    let axis = move |s: f64| {
        let along = s - ends[0];
        let angle = (along / radius).clamp(0.0, PI);
        let hangs = (-along).max(along - PI * radius).max(0.0);
        let near = hangs.min(0.1);
        [-radius * angle.cos(), 0.5 - hangs, 0.05 - radius * angle.sin() + 0.9 * near]
    };
    Shape::sheet(width, total, draw.triangles.max(400), move |across, along| {
        let s = along + 0.5 * total;
        let (point, step) = (axis(s), 0.01);
        let tangent = sub(axis((s + step).min(total)), axis((s - step).max(0.0)));
        let side = cross(tangent, [point[0], 0.0, point[2]]);
        add(point, scale(side, across / norm(side).max(1e-9)))
    })
}

fn choker(draw: &mut Draw) -> Shape {
    let slack = draw.between(0.002, 0.008);
    ring([0.055 + slack, 0.058 + slack], draw.between(0.015, 0.04), draw.triangles).at([0.0, 0.54, -0.015])
}
