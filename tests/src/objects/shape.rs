//! Surfaces made of grids: sheets, surfaces of revolution, tubes, boxes.

use super::curve::{Knot, frames, length, resample, rounded};
use super::draw::Draw;
use clothcombo_data::mesh::bounds;
use clothcombo_physics::vec3::{add, norm, scale, sub};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A surface of triangles and quads (m).
#[derive(Clone, Debug, Default)]
pub(super) struct Shape {
    pub positions: Vec<[f64; 3]>,
    faces: Vec<Vec<u32>>,
}

/// Rows and columns of a grid of about `triangles` over a surface of this size.
fn cells(width: f64, height: f64, triangles: usize) -> [usize; 2] {
    let squares = triangles as f64 / 2.0;
    let columns = ((squares * width / height).sqrt().round() as usize).clamp(2, triangles / 4);
    [columns, ((squares / columns as f64).round() as usize).max(2)]
}

impl Shape {
    /// The surface `at(u, v)`, both from 0 to 1; `around` if u = 1 is u = 0. Points that coincide are one vertex.
    pub fn grid([columns, rows]: [usize; 2], around: bool, at: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        let width = if around { columns } else { columns + 1 };
        let point = |i: usize| at((i % width) as f64 / columns as f64, (i / width) as f64 / rows as f64);
        let positions = (0..width * (rows + 1)).map(point).collect();
        let vertex = |column: usize, row: usize| (row * width + column % width) as u32;
        let cell = |column, row| {
            vec![
                vertex(column, row),
                vertex(column + 1, row),
                vertex(column + 1, row + 1),
                vertex(column, row + 1),
            ]
        };
        let faces = (0..rows).flat_map(|row| (0..columns).map(move |column| cell(column, row))).collect();
        Self { positions, faces }.welded()
    }

    /// A sheet of this size (m) whose points are `at(x, y)`, x and y from its middle.
    pub fn sheet(width: f64, height: f64, triangles: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        Self::grid(cells(width, height, triangles), false, |u, v| at(width * (u - 0.5), height * (v - 0.5)))
    }

    /// The surface that `profile` (radius and height, m) sweeps around the y axis; `depth` is its extent along z as a share of
    /// that along x. A radius of zero closes it.
    pub fn lathe(profile: &[[f64; 2]], depth: f64, triangles: usize) -> Self {
        let knots: Vec<Knot> = profile.iter().map(|[r, y]| [*r, *y, 0.0, 0.0]).collect();
        let widest = profile.iter().fold(0.0, |r: f64, p| r.max(p[0]));
        let mut size = cells(TAU * widest, length(&knots), triangles);
        size[0] = size[0].max(6);
        size[1] = (triangles / 2 / size[0]).max(3);
        let rows = resample(&knots, size[1]);
        Self::grid(size, true, |u, v| {
            let [r, y, ..] = rows[(v * size[1] as f64).round() as usize];
            let (s, c) = (TAU * u).sin_cos();
            [r * s, y, r * c * depth]
        })
    }

    /// A tube along a smooth curve through `knots`. A radius of zero closes an end.
    pub fn tube(knots: &[Knot], triangles: usize) -> Self {
        let smooth = rounded(knots);
        let widest = knots.iter().fold(0.0, |r: f64, k| r.max(k[3]));
        let mut size = cells(TAU * widest, length(&smooth), triangles);
        size[0] = size[0].max(5);
        size[1] = (triangles / 2 / size[0]).max(3);
        let rows = resample(&smooth, size[1]);
        let frames = frames(&rows);
        Self::grid(size, true, |u, v| {
            let row = (v * size[1] as f64).round() as usize;
            let ([x, y, z, r], [side, up]) = (rows[row], frames[row]);
            let (s, c) = (TAU * u).sin_cos();
            add([x, y, z], add(scale(side, r * c), scale(up, r * s)))
        })
    }

    /// The sides of a box between two corners (m) that `keep`, indexed by axis and far end.
    pub fn sides(low: [f64; 3], high: [f64; 3], keep: [[bool; 2]; 3], triangles: usize) -> Self {
        let size = sub(high, low);
        let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
        let edge = (2.0 * area / triangles as f64).sqrt();
        let counts = size.map(|s| (s / edge).round().max(1.0) as usize);
        let mut shape = Self::default();
        for axis in 0..3 {
            let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
            for end in 0..2 {
                if !keep[axis][end] {
                    continue;
                }
                let mut side = Self::grid([counts[b], counts[c]], false, |u, v| {
                    let mut p = if end == 0 { low } else { high };
                    p[b] = low[b] + size[b] * u;
                    p[c] = low[c] + size[c] * v;
                    p
                });
                if end == 0 {
                    side.faces.iter_mut().for_each(|face| face.reverse());
                }
                shape.join(side);
            }
        }
        shape.welded()
    }

    /// A closed box.
    pub fn closed_box(low: [f64; 3], high: [f64; 3], triangles: usize) -> Self {
        Self::sides(low, high, [[true; 2]; 3], triangles)
    }

    /// Adds another piece.
    pub fn join(&mut self, other: Self) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.faces.extend(other.faces.into_iter().map(|face| face.into_iter().map(|v| v + first).collect()));
    }

    /// With its mirror image on the other side of the person.
    pub fn and_mirrored(mut self) -> Self {
        let mut other = self.clone();
        other.positions.iter_mut().for_each(|p| p[0] = -p[0]);
        other.faces.iter_mut().for_each(|face| face.reverse());
        self.join(other);
        self
    }

    /// All points moved.
    pub fn map(mut self, to: impl Fn([f64; 3]) -> [f64; 3]) -> Self {
        self.positions.iter_mut().for_each(|p| *p = to(*p));
        self
    }

    /// Moved by `shift` (m).
    pub fn at(self, shift: [f64; 3]) -> Self {
        self.map(|p| add(p, shift))
    }

    /// Moves it by `shift` (m).
    pub fn shift(&mut self, shift: [f64; 3]) {
        self.positions.iter_mut().for_each(|p| *p = add(*p, shift));
    }

    /// Moves the middle of its bounds to the origin.
    pub fn centre(&mut self) {
        let [low, high] = bounds(&self.positions);
        self.shift(scale(add(low, high), -0.5));
    }

    /// Moves each vertex at random by up to `share` of the mean edge, along each axis.
    pub fn roughen(&mut self, share: f64, draw: &mut Draw) {
        let edge = |f: &Vec<u32>| norm(sub(self.positions[f[0] as usize], self.positions[f[1] as usize]));
        let mean = self.faces.iter().map(edge).sum::<f64>() / self.faces.len() as f64;
        self.positions.iter_mut().flatten().for_each(|x| *x += draw.between(-1.0, 1.0) * share * mean);
    }

    /// Its faces, as triangles or with the quads they are made of.
    pub fn polygons(&self, triangles: bool) -> Vec<Vec<u32>> {
        let fan = |f: &Vec<u32>| (2..f.len()).map(|i| vec![f[0], f[i - 1], f[i]]).collect::<Vec<_>>();
        match triangles {
            true => self.faces.iter().flat_map(fan).collect(),
            false => self.faces.clone(),
        }
    }

    fn welded(self) -> Self {
        let mut shape = Self::default();
        let mut known = HashMap::new();
        let mut weld = |p: &[f64; 3]| {
            *known.entry(p.map(|x| (x * 1e7).round() as i64)).or_insert_with(|| {
                shape.positions.push(*p);
                shape.positions.len() as u32 - 1
            })
        };
        let vertex: Vec<u32> = self.positions.iter().map(&mut weld).collect();
        for face in self.faces {
            let mut face: Vec<u32> = face.into_iter().map(|v| vertex[v as usize]).collect();
            face.dedup();
            while face.len() > 1 && face.first() == face.last() {
                face.pop();
            }
            if face.len() >= 3 {
                shape.faces.push(face);
            }
        }
        shape
    }
}
