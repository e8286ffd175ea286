//! Exact crossings of an outfit, kept up to date as vertices move.

use std::collections::HashMap;

use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use crate::contact::TriangleTree;
use crate::vec3::distance_squared;

/// Pairs of triangles that cross. Faces of garments are numbered through.
pub(super) struct Crossings {
    /// (face, face of the body)
    pub body: Vec<(u32, u32)>,
    /// (face of the outer garment, face of the inner one)
    pub layers: Vec<(u32, u32)>,
    /// Two faces of one garment, ascending.
    pub own: Vec<(u32, u32)>,
    /// Faces whose crossings have to be looked for (again).
    pub is_dirty: Vec<bool>,
}

impl Crossings {
    pub fn new(faces: usize) -> Self {
        Self { body: Vec::new(), layers: Vec::new(), own: Vec::new(), is_dirty: vec![true; faces] }
    }

    /// All pairs.
    pub fn count(&self) -> usize {
        self.between() + self.own.len()
    }

    /// Pairs with the body and between garments.
    pub fn between(&self) -> usize {
        self.body.len() + self.layers.len()
    }

    /// Looks at the faces that are dirty. `trees` are those of the garments, `far` the distances of vertices to the body; garments
    /// with themselves, and where the body is pinched, only count if asked for.
    pub fn update(
        &mut self,
        outfit: &Outfit<'_>,
        body: &BodyObstacle<'_>,
        trees: &[TriangleTree<'_>],
        positions: &[[f64; 3]],
        far: &[f64],
        (with_own, with_pinched): (bool, bool),
    ) {
        let is_dirty = std::mem::take(&mut self.is_dirty);
        let dirty =
            |g: usize| -> Vec<u32> { outfit.faces_of_garment(g).filter(|&f| is_dirty[f as usize]).collect() };
        let moved: Vec<Vec<u32>> = (0..outfit.len()).map(dirty).collect();
        let is_clean = |f: u32| !is_dirty[f as usize];
        let corners = |f: u32| outfit.faces[f as usize].map(|v| positions[v as usize]);
        let mut known = HashMap::new();
        let mut is_pinch =
            |f: u32| !with_pinched && *known.entry(f).or_insert_with(|| body.is_pinch_at(&corners(f)));

        self.body.retain(|&(f, _)| is_clean(f));
        // No face reaches farther from a corner than its longest edge.
        let may_touch = |f: &u32| {
            let [a, b, c] = corners(*f);
            let longest =
                distance_squared(a, b).max(distance_squared(b, c)).max(distance_squared(c, a)).sqrt();
            outfit.faces[*f as usize].iter().all(|&v| far[v as usize] <= longest * (1.0 + 1e-9))
        };
        let near: Vec<u32> = moved.iter().flatten().copied().filter(may_touch).collect();
        let found = body.tree.pairs_of_faces(positions, &outfit.faces, &near, |_| true);
        self.body.extend(found.into_iter().filter(|&(_, b)| !body.is_pinched(b)));
        self.body.sort_unstable();

        self.layers.retain(|&(f, g)| is_clean(f) && is_clean(g));
        let before = self.layers.len();
        for inner in 0..outfit.len() {
            let first_inner = outfit.faces_of_garment(inner).start;
            for outer in inner + 1..outfit.len() {
                let first_outer = outfit.faces_of_garment(outer).start;
                let over =
                    trees[inner].pairs_of_faces(positions, &outfit.faces, &moved[outer], |_| true);
                self.layers.extend(over.into_iter().map(|(f, g)| (f, g + first_inner)));
                if moved[outer].len() == outfit.faces_of_garment(outer).len() {
                    continue;
                }
                // Those that moved were asked already.
                let others = |f: u32| is_clean(f + first_outer);
                let under = trees[outer].pairs_of_faces(positions, &outfit.faces, &moved[inner], others);
                self.layers.extend(under.into_iter().map(|(g, f)| (f + first_outer, g)));
            }
        }
        let mut found = self.layers.split_off(before);
        found.retain(|&(f, g)| !(is_pinch(f) && is_pinch(g)));
        self.layers.extend(found);
        self.layers.sort_unstable();

        if with_own {
            self.own.retain(|&(f, g)| is_clean(f) && is_clean(g));
            for (g, faces) in moved.iter().enumerate() {
                let first = outfit.faces_of_garment(g).start;
                let local: Vec<u32> = faces.iter().map(|f| f - first).collect();
                let found = trees[g].self_pairs_of_faces(&local);
                let packed = found.into_iter().map(|(f, g)| (f + first, g + first));
                self.own.extend(packed.filter(|&(f, g)| !(is_pinch(f) && is_pinch(g))));
            }
            self.own.sort_unstable();
        }
        self.is_dirty = is_dirty;
        self.is_dirty.fill(false);
    }
}
