//! Vessels, bags, cushions, and a figure of closed pieces.

use super::Kind;
use super::draw::Draw;
use super::shape::Shape;

pub(super) const KINDS: [Kind; 8] = [
    Kind::new("bottle", bottle),
    Kind::new("cup", cup),
    Kind::new("bag", bag),
    Kind::new("cushion", cushion),
    Kind::small("lamp shade", lamp_shade),
    Kind::new("table cloth", table_cloth),
    Kind::new("capsule", capsule),
    Kind::new("figure of capsules", figure),
];

/// In one hand (m).
fn hand(draw: &mut Draw) -> [f64; 3] {
    [draw.sign() * 0.75, 0.42, 0.02]
}

fn bottle(draw: &mut Draw) -> Shape {
    let (r, h, neck) = (draw.between(0.03, 0.06), draw.between(0.18, 0.35), draw.between(0.01, 0.016));
    let profile = [[0.0, 0.0], [r, 0.0], [r, 0.6 * h], [neck, 0.78 * h], [neck, h]];
    let place = hand(draw);
    Shape::lathe(&profile, 1.0, draw.triangles.max(600)).at(place)
}

fn cup(draw: &mut Draw) -> Shape {
    let (r, h, wider) = (draw.between(0.025, 0.045), draw.between(0.06, 0.14), draw.between(1.0, 1.4));
    let place = hand(draw);
    Shape::lathe(&[[0.0, 0.0], [r, 0.0], [r * wider, h]], 1.0, draw.triangles).at(place)
}

/// Hangs at the side of the hip.
fn bag(draw: &mut Draw) -> Shape {
    let (r, h, wider) = (draw.between(0.12, 0.25), draw.between(0.2, 0.45), draw.between(0.8, 1.2));
    let profile = [[0.0, 0.0], [0.9 * r, 0.0], [r, 0.1 * h], [r * wider, h]];
    let (depth, side) = (draw.between(0.2, 0.5), draw.sign());
    let sideways = |[x, y, z]: [f64; 3]| [z, y, x];
    Shape::lathe(&profile, depth, draw.triangles).map(sideways).at([side * 0.28, -0.2 - 0.5 * h, 0.0])
}

fn cushion(draw: &mut Draw) -> Shape {
    let (half, thick) = (draw.between(0.15, 0.35), draw.between(0.05, 0.12));
    let profile: Vec<[f64; 2]> = (0..=30)
        .map(|i| {
            let (s, c) = (std::f64::consts::PI * i as f64 / 30.0).sin_cos();
            [if i % 30 == 0 { 0.0 } else { half * s.powf(0.6) }, thick * c]
        })
        .collect();
    // Rather square than round.
    let squared = |[x, y, z]: [f64; 3]| {
        let stretch = x.hypot(z) / x.abs().max(z.abs()).max(1e-9);
        [x * stretch.sqrt(), z * stretch.sqrt(), y]
    };
    Shape::lathe(&profile, 1.0, draw.triangles).map(squared).at([0.0, 0.1, 0.25])
}

/// At most 12 cm in radius: too narrow for any waist.
fn lamp_shade(draw: &mut Draw) -> Shape {
    let (low, h) = (draw.between(0.06, 0.12), draw.between(0.06, 0.2));
    let high = low * draw.between(0.35, 0.9);
    let y = draw.any(&[0.8, 0.6, 0.1]);
    Shape::lathe(&[[high, h], [low, 0.0]], 1.0, draw.triangles).at([0.0, y, 0.0])
}

/// Flat, or hanging over the edge of a table.
fn table_cloth(draw: &mut Draw) -> Shape {
    let (r, y) = (draw.between(0.35, 0.9), draw.between(-0.2, 0.1));
    let hangs = draw.any(&[0.0, 0.3]) * r;
    Shape::lathe(&[[0.0, 0.0], [r, 0.0], [1.1 * r, -hangs]], 1.0, draw.triangles).at([0.0, y, 0.0])
}

/// A closed tube with round ends.
fn rod(from: [f64; 3], to: [f64; 3], r: f64, triangles: usize) -> Shape {
    let knot = |t: f64, r: f64| {
        let [x, y, z] = std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
        [x, y, z, r]
    };
    let knots = [
        knot(0.0, 0.0),
        knot(0.0, 0.5 * r),
        knot(0.05, r),
        knot(0.5, r),
        knot(0.95, r),
        knot(1.0, 0.5 * r),
        knot(1.0, 0.0),
    ];
    Shape::tube(&knots, triangles)
}

fn capsule(draw: &mut Draw) -> Shape {
    let (r, h) = (draw.between(0.05, 0.25), draw.between(0.3, 0.85));
    rod([0.0, -h, 0.0], [0.0, h, 0.0], r, draw.triangles)
}

fn figure(draw: &mut Draw) -> Shape {
    let triangles = draw.triangles.max(1500) / 6;
    let (thick, size) = (draw.between(0.8, 1.2), draw.between(0.9, 1.1));
    let mut shape = rod([0.0, -0.12, 0.0], [0.0, 0.48, 0.0], 0.15 * thick, triangles);
    shape.join(rod([0.0, 0.53, 0.0], [0.0, 0.77, 0.0], 0.085, triangles));
    let mut limbs = rod([0.18, 0.43, -0.03], [0.8, 0.43, -0.03], 0.045 * thick, triangles);
    limbs.join(rod([0.1, -0.15, 0.0], [0.12, -0.93, 0.0], 0.07 * thick, triangles));
    shape.join(limbs.and_mirrored());
    shape.map(|p| p.map(|x| x * size))
}
