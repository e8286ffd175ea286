//! Textures in glTF: one pair of coordinates a vertex.

use std::collections::HashMap;

/// A mesh cut where faces disagree about the texture coordinates of a vertex: the format has one pair a vertex.
pub(super) struct Seams {
    /// Which vertex of the mesh each is: first all in their order, then further copies.
    pub vertex: Vec<u32>,
    /// Its texture coordinates, v downwards as the format has it.
    pub texture: Vec<[f32; 2]>,
    pub faces: Vec<[u32; 3]>,
}

impl Seams {
    pub fn new(vertices: usize, faces: &[[u32; 3]], texture: &[[[f32; 2]; 3]]) -> Self {
        let mut vertex: Vec<u32> = (0..vertices as u32).collect();
        let mut coordinates = vec![None; vertices];
        let mut copies = HashMap::new();
        let mut number = |v: u32, [right, up]: [f32; 2]| {
            let pair = [right, 1.0 - up];
            if *coordinates[v as usize].get_or_insert(pair) == pair {
                return v;
            }
            *copies.entry((v, pair.map(f32::to_bits))).or_insert_with(|| {
                vertex.push(v);
                coordinates.push(Some(pair));
                vertex.len() as u32 - 1
            })
        };
        let of_face = |(face, corners): (&[u32; 3], &[[f32; 2]; 3])| {
            std::array::from_fn(|k| number(face[k], corners[k]))
        };
        let faces = faces.iter().zip(texture).map(of_face).collect();
        Self { vertex, texture: coordinates.into_iter().map(Option::unwrap_or_default).collect(), faces }
    }
}
