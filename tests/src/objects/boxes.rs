//! Boxes with and without lids, and a chair.

use super::Kind;
use super::draw::Draw;
use super::shape::Shape;

pub(super) const KINDS: [Kind; 6] = [
    Kind::new("closed box", closed_box),
    Kind::new("box without a lid", box_without_a_lid),
    Kind::small("small box without lids", small_tube),
    Kind::large("large box without lids", large_tube),
    Kind::new("nested boxes", nested_boxes),
    Kind::new("chair", chair),
];

const NO_TOP: [[bool; 2]; 3] = [[true; 2], [true, false], [true; 2]];
const NO_LIDS: [[bool; 2]; 3] = [[true; 2], [false; 2], [true; 2]];

/// Half the size of a box (m) from `low` to `high` long.
fn half(draw: &mut Draw, low: f64, high: f64) -> [f64; 3] {
    [0; 3].map(|_| 0.5 * draw.between(low, high))
}

/// In the hands, on the floor, or around the person (m).
fn place(draw: &mut Draw, half: [f64; 3]) -> [f64; 3] {
    match draw.range(0, 3) {
        0 => [0.0, draw.between(-0.2, 0.3), 0.2 + half[2]],
        1 => [draw.sign() * (0.3 + half[0]), half[1] - 0.94, 0.0],
        _ => [0.0, draw.between(-0.3, 0.3), 0.0],
    }
}

fn sides(draw: &mut Draw, half: [f64; 3], keep: [[bool; 2]; 3]) -> Shape {
    let place = place(draw, half);
    Shape::sides(half.map(|h| -h), half, keep, draw.triangles).at(place)
}

fn closed_box(draw: &mut Draw) -> Shape {
    let half = half(draw, 0.1, 1.2);
    sides(draw, half, [[true; 2]; 3])
}

fn box_without_a_lid(draw: &mut Draw) -> Shape {
    let half = half(draw, 0.1, 1.2);
    sides(draw, half, NO_TOP)
}

/// Too narrow for any waist: a girth of at most 64 cm.
fn small_tube(draw: &mut Draw) -> Shape {
    let half = [draw.between(0.03, 0.08), draw.between(0.04, 0.125), draw.between(0.03, 0.08)];
    sides(draw, half, NO_LIDS)
}

/// Around nobody: at least 1.2 m wide and deep.
fn large_tube(draw: &mut Draw) -> Shape {
    let half = [draw.between(0.6, 0.9), draw.between(0.2, 0.7), draw.between(0.6, 0.9)];
    sides(draw, half, NO_LIDS)
}

fn nested_boxes(draw: &mut Draw) -> Shape {
    let half = half(draw, 0.2, 1.0);
    let share = draw.between(0.4, 0.8);
    let keep = draw.any(&[NO_TOP, [[true; 2]; 3]]);
    let place = place(draw, half);
    let mut shape = Shape::sides(half.map(|h| -h), half, NO_TOP, draw.triangles / 2);
    let inner = half.map(|h| h * share);
    shape.join(Shape::sides(inner.map(|h| -h), inner, keep, draw.triangles / 2));
    shape.at(place)
}

fn chair(draw: &mut Draw) -> Shape {
    let (half, seat, back) = (draw.between(0.2, 0.28), draw.between(0.4, 0.5), draw.between(0.3, 0.6));
    let (thick, triangles) = (draw.between(0.03, 0.05), draw.triangles / 6);
    let mut shape = Shape::closed_box([-half, seat, -half], [half, seat + thick, half], triangles);
    let (low, high) = (seat + thick + 0.002, seat + thick + back);
    shape.join(Shape::closed_box([-half, low, -half], [half, high, thick - half], triangles));
    for [x, z] in [[-half, -half], [half - thick, -half], [-half, half - thick], [half - thick, half - thick]]
    {
        let (low, high) = ([x, 0.0, z], [x + thick, seat - 0.002, z + thick]);
        shape.join(Shape::closed_box(low, high, triangles));
    }
    let behind = draw.any(&[-0.1, -0.6]);
    shape.at([0.0, -0.94, behind])
}
