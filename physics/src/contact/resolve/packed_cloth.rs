//! The garments of an outfit side by side: one cloth, numbered through.

use std::ops::Range;

use super::Layer;

/// All garments packed one behind the other, innermost first.
pub(super) struct PackedCloth<'a> {
    pub layers: &'a [Layer<'a>],
    /// First vertex of every garment, and the end.
    vertex_starts: Vec<u32>,
    /// First face of every garment, and the end.
    face_starts: Vec<u32>,
    garment_of: Vec<u16>,
    /// Faces by packed vertices.
    pub faces: Vec<[u32; 3]>,
}

impl<'a> PackedCloth<'a> {
    pub fn new(layers: &'a [Layer<'a>]) -> Self {
        let mut outfit = Self {
            layers,
            vertex_starts: vec![0],
            face_starts: vec![0],
            garment_of: Vec::new(),
            faces: Vec::new(),
        };
        for (g, layer) in layers.iter().enumerate() {
            let start = outfit.garment_of.len() as u32;
            outfit.faces.extend(layer.garment.faces.iter().map(|face| face.map(|v| v + start)));
            outfit.garment_of.resize(start as usize + layer.positions.len(), g as u16);
            outfit.vertex_starts.push(outfit.garment_of.len() as u32);
            outfit.face_starts.push(outfit.faces.len() as u32);
        }
        outfit
    }

    /// Number of garments.
    pub fn len(&self) -> usize {
        self.layers.len()
    }

    /// Number of vertices of all garments.
    pub fn vertex_count(&self) -> usize {
        self.garment_of.len()
    }

    /// The garment of packed vertex `v`.
    pub fn garment_of(&self, v: u32) -> usize {
        usize::from(self.garment_of[v as usize])
    }

    /// The garment of packed face `f`.
    pub fn garment_of_face(&self, f: u32) -> usize {
        self.garment_of(self.faces[f as usize][0])
    }

    /// Packed vertices of garment `g`.
    pub fn vertices(&self, g: usize) -> Range<u32> {
        self.vertex_starts[g]..self.vertex_starts[g + 1]
    }

    /// Packed faces of garment `g`.
    pub fn faces_of_garment(&self, g: usize) -> Range<u32> {
        self.face_starts[g]..self.face_starts[g + 1]
    }

    /// The part of a packed array that belongs to garment `g`.
    pub fn part<'b, T>(&self, packed: &'b [T], g: usize) -> &'b [T] {
        let range = self.vertices(g);
        &packed[range.start as usize..range.end as usize]
    }

    /// A packed array garment by garment.
    pub fn split<T: Clone>(&self, packed: &[T]) -> Vec<Vec<T>> {
        (0..self.len()).map(|g| self.part(packed, g).to_vec()).collect()
    }

    /// Positions of all garments, one behind the other.
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.layers.iter().flat_map(|layer| layer.positions).copied().collect()
    }

    /// Neighbours of packed vertex `v` along edges, ascending.
    pub fn ring(&self, v: u32) -> impl ExactSizeIterator<Item = u32> {
        let g = self.garment_of(v);
        let start = self.vertex_starts[g];
        self.layers[g].garment.topology.ring((v - start) as usize).iter().map(move |n| n + start)
    }

    /// Packed faces around packed vertex `v`, ascending.
    pub fn faces_at(&self, v: u32) -> impl Iterator<Item = u32> {
        let g = self.garment_of(v);
        let start = self.face_starts[g];
        self.layers[g].garment.faces_of(v - self.vertex_starts[g]).iter().map(move |f| f + start)
    }

    /// Vertices within `rings` edges of `seeds`, ascending.
    pub fn neighbourhood(&self, seeds: &[u32], rings: usize) -> Vec<u32> {
        let mut is_in = vec![false; self.vertex_count()];
        let mut is_new = |v: &u32| !std::mem::replace(&mut is_in[*v as usize], true);
        let mut all: Vec<u32> = seeds.iter().copied().filter(&mut is_new).collect();
        let mut inner = 0;
        for _ in 0..rings {
            let ring = inner..all.len();
            inner = ring.end;
            for at in ring {
                let v = all[at];
                all.extend(self.ring(v).filter(&mut is_new));
            }
        }
        all.sort_unstable();
        all
    }
}
