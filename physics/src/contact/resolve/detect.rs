//! Exact intersections of an outfit, updated as vertices move.

use std::collections::HashMap;

use super::obstacle::BodyObstacle;
use super::packed_cloth::PackedCloth;
use crate::contact::TriangleTree;
use crate::vec3::distance_squared;

/// Pairs of triangles that intersect. Faces of garments are numbered through.
pub(super) struct IntersectingPairs {
    /// (face, face of the body)
    pub body: Vec<(u32, u32)>,
    /// (face of the outer garment, face of the inner one)
    pub layers: Vec<(u32, u32)>,
    /// Two faces of one garment, ascending.
    pub self_pairs: Vec<(u32, u32)>,
    /// Faces whose intersections have to be looked for (again).
    pub is_dirty: Vec<bool>,
}

impl IntersectingPairs {
    pub fn new(faces: usize) -> Self {
        Self { body: Vec::new(), layers: Vec::new(), self_pairs: Vec::new(), is_dirty: vec![true; faces] }
    }

    /// All pairs.
    pub fn count(&self) -> usize {
        self.between() + self.self_pairs.len()
    }

    /// Pairs with the body and between garments.
    pub fn between(&self) -> usize {
        self.body.len() + self.layers.len()
    }

    /// Looks at the faces that are dirty. `trees` are those of the garments, `far` the distances of vertices to the
    /// body; garments with themselves, and where the body is pinched, only count if asked for.
    pub fn update(
        &mut self,
        outfit: &PackedCloth<'_>,
        body: &BodyObstacle<'_>,
        trees: &[TriangleTree<'_>],
        positions: &[[f64; 3]],
        far: &[f64],
        (with_self, with_pinched): (bool, bool),
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
                let over = trees[inner].pairs_of_faces(positions, &outfit.faces, &moved[outer], |_| true);
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

        if with_self {
            self.self_pairs.retain(|&(f, g)| is_clean(f) && is_clean(g));
            for (g, faces) in moved.iter().enumerate() {
                let first = outfit.faces_of_garment(g).start;
                let local: Vec<u32> = faces.iter().map(|f| f - first).collect();
                let found = trees[g].self_pairs_of_faces(&local);
                let packed = found.into_iter().map(|(f, g)| (f + first, g + first));
                self.self_pairs.extend(packed.filter(|&(f, g)| !(is_pinch(f) && is_pinch(g))));
            }
            self.self_pairs.sort_unstable();
        }
        self.is_dirty = is_dirty;
        self.is_dirty.fill(false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::resolve::{Layer, RestGarment};
    use crate::contact::{Triangle, triangles_intersect};
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::Surface;
    use crate::vec3::add;

    /// All pairs of faces, by looking at each.
    fn all_pairs<'a>(
        outfit: &'a PackedCloth<'_>,
        positions: &'a [[f64; 3]],
        body: &'a Surface<f64>,
    ) -> [Vec<(u32, u32)>; 2] {
        let triangle = |face: [u32; 3], of: &[[f64; 3]]| -> Triangle { face.map(|v| of[v as usize]) };
        let faces = || (0u32..).zip(&outfit.faces).map(|(f, face)| (f, triangle(*face, positions)));
        let of_body =
            || (0u32..).zip(body.faces.iter()).map(|(f, face)| (f, triangle(*face, &body.positions)));
        let with_body = faces().flat_map(|(f, a)| {
            of_body().filter(move |(_, b)| triangles_intersect(&a, b)).map(move |(b, _)| (f, b))
        });
        let is_outer = |f: u32, g: u32| outfit.garment_of_face(f) > outfit.garment_of_face(g);
        let between = faces().flat_map(|(f, a)| {
            faces()
                .filter(move |(g, b)| is_outer(f, *g) && triangles_intersect(&a, b))
                .map(move |(g, _)| (f, g))
        });
        [with_body.collect(), between.collect()]
    }

    /// Few or all of the vertices move each time: what is kept and what is found anew is what there is.
    #[test]
    fn updated_intersections_are_all_intersections() {
        let mut random = SplitMix::new(7);
        let ball = Surface::from_mesh(&shapes::icosphere(0.1, 2));
        let meshes = [9, 10, 11].map(|n| shapes::irregular_grid(0.1, 0.1, n, n, 0.2, n as u64));
        let garments = meshes.each_ref().map(RestGarment::new);
        let on_top = |mesh: &crate::mesh::TriMesh| -> Vec<[f64; 3]> {
            mesh.positions().iter().map(|[x, y, _]| [x - 0.05, 0.099, y - 0.05]).collect()
        };
        let places = meshes.each_ref().map(on_top);
        let layers: Vec<Layer<'_>> =
            garments.iter().zip(&places).map(|(garment, positions)| Layer { garment, positions }).collect();
        let outfit = PackedCloth::new(&layers);
        let near = vec![true; ball.positions.len()];
        let body = BodyObstacle::new(&ball, near);
        let mut positions = places.concat();
        let mut kept = IntersectingPairs::new(outfit.faces.len());
        let mut counts = [0; 3];
        for round in 0..12 {
            // All, one in ten, and all of a garment but none of the others.
            let moves = |v: u32, chance: f64| match round % 3 {
                0 => true,
                1 => chance < 0.1,
                _ => outfit.garment_of(v) == round / 3 % 3,
            };
            for v in 0..outfit.vertex_count() as u32 {
                if moves(v, 0.5 + 0.5 * random.symmetric()) {
                    let by = std::array::from_fn(|_| 0.006 * random.symmetric());
                    positions[v as usize] = add(positions[v as usize], by);
                    outfit.faces_at(v).for_each(|f| kept.is_dirty[f as usize] = true);
                }
            }
            let trees: Vec<TriangleTree<'_>> = (0..outfit.len())
                .map(|g| TriangleTree::new(outfit.part(&positions, g), &layers[g].garment.faces))
                .collect();
            let far: Vec<f64> = positions.iter().map(|p| body.look(*p).unwrap().far).collect();
            kept.update(&outfit, &body, &trees, &positions, &far, (true, true));
            let [with_body, between] = all_pairs(&outfit, &positions, &ball);
            assert_eq!(kept.body, with_body, "round {round}");
            assert_eq!(kept.layers, between, "round {round}");
            let self_pairs: Vec<(u32, u32)> = trees
                .iter()
                .enumerate()
                .flat_map(|(g, tree)| {
                    let first = outfit.faces_of_garment(g).start;
                    tree.self_pairs().into_iter().map(move |(a, b)| (a + first, b + first))
                })
                .collect();
            assert_eq!(kept.self_pairs, self_pairs, "round {round}");
            let found = [with_body.len(), between.len(), self_pairs.len()];
            counts = std::array::from_fn(|k| counts[k] + found[k]);
        }
        assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
    }
}
