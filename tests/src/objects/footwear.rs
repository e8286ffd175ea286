//! What is worn on one limb: socks, stockings, shoes, mittens, arm warmers.

use super::Kind;
use super::curve::Knot;
use super::draw::Draw;
use super::shape::Shape;

pub(super) const KINDS: [Kind; 9] = [
    Kind::new("ankle sock", ankle_sock),
    Kind::new("knee sock", knee_sock),
    Kind::new("pair of socks", pair_of_socks),
    Kind::new("stockings without briefs", stockings),
    Kind::new("shoe", shoe),
    Kind::new("pair of shoes", pair_of_shoes),
    Kind::new("mitten", mitten),
    Kind::new("pair of mittens", pair_of_mittens),
    Kind::small("arm warmer", arm_warmer),
];

/// The left leg from the hip down: height and half thickness (m).
const LEG: [[f64; 2]; 7] = [
    [-0.16, 0.092],
    [-0.30, 0.073],
    [-0.465, 0.055],
    [-0.58, 0.056],
    [-0.72, 0.046],
    [-0.82, 0.038],
    [-0.86, 0.040],
];

/// A tube around the left leg from the height `top` (m) to the toes, `slack` (m) away from the skin.
fn sock(top: f64, slack: f64, triangles: usize) -> Shape {
    let radius = |y: f64| {
        let below = LEG.iter().position(|[height, _]| *height <= y).unwrap_or(LEG.len() - 1).max(1);
        let ([y0, r0], [y1, r1]) = (LEG[below - 1], LEG[below]);
        r0 + (r1 - r0) * ((y0 - y) / (y0 - y1)).clamp(0.0, 1.0)
    };
    let axis = |y: f64| [0.098 - 0.025 * (y + 0.13), y, -0.012];
    let lower = LEG.iter().map(|[y, _]| *y).filter(|y| *y < top - 0.02);
    let mut knots: Vec<Knot> = Vec::new();
    for y in [top].into_iter().chain(lower) {
        let [x, y, z] = axis(y);
        knots.push([x, y, z, radius(y) + slack]);
    }
    let foot = [[0.121, -0.9, -0.02, 0.046], [0.124, -0.905, 0.03, 0.043], [0.13, -0.91, 0.1, 0.041]];
    knots.extend(foot.map(|[x, y, z, r]| [x, y, z, r + slack]));
    knots.extend([[0.132, -0.912, 0.15, 0.03], [0.133, -0.912, 0.17, 0.0]]);
    Shape::tube(&knots, triangles)
}

fn ankle_sock(draw: &mut Draw) -> Shape {
    sock(draw.between(-0.84, -0.78), draw.between(0.002, 0.008), draw.triangles)
}

fn knee_sock(draw: &mut Draw) -> Shape {
    sock(draw.between(-0.55, -0.48), draw.between(0.002, 0.008), draw.triangles)
}

fn pair_of_socks(draw: &mut Draw) -> Shape {
    sock(draw.between(-0.84, -0.5), draw.between(0.002, 0.008), draw.triangles / 2).and_mirrored()
}

fn stockings(draw: &mut Draw) -> Shape {
    sock(draw.between(-0.28, -0.2), draw.between(0.001, 0.004), draw.triangles / 2).and_mirrored()
}

/// With a flat sole.
fn one_shoe(draw: &mut Draw, triangles: usize) -> Shape {
    let sole = draw.between(-0.95, -0.935);
    let top = draw.between(-0.86, -0.75);
    sock(top, draw.between(0.006, 0.014), triangles).map(|[x, y, z]| [x, y.max(sole), z])
}

fn shoe(draw: &mut Draw) -> Shape {
    one_shoe(draw, draw.triangles)
}

fn pair_of_shoes(draw: &mut Draw) -> Shape {
    one_shoe(draw, draw.triangles / 2).and_mirrored()
}

fn one_mitten(draw: &mut Draw, triangles: usize) -> Shape {
    let (start, slack) = (draw.between(0.55, 0.66), draw.between(0.004, 0.012));
    let knots = [[start, 0.04], [0.69, 0.032], [0.74, 0.045], [0.8, 0.04], [0.85, 0.03], [0.875, 0.0]];
    let slack = |r: f64| if r > 0.0 { r + slack } else { 0.0 };
    let knots = knots.map(|[x, r]| [x, 0.437, -0.027, slack(r)]);
    let thumb = draw.between(0.0, 0.04);
    // Flat, with the thumb forward.
    Shape::tube(&knots, triangles).map(|[x, y, z]| {
        let bulge = thumb * (-((x - 0.745) / 0.02).powi(2)).exp() * ((z + 0.027) / 0.04).clamp(0.0, 1.0);
        [x, 0.437 + 0.65 * (y - 0.437), z + bulge]
    })
}

fn mitten(draw: &mut Draw) -> Shape {
    one_mitten(draw, draw.triangles)
}

fn pair_of_mittens(draw: &mut Draw) -> Shape {
    one_mitten(draw, draw.triangles / 2).and_mirrored()
}

fn arm_warmer(draw: &mut Draw) -> Shape {
    let (start, end, slack) = (draw.between(0.28, 0.4), draw.between(0.6, 0.7), draw.between(0.002, 0.01));
    let knots = [[start, 0.048], [0.5 * (start + end), 0.041], [end, 0.03]];
    Shape::tube(&knots.map(|[x, r]| [x, 0.435, -0.03, r + slack]), draw.triangles)
}
