//! Things that are no garment, of the size they really have, in files as strangers write them.
//!
//! No other unit of length makes a garment of one either: a sleeve in centimetres is a dress in inches, so open tubes come only
//! in units that leave no doubt.

mod boxes;
mod curve;
mod draw;
mod footwear;
mod hats;
mod household;
mod neckwear;
mod ropes;
mod shape;
mod sheets;

use clothcombo_data::asset::rotation;
use clothcombo_data::fit::{FileOrigin, Placement, Unit, UpAxis};
use clothcombo_data::format::PolygonMesh;
use draw::Draw;
use shape::Shape;

/// A thing that nobody can wear as one of the six categories.
#[derive(Clone, Debug)]
pub struct Object {
    /// Its number, kind and file convention.
    pub name: String,
    /// In the file's unit and axes.
    pub mesh: PolygonMesh,
}

/// How to make one kind of thing.
struct Kind {
    name: &'static str,
    /// In metres, y up, facing +z, where it belongs on a person of 1.7 m whose pelvis is at the origin.
    make: fn(&mut Draw) -> Shape,
    /// Units in which it cannot be taken for a garment.
    units: &'static [Unit],
}

impl Kind {
    const fn new(name: &'static str, make: fn(&mut Draw) -> Shape) -> Self {
        Self { name, make, units: &Unit::ALL }
    }

    /// Smaller than a garment that it resembles. The next larger unit would make it wearable unless it is ten times as long.
    const fn small(name: &'static str, make: fn(&mut Draw) -> Shape) -> Self {
        Self { name, make, units: &[Unit::M, Unit::Mm] }
    }

    /// The same for something larger and the next smaller unit.
    const fn large(name: &'static str, make: fn(&mut Draw) -> Shape) -> Self {
        Self { name, make, units: &[Unit::Cm, Unit::Mm] }
    }
}

fn kinds() -> Vec<Kind> {
    let groups: [&[Kind]; 7] = [
        &hats::KINDS,
        &footwear::KINDS,
        &sheets::KINDS,
        &boxes::KINDS,
        &ropes::KINDS,
        &neckwear::KINDS,
        &household::KINDS,
    ];
    // One of each group in turn, so that a few objects already show all groups.
    let most = groups.iter().map(|group| group.len()).max().unwrap_or(0);
    let turn = |i: usize| groups.into_iter().filter_map(move |group| group.get(i));
    (0..most).flat_map(turn).map(|kind| Kind { ..*kind }).collect()
}

/// `count` objects, all kinds in turn; the same ones for the same seed, however many there are.
pub fn objects(seed: u64, count: usize) -> Vec<Object> {
    let kinds = kinds();
    (0..count).map(|i| object(&kinds[i % kinds.len()], i, &mut Draw::new(seed, i as u64))).collect()
}

fn object(kind: &Kind, number: usize, draw: &mut Draw) -> Object {
    let mut shape = (kind.make)(draw);
    shape.roughen(draw.between(0.0, 0.05), draw);
    let place = match draw.range(0, 4) {
        0 => {
            shape.centre();
            "centred"
        }
        1 => {
            shape.centre();
            let shift = [0; 3].map(|_| draw.between(-0.23, 0.23));
            shape.shift(shift);
            "shifted"
        }
        _ => "on the body",
    };
    let placement = Placement {
        unit: draw.any(kind.units),
        up: draw.any(&UpAxis::USUAL),
        turn_degrees: draw.any(&[0.0, 90.0, 180.0, 270.0]),
        origin: FileOrigin::Pelvis,
        translation: [0.0; 3],
        ..Placement::AS_GIVEN
    };
    let back = rotation::transpose(&placement.turn());
    let of_file = |p: &[f64; 3]| rotation::apply(&back, p.map(|x| x / placement.unit.metres()));
    let mut mesh = PolygonMesh::with_positions(shape.positions.iter().map(of_file).collect());
    shape.polygons(draw.chance(0.5)).iter().for_each(|polygon| mesh.push(polygon));
    let Placement { unit, up, turn_degrees, .. } = placement;
    let name = format!("{number:03} {}, {unit}, {up} up, turned {turn_degrees}°, {place}", kind.name);
    Object { name, mesh }
}

#[cfg(test)]
mod tests;
