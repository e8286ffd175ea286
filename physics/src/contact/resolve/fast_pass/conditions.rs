//! Where an outfit intersects, and the conditions there.

use super::FastPass;
use crate::contact::resolve::condition::{Condition, Plane, along_line, is_tiny, normal_of};
use crate::contact::resolve::layer_constraint::{
    LayerConstraint, OutermostSheet, STEEP, order, part_along, part_from_body, sum_over,
};
use crate::contact::step_filter::{Bounds, ElementPair, closest_on_edges};
use crate::vec3::{add_scaled, cross, dot, normalized, scale, sub};
use rayon::prelude::*;

/// Elements nearer than this are kept apart (m).
const NEAR_ELEMENTS: f64 = 0.003;
/// Deeper in each other than this (m), elements of garments are ordered by the sheets around them, not by their own planes.
const DEEPEST_BY_PLANES: f64 = 0.012;
/// How far under an inner garment an outer one is still brought over it (m): half a thin limb.
const DEEPEST_UNDER: f64 = 0.025;
/// Contacts between elements whose directions differ more than this (cosine) are left to others near them.
const LEAST_ALONG: f64 = 0.6;

/// The part of an outfit that may move.
#[derive(Default)]
pub(super) struct DefectRegion {
    /// The vertices that may move: those on the wrong side or of triangles that intersect, and their neighbourhood; ascending.
    pub region: Vec<u32>,
    is_in: Vec<bool>,
    /// What the body leaves to the vertices of the region that are near it.
    planes: Vec<(u32, Plane)>,
    /// Vertices of the region that have a sheet of an inner garment near.
    over: Vec<LayerConstraint>,
}

impl FastPass<'_> {
    /// The defects now: vertices on the wrong side are searched outward from intersecting triangles.
    pub(super) fn defects(&self) -> DefectRegion {
        let outfit = self.outfit;
        let mut found = DefectRegion { is_in: vec![false; self.input.len()], ..DefectRegion::default() };
        let cloth_of = |&(f, g): &(u32, u32)| {
            let other = if self.filter.mesh.is_body(g) { f } else { g };
            [f, other].into_iter().flat_map(|f| outfit.faces[f as usize])
        };
        let mut seeds: Vec<u32> =
            self.parted().chain(self.parted_self_intersections()).flat_map(cloth_of).collect();
        loop {
            let region = outfit.neighbourhood(&seeds, super::RINGS);
            let new: Vec<u32> = region.iter().copied().filter(|&v| !found.is_in[v as usize]).collect();
            if new.is_empty() {
                found.region.sort_unstable();
                return found;
            }
            new.iter().for_each(|&v| found.is_in[v as usize] = true);
            let looked: Vec<_> = new.par_iter().with_min_len(64).map(|&v| self.look(v)).collect();
            seeds.clear();
            for (&v, (plane, over)) in new.iter().zip(looked) {
                found.region.push(v);
                if plane.is_some_and(|p| p.distance < 0.0 && !p.is_held) {
                    seeds.push(v);
                }
                found.planes.extend(plane.map(|plane| (v, plane)));
                for over in over {
                    if over.height < 0.0 {
                        seeds.push(v);
                        seeds.extend(over.face);
                    }
                    found.over.push(over);
                }
            }
        }
    }

    /// What the body leaves to vertex `v`, and which sheets of inner garments it has to stay over.
    fn look(&self, v: u32) -> (Option<Plane>, Vec<LayerConstraint>) {
        let (p, away) = (self.positions[v as usize], self.outward[v as usize]);
        let plane = self.planes[v as usize].filter(|plane| plane.distance < NEAR_ELEMENTS);
        (self.body.back_from_through(plane, p, away, self.settings.farthest), self.sheets_over(v))
    }

    /// Of every inner garment the outermost sheet that lies less than [`DEEPEST_UNDER`] over vertex `v`.
    fn sheets_over(&self, v: u32) -> Vec<LayerConstraint> {
        let (p, away, garment) =
            (self.positions[v as usize], self.outward[v as usize], self.outfit.garment_of(v));
        if away == [0.0; 3] || garment == 0 {
            return Vec::new();
        }
        let outermost = |_| OutermostSheet { from: p, away, heights: 0.0..=DEEPEST_UNDER, found: None };
        let mut outermost: Vec<OutermostSheet> = (0..garment).map(outermost).collect();
        self.filter.cloth_faces_meeting(&Bounds::around([p, add_scaled(p, DEEPEST_UNDER, away)]), |f| {
            if let Some(outermost) = outermost.get_mut(self.outfit.garment_of_face(f)) {
                outermost.offer(f, self.outfit.faces[f as usize], &self.positions, &self.outward);
            }
        });
        outermost.into_iter().filter_map(|sheet| sheet.over(v, self.outfit, &self.positions)).collect()
    }

    /// What has to hold in the region of `defects` and next to it.
    pub(super) fn conditions(&mut self, defects: &DefectRegion) -> Vec<Condition> {
        let is_in = &defects.is_in;
        let mesh = self.filter.mesh;
        let is_near = |f: u32| !mesh.is_body(f) && mesh.faces[f as usize].iter().any(|&v| is_in[v as usize]);
        let candidates = self.filter.candidates(&is_near, NEAR_ELEMENTS);
        let this = &*self;
        let mut contacts: Vec<Condition> = candidates
            .par_chunks(256)
            .flat_map_iter(|chunk| {
                let mut found = Vec::new();
                chunk.iter().for_each(|&(f, g)| this.keep_apart(f, g, &mut found));
                found
            })
            .collect();
        let gap = self.settings.gap;
        let mut parting = Vec::new();
        for &(f, g) in self.parted() {
            if mesh.is_body(g) {
                self.part_from_body(f, g, &mut parting);
                continue;
            }
            let (outer, inner) = (mesh.faces[f.max(g) as usize], mesh.faces[f.min(g) as usize]);
            if let Some(away) = order(outer, inner, true, &self.outward) {
                part_along(away, outer, inner, &self.positions, 0.5 * gap, DEEPEST_UNDER, &mut parting);
            }
        }
        self.remembered.extend(parting);
        contacts.extend(&self.remembered);
        contacts.extend(defects.over.iter().map(|over| over.contact(gap)));
        // The body last, so that it has the last word.
        for (v, plane) in &defects.planes {
            let wanted =
                if plane.is_held { plane.distance.clamp(0.0, gap) } else { self.wanted(plane.distance) };
            contacts.push(Condition::vertex(*v, plane, wanted));
        }
        contacts
    }

    /// The part of a face that lies over a face of the body has to come out of it.
    fn part_from_body(&self, f: u32, g: u32, found: &mut Vec<Condition>) {
        let ground = self.corners(g);
        if !is_tiny(&ground) && !self.is_other_side(f, normal_of(&ground)) {
            let face = self.outfit.faces[f as usize];
            part_from_body(face, &self.positions, &ground, (0.5 * self.settings.gap, DEEPEST_UNDER), found);
        }
    }

    /// Whether a face of the body with this `normal` is on the other side of a limb that face `f` has gone into.
    fn is_other_side(&self, f: u32, normal: [f64; 3]) -> bool {
        let seen = |&v: &u32| {
            let plane = &self.planes[v as usize];
            plane.as_ref().is_some_and(|plane| plane.distance > 0.0 && dot(plane.normal, normal) > 0.0)
        };
        let face = self.outfit.faces[f as usize];
        dot(normal, sum_over(face, &self.outward)) < 0.0 && !face.iter().any(seen)
    }

    /// How far apart what is `height` apart (m) has to get: what is too near gets the gap, the rest only keeps from
    /// coming too near.
    fn wanted(&self, height: f64) -> f64 {
        let least = self.settings.least_gap();
        if height < least { self.settings.gap } else { least }
    }

    /// Conditions on the elements of faces `f` and `g`, if it is known which of them lies over the other.
    fn keep_apart(&self, f: u32, g: u32, found: &mut Vec<Condition>) {
        let mesh = self.filter.mesh;
        // Along which direction the second lies under the first.
        let (over, away) = match self.body_face(g) {
            Some(face) if self.body.is_pinched(face) => return,
            Some(_) => {
                let normal = normal_of(&self.corners(g));
                if self.is_other_side(f, normal) {
                    return;
                }
                (f, Some(normal))
            }
            None => {
                let (over, under) = (f.max(g), f.min(g));
                let is_outer = self.outfit.garment_of_face(over) != self.outfit.garment_of_face(under);
                if !is_outer && !self.settings.self_contact {
                    return;
                }
                match order(mesh.faces[over as usize], mesh.faces[under as usize], is_outer, &self.outward) {
                    Some(away) => (over, Some(away)),
                    // Sheets of one garment stay on the side of each other that they are on.
                    None if !is_outer && !self.intersect(f, g) => (over, None),
                    None => return,
                }
            }
        };
        let upper = mesh.faces[over as usize];
        mesh.element_pairs(f, g, |pair| {
            let is_first = pair.first_vertices().iter().all(|v| upper.contains(v));
            let contact = match pair.has_face {
                true => self.over_face(&pair, is_first, away),
                false => self.over_edge(&pair, is_first, away),
            };
            found.extend(contact);
        });
    }

    fn intersect(&self, f: u32, g: u32) -> bool {
        self.filter.intersections.binary_search(&(f.min(g), f.max(g))).is_ok()
    }

    /// The side of a plane with this `normal` on which an element has to be: over the other element along `away` or
    /// under it; where that is not known, where it is by its `height`. None where the plane is too steep to tell.
    fn side(
        &self,
        normal: [f64; 3],
        (is_over, away): (bool, Option<[f64; 3]>),
        height: f64,
        least: f64,
    ) -> Option<f64> {
        let Some(away) = away else { return Some(height.signum()) };
        let slope = dot(normal, away);
        (slope.abs() >= least).then_some(if (slope > 0.0) == is_over { 1.0 } else { -1.0 })
    }

    /// The vertex of `pair` over its face along `away`, or under it.
    fn over_face(&self, pair: &ElementPair, is_over: bool, away: Option<[f64; 3]>) -> Option<Condition> {
        let [p, a, b, c] = pair.vertices.map(|v| self.positions[v as usize]);
        if is_tiny(&[a, b, c]) {
            return None;
        }
        let normal = normal_of(&[a, b, c]);
        let height = dot(normal, sub(p, a));
        let side = self.side(normal, (is_over, away), height, STEEP)?;
        let (up, height) = (scale(normal, side), side * height);
        if !(-self.deepest(pair)..NEAR_ELEMENTS).contains(&height) {
            return None;
        }
        let (_, at) = along_line(p, normal, &[a, b, c])?;
        let weights = [1.0, -at[0], -at[1], -at[2]];
        self.contact(pair.vertices, weights, (up, height), away.is_none())
    }

    /// The first edge of `pair` over its second along `away`, or under it.
    fn over_edge(&self, pair: &ElementPair, is_over: bool, away: Option<[f64; 3]>) -> Option<Condition> {
        let [p, q, r, s] = pair.vertices.map(|v| self.positions[v as usize]);
        let [t, u] = closest_on_edges([p, q], [r, s]);
        let is_inner = |t: f64| t > 0.0 && t < 1.0;
        let normal = normalized(cross(sub(q, p), sub(s, r)));
        if !is_inner(t) || !is_inner(u) || normal == [0.0; 3] {
            return None;
        }
        let weights = [1.0 - t, t, u - 1.0, -u];
        let height = (0..4).map(|k| weights[k] * dot(normal, [p, q, r, s][k])).sum::<f64>();
        let side = self.side(normal, (is_over, away), height, LEAST_ALONG)?;
        let (up, height) = (scale(normal, side), side * height);
        (-self.deepest(pair)..NEAR_ELEMENTS)
            .contains(&height)
            .then(|| self.contact(pair.vertices, weights, (up, height), away.is_none()))
            .flatten()
    }

    /// How deep in each other (m) elements are still ordered by their own planes: in the body, vertices know better how deep they
    /// are.
    fn deepest(&self, pair: &ElementPair) -> f64 {
        let is_body = |v: &u32| *v as usize >= self.input.len();
        if pair.vertices.iter().any(is_body) { self.settings.gap } else { DEEPEST_BY_PLANES }
    }

    /// A condition on four vertices, of which those of the body are where they are.
    fn contact(
        &self,
        vertices: [u32; 4],
        weights: [f64; 4],
        (normal, height): ([f64; 3], f64),
        keeps: bool,
    ) -> Option<Condition> {
        let cloth = self.input.len() as u32;
        let mut contact = Condition {
            vertices: [0; 6],
            weights: [0.0; 6],
            count: 0,
            normal,
            target: if keeps { height.min(self.settings.least_gap()) } else { self.wanted(height) },
        };
        for (v, w) in vertices.into_iter().zip(weights) {
            if v < cloth {
                contact.vertices[usize::from(contact.count)] = v;
                contact.weights[usize::from(contact.count)] = w;
                contact.count += 1;
            } else {
                contact.target -= w * dot(normal, self.positions[v as usize]);
            }
        }
        (contact.count > 0).then_some(contact)
    }
}
