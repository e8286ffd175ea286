//! The certificate at the end of the fast pass, from what its filter and its looks at the body know by then.

use super::FastPass;
use crate::contact::resolve::certificate::Certificate;
use crate::contact::resolve::count::{certified_around, counted, is_near};
use crate::contact::resolve::garment::at;
use crate::contact::{ReportBody, Triangle, TriangleTree};

impl FastPass<'_> {
    /// The certificate of the garments, which are at `positions` now: what is known is not looked for again.
    pub(super) fn certificate(&self, positions: &[Vec<[f64; 3]>]) -> Certificate {
        let now = at(self.outfit.layers, positions);
        if !is_near(self.outfit.layers, positions) {
            return certified_around(self.body.surface, &now);
        }
        counted(self, &now)
    }
}

/// All intersections are known exactly, and where every vertex lies.
impl ReportBody for FastPass<'_> {
    fn tree(&self) -> &TriangleTree<'_> {
        &self.body.tree
    }

    fn distance(&self, p: [f64; 3]) -> Option<(f64, [f64; 3])> {
        self.body.distance(p)
    }

    fn distances(&self, garment: usize, _: &[[f64; 3]]) -> Vec<Option<(f64, [f64; 3])>> {
        let vertices = self.outfit.vertices(garment);
        let planes = &self.planes[vertices.start as usize..vertices.end as usize];
        planes.iter().map(|plane| plane.map(|plane| (plane.distance, plane.normal))).collect()
    }

    fn known_pairs(&self, garment: usize, with: Option<usize>) -> Option<Vec<(u32, u32)>> {
        let of = |f: u32| (!self.filter.mesh.is_body(f)).then(|| self.outfit.garment_of_face(f));
        let first = |g: usize| self.outfit.faces_of_garment(g).start;
        // The inner garment comes first in the pairs of the filter, the body last.
        let is_self_pair = with == Some(garment);
        let local = |&(f, g): &(u32, u32)| match with {
            None if of(f) == Some(garment) => Some((f - first(garment), self.body_face(g)?)),
            Some(inner) if of(f) == Some(inner) && of(g) == Some(garment) => {
                let (f, g) = (f - first(inner), g - first(garment));
                Some(if is_self_pair { (f, g) } else { (g, f) })
            }
            _ => None,
        };
        let mut pairs: Vec<(u32, u32)> = self.filter.intersections.iter().filter_map(local).collect();
        pairs.sort_unstable();
        Some(pairs)
    }

    fn is_pinched(&self, face: u32) -> bool {
        self.body.is_pinched(face)
    }

    fn is_pinched_at(&self, triangle: &Triangle) -> bool {
        self.body.is_pinch_at(triangle)
    }
}
