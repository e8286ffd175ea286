//! One round: the conditions of intersections and of vertices on the wrong side, and the relaxation that meets them.

use super::super::condition::{Condition, is_tiny, normal_of};
use super::super::layer_constraint::{order, part_along, part_from_body, sum_over};
use super::super::relax::{LastPasses, no_farther, relax};
use super::super::self_intersections::part_self_intersections;
use super::UntanglingState;
use crate::vec3::{add, add_scaled, dot, norm, sub};

/// Sweeps of the relaxation in a round.
const SWEEPS: usize = 20;
/// Longest step that a condition asks for in a round (m).
const LONGEST_ASKED_STEP: f64 = 0.02;

impl UntanglingState<'_> {
    /// Separates what intersects or lies on the wrong side, with its neighbourhood.
    pub(super) fn step(&mut self, round: usize) {
        let gap = self.settings.gap * (1.0 + 0.1 * round as f64).min(3.0);
        let outfit = self.outfit;
        let (mut asked, crumpled) = match self.orientation {
            None => self.part_self_intersections(0.25 * gap),
            Some(_) => (Vec::new(), self.folded()),
        };
        let mut seeds: Vec<u32> = asked.iter().flat_map(|c| c.vertices).chain(crumpled).collect();
        for &(f, g) in &self.intersections.layers {
            let (outer, inner) = (outfit.faces[f as usize], outfit.faces[g as usize]);
            seeds.extend(outer.iter().chain(&inner));
            let has_orientation = self.orientation.is_some_and(|orientation| !orientation.is_unknown(f, g));
            if !has_orientation && let Some(away) = order(outer, inner, true, &self.outward) {
                part_along(away, outer, inner, &self.positions, 0.5 * gap, LONGEST_ASKED_STEP, &mut asked);
            }
        }
        for &(f, other) in &self.intersections.body {
            seeds.extend(outfit.faces[f as usize]);
            self.part_from_body(f, other, gap, &mut asked);
        }
        self.remembered.extend(asked);
        let least = self.least(round);
        for o in self.over.iter().filter(|o| o.height < least) {
            seeds.push(o.vertex);
            seeds.extend(o.face);
        }
        let violated = (0..self.planes.len() as u32)
            .filter(|&v| self.planes[v as usize].is_some_and(|p| self.is_violated(&p, round)));
        seeds.extend(violated);

        let region = outfit.neighbourhood(&seeds, self.settings.rings);
        let mut is_in = vec![false; self.positions.len()];
        region.iter().for_each(|&v| is_in[v as usize] = true);
        let mut contacts: Vec<Condition> = Vec::new();
        for o in self.over.iter().filter(|o| is_in[o.vertex as usize]) {
            contacts.push(o.contact(gap.min(o.height + LONGEST_ASKED_STEP)));
        }
        contacts.extend(&self.remembered);
        let watch = self.watch();
        // The body last, so that it has the last word.
        for &v in &region {
            let Some(plane) = self.planes[v as usize].filter(|p| p.distance < watch) else { continue };
            let wanted = if plane.is_held { plane.distance.clamp(0.0, gap) } else { gap };
            let step = (wanted - plane.distance).min(LONGEST_ASKED_STEP);
            let moved = sub(self.positions[v as usize], self.input[v as usize]);
            if norm(add_scaled(moved, step, plane.normal)) <= self.farthest {
                contacts.push(Condition::vertex(v, &plane, plane.distance + step));
            }
        }
        // Contact orientation matters more than the body: cloth that has passed through cloth would not come back.
        let last = match self.orientation {
            None => LastPasses::FEW,
            Some(orientation) => {
                orientation.contacts(&self.positions, &is_in, self.settings.gap, &mut contacts);
                LastPasses::ALL
            }
        };
        relax(outfit, &mut self.positions, &self.shape, &region, &contacts, self.stretch, (SWEEPS, last));
        for &v in &region {
            let v = v as usize;
            self.positions[v] = no_farther(self.input[v], self.positions[v], self.farthest);
        }
        self.touch(&region);
    }

    /// Vertices of faces that intersect others of their garment.
    fn folded(&self) -> Vec<u32> {
        let faces = self.intersections.self_pairs.iter().flat_map(|&(f, g)| [f, g]);
        faces.flat_map(|f| self.outfit.faces[f as usize]).collect()
    }

    /// The part of a face over a face of the body has to leave it.
    fn part_from_body(&self, f: u32, other: u32, gap: f64, found: &mut Vec<Condition>) {
        let face = self.outfit.faces[f as usize];
        let Some(lower) = self.body.tree.triangle(other).filter(|t| !is_tiny(t)) else { return };
        let normal = normal_of(&lower);
        // A face on the other side of the limb would pull cloth through it.
        let away = sum_over(face, &self.outward);
        let seen = face.iter().fold([0.0; 3], |sum, &v| {
            add(sum, self.planes[v as usize].filter(|p| p.distance > 0.0).map_or([0.0; 3], |p| p.normal))
        });
        if dot(normal, away) < 0.0 && dot(normal, seen) <= 0.0 {
            return;
        }
        part_from_body(face, &self.positions, &lower, (0.5 * gap, LONGEST_ASKED_STEP), found);
    }

    /// Conditions that part intersections of garments with themselves, and crumpled vertices, which are smoothed.
    fn part_self_intersections(&mut self, gap: f64) -> (Vec<Condition>, Vec<u32>) {
        let (mut contacts, mut folded) = (Vec::new(), Vec::new());
        for &(f, g) in &self.intersections.self_pairs {
            let (one, other) = (self.outfit.faces[f as usize], self.outfit.faces[g as usize]);
            match order(one, other, false, &self.outward) {
                Some(away) => {
                    part_along(away, one, other, &self.positions, gap, LONGEST_ASKED_STEP, &mut contacts);
                }
                None => folded.push((f, g)),
            }
        }
        let before = self.positions.clone();
        let pairs = (folded.as_slice(), self.known_self_intersections.as_slice());
        let smoothed = (self.positions.as_mut_slice(), self.shape.as_mut_slice());
        let (more, crumpled) = part_self_intersections(self.outfit, pairs, gap, &before, smoothed);
        contacts.extend(more);
        (contacts, crumpled)
    }
}
