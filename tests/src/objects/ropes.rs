//! Ropes, rings and ribbons.

use super::Kind;
use super::curve::Knot;
use super::draw::Draw;
use super::shape::Shape;
use std::f64::consts::TAU;

pub(super) const KINDS: [Kind; 6] = [
    Kind::new("straight rope", straight_rope),
    Kind::new("helix of rope", helix),
    Kind::new("knotted rope", knotted_rope),
    Kind::new("torus", torus),
    Kind::new("hula hoop", hula_hoop),
    Kind::new("ribbon", ribbon),
];

/// An open tube along `count + 1` points of a curve (m).
fn rope(count: usize, radius: f64, triangles: usize, at: impl Fn(f64) -> [f64; 3]) -> Shape {
    let knot = |i: usize| {
        let [x, y, z] = at(i as f64 / count as f64);
        [x, y, z, radius]
    };
    let knots: Vec<Knot> = (0..=count).map(knot).collect();
    Shape::tube(&knots, triangles.max(1000))
}

fn straight_rope(draw: &mut Draw) -> Shape {
    let (radius, length, bend) = (draw.between(0.005, 0.02), draw.between(1.0, 3.0), draw.between(0.0, 0.1));
    let lies = draw.chance(0.5);
    let x = draw.sign() * draw.between(0.2, 0.5);
    rope(24, radius, draw.triangles, |t| {
        let (along, across) = (length * (t - 0.5), bend * (TAU * t).sin());
        if lies { [along, 0.0, 0.2 + across] } else { [x + across, along, 0.0] }
    })
}

/// Around the trunk, the neck or an arm.
fn helix(draw: &mut Draw) -> Shape {
    let (radius, turns, pitch) =
        (draw.between(0.005, 0.02), draw.between(2.0, 5.0), draw.between(0.05, 0.15));
    let (wide, low) = draw.any(&[(0.2, -0.2), (0.3, -0.3), (0.09, 0.45), (0.16, 0.05)]);
    rope(160, radius, draw.triangles.max(2500), |t| {
        let (s, c) = (TAU * turns * t).sin_cos();
        [wide * s, low + pitch * turns * t, 0.9 * wide * c]
    })
}

/// A trefoil knot with loose ends.
fn knotted_rope(draw: &mut Draw) -> Shape {
    let (radius, size, gap) =
        (draw.between(0.005, 0.014), draw.between(0.04, 0.12), draw.between(0.02, 0.08));
    let height = draw.between(-0.1, 0.5);
    rope(90, radius, draw.triangles.max(2000), |t| {
        let a = TAU * (gap + (1.0 - 2.0 * gap) * t);
        let (x, y) = (a.sin() + 2.0 * (2.0 * a).sin(), a.cos() - 2.0 * (2.0 * a).cos());
        [size * x, height + size * y, 0.15 - size * (3.0 * a).sin()]
    })
}

/// A closed ring of rope in a level plane, as wide as `depth` is deep.
fn ring(wide: f64, radius: f64, depth: f64, triangles: usize) -> Shape {
    let rows = (triangles as f64 / 2.0 * wide / radius).sqrt().min(triangles as f64 / 12.0) as usize;
    let columns = (triangles / 2 / rows).max(5);
    Shape::grid([columns, rows], true, |u, v| {
        // The last row is the first one.
        let (s, c) = (TAU * if v == 1.0 { 0.0 } else { v }).sin_cos();
        let (b, a) = (TAU * u).sin_cos();
        [(wide + radius * a) * s, radius * b, depth * (wide + radius * a) * c]
    })
}

fn torus(draw: &mut Draw) -> Shape {
    let wide = draw.between(0.1, 0.4);
    let (radius, y) = (wide * draw.between(0.15, 0.5), draw.between(-0.1, 0.3));
    ring(wide, radius, draw.between(0.7, 1.0), draw.triangles).at([0.0, y, 0.0])
}

fn hula_hoop(draw: &mut Draw) -> Shape {
    let (wide, radius, y) = (draw.between(0.38, 0.52), draw.between(0.01, 0.018), draw.between(-0.05, 0.15));
    let tilt = draw.between(-0.2, 0.2);
    ring(wide, radius, 1.0, draw.triangles.max(500)).map(|[x, h, z]| [x, h + tilt * z, z]).at([0.0, y, 0.0])
}

fn ribbon(draw: &mut Draw) -> Shape {
    let (length, width, wave) = (draw.between(0.6, 2.0), draw.between(0.01, 0.05), draw.between(0.0, 0.04));
    let (y, z) = (draw.between(-0.1, 0.5), draw.between(0.1, 0.25));
    Shape::sheet(length, width, draw.triangles, |along, across| {
        [along, y + across, z + wave * (12.0 * along).sin()]
    })
}
