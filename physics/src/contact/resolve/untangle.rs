//! Brings all garments of an outfit to the right side of the body and of each other, together.

use std::time::Instant;

use rayon::prelude::*;

use super::ResolveSettings;
use super::contact::{Contact, is_tiny, normal_of, overlap};
use super::detect::Crossings;
use super::folds::folds;
use super::obstacle::{BodyObstacle, Plane};
use super::outfit::Outfit;
use super::over::{Order, Over, all_over, order, outward, part_along};
use super::relax::relax;
use crate::contact::intersections::{KeptTree, TriangleTree};
use crate::vec3::{add, add_scaled, dot, norm, norm_squared, scale, sub};

/// A half-space is remembered for a vertex that is nearer to it than this [m]: smoothing may carry it there.
const WATCH: f64 = 0.01;
/// No contact asks for a longer step than this in a round [m].
const LONGEST_STEP: f64 = 0.02;
/// Rounds without progress after which an outfit is left as it is.
const PATIENCE: usize = 8;
/// Rounds in which vertices that are merely closer than asked for still count.
const ROUNDS_FOR_GAPS: usize = 3;

/// An outfit on its way.
pub(super) struct Untangling<'a> {
    outfit: &'a Outfit<'a>,
    body: &'a BodyObstacle<'a>,
    settings: &'a ResolveSettings,
    /// Limits of the present attempt, as in the settings.
    farthest: f64,
    stretch: f64,
    input: Vec<[f64; 3]>,
    /// The shape that displacements are measured from: the input, with its crumples smoothed.
    shape: Vec<[f64; 3]>,
    pub positions: Vec<[f64; 3]>,
    /// Distance of every vertex to the body's exposed surface, without sign [m].
    far: Vec<f64>,
    /// What the body leaves to it; none where the body is pinched.
    planes: Vec<Option<Plane>>,
    /// Directions away from the body; zero where there is none.
    outward: Vec<[f64; 3]>,
    over: Vec<Over>,
    /// Trees of the garments where they were last looked at.
    trees: Vec<KeptTree>,
    crossings: Crossings,
    /// Crossings of the input's garments with themselves, ascending.
    known_folds: Vec<(u32, u32)>,
    /// Conditions that all crossings so far asked for: a mended place would be torn again by its neighbours without them.
    remembered: Vec<Contact>,
}

/// How wrong a state is: fewer is better, in this order.
type Defects = (usize, usize);

/// The best state so far.
#[derive(Default)]
struct Best {
    defects: Option<Defects>,
    positions: Vec<[f64; 3]>,
    /// Rounds since it was found.
    stale: usize,
}

impl Best {
    fn look(&mut self, defects: Defects, positions: &[[f64; 3]]) {
        self.stale += 1;
        if self.defects.is_none_or(|least| defects < least) {
            *self = Self { defects: Some(defects), positions: positions.to_vec(), stale: 0 };
        }
    }
}

impl<'a> Untangling<'a> {
    pub fn new(outfit: &'a Outfit<'a>, body: &'a BodyObstacle<'a>, settings: &'a ResolveSettings) -> Self {
        let input: Vec<[f64; 3]> = outfit.layers.iter().flat_map(|l| l.positions).copied().collect();
        let count = input.len();
        let mut untangling = Self {
            outfit,
            body,
            settings,
            farthest: settings.farthest,
            stretch: settings.stretch,
            shape: input.clone(),
            positions: input.clone(),
            input,
            far: vec![0.0; count],
            planes: vec![None; count],
            outward: vec![[0.0; 3]; count],
            over: Vec::new(),
            trees: (0..outfit.len()).map(|_| KeptTree::default()).collect(),
            crossings: Crossings::new(outfit.faces.len()),
            known_folds: Vec::new(),
            remembered: Vec::new(),
        };
        let all: Vec<u32> = (0..count as u32).collect();
        untangling.touch(&all);
        let away = |v: u32| untangling.planes[v as usize].map_or([0.0; 3], |p| p.normal);
        untangling.outward = outward(outfit, &untangling.positions, away);
        // Now that it is known which way is out.
        let is_inside = |&v: &u32| untangling.planes[v as usize].is_some_and(|p| p.distance < 0.0);
        let inside: Vec<u32> = all.into_iter().filter(is_inside).collect();
        untangling.touch(&inside);
        untangling
    }

    /// Rounds of detection and relaxation until nothing is wrong or nothing gets better; how many it took. Where crossings
    /// are left, a second attempt with wider limits is kept if it ends with none.
    pub fn run(&mut self) -> usize {
        let start = Instant::now();
        self.detect();
        self.known_folds.clone_from(&self.crossings.own);
        let rounds = self.attempt(start);
        if self.crossings.between() == 0 || self.settings.loosened <= 1.0 || self.is_late(start) {
            return rounds;
        }
        let (positions, shape) = (self.positions.clone(), self.shape.clone());
        self.farthest *= self.settings.loosened;
        self.stretch = 1.0 + (self.stretch - 1.0) * self.settings.loosened;
        let more = self.attempt(start);
        if self.crossings.between() > 0 || self.crossings.own.len() > self.known_folds.len() {
            self.move_to(&positions);
            self.shape = shape;
            self.detect();
        }
        rounds + more
    }

    /// Rounds within the limits as they are. The crossings are those of the positions afterwards.
    fn attempt(&mut self, start: Instant) -> usize {
        let mut best = Best::default();
        for round in 0..=self.settings.rounds {
            let is_violated = self.planes.iter().flatten().any(|p| self.is_violated(p, round))
                || self.over.iter().any(|o| o.height < self.least(round));
            if !is_violated && self.crossings.count() == 0 {
                return round;
            }
            best.look(self.defects(), &self.positions);
            if round == self.settings.rounds || best.stale > PATIENCE || self.is_late(start) {
                self.move_to(&best.positions);
                self.detect();
                return round;
            }
            self.step(round);
            self.detect();
        }
        self.settings.rounds
    }

    fn is_late(&self, start: Instant) -> bool {
        self.settings.is_late(start, self.outfit.len())
    }

    /// Pairs that are left, and vertices on the wrong side.
    fn defects(&self) -> Defects {
        let wrong = self.planes.iter().flatten().filter(|p| self.is_violated(p, ROUNDS_FOR_GAPS)).count()
            + self.over.iter().filter(|o| o.height < 0.0).count();
        (self.crossings.count() + wrong, wrong)
    }

    /// The distance that counts as too close in a round: what is merely close is left alone after the first ones.
    fn least(&self, round: usize) -> f64 {
        if round < ROUNDS_FOR_GAPS { self.settings.trigger * self.settings.gap } else { 0.0 }
    }

    fn is_violated(&self, plane: &Plane, round: usize) -> bool {
        !plane.is_held && plane.distance < self.least(round)
    }

    /// Brings crossings and the order of layers up to date.
    fn detect(&mut self) {
        let (outfit, positions) = (self.outfit, &self.positions);
        let trees: Vec<TriangleTree<'_>> = std::mem::take(&mut self.trees)
            .into_par_iter()
            .enumerate()
            .map(|(g, tree)| {
                TriangleTree::refitted(tree, outfit.part(positions, g), &outfit.layers[g].garment.faces)
            })
            .collect();
        let reach = (self.settings.reach, WATCH);
        self.over = all_over(outfit, &trees, positions, &self.outward, reach);
        self.crossings.update(outfit, self.body, &trees, positions, &self.far, self.settings.self_contact);
        self.trees = trees.into_iter().map(TriangleTree::into_kept).collect();
    }

    fn step(&mut self, round: usize) {
        let gap = self.settings.gap * (1.0 + 0.1 * round as f64).min(3.0);
        let outfit = self.outfit;
        let (mut asked, crumpled) = self.part_folds(0.25 * gap);
        let mut seeds: Vec<u32> = asked.iter().flat_map(|c| c.vertices).chain(crumpled).collect();
        for &(f, g) in &self.crossings.layers {
            let (outer, inner) = (outfit.faces[f as usize], outfit.faces[g as usize]);
            seeds.extend(outer.iter().chain(&inner));
            if let Order::Along(away) = order(outer, inner, true, &self.outward) {
                part_along(away, outer, inner, &self.positions, 0.5 * gap, LONGEST_STEP, &mut asked);
            }
        }
        for &(f, other) in &self.crossings.body {
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
        let mut contacts: Vec<Contact> = Vec::new();
        for o in self.over.iter().filter(|o| is_in[o.vertex as usize]) {
            contacts.push(o.contact(gap.min(o.height + LONGEST_STEP)));
        }
        contacts.extend(&self.remembered);
        // The body last, so that it has the last word.
        for &v in &region {
            let Some(plane) = self.planes[v as usize].filter(|p| p.distance < WATCH) else { continue };
            let wanted = if plane.is_held { plane.distance.clamp(0.0, gap) } else { gap };
            let step = (wanted - plane.distance).min(LONGEST_STEP);
            let moved = sub(self.positions[v as usize], self.input[v as usize]);
            if norm(add_scaled(moved, step, plane.normal)) <= self.farthest {
                contacts.push(Contact::vertex(v, &plane, plane.distance + step));
            }
        }
        let (sweeps, stretch) = (self.settings.sweeps, self.stretch);
        relax(outfit, &mut self.positions, &self.shape, &region, &contacts, sweeps, stretch);
        self.hold_back(&region);
        self.touch(&region);
    }

    /// Takes vertices back that went farther than allowed.
    fn hold_back(&mut self, region: &[u32]) {
        for &v in region {
            let v = v as usize;
            let moved = sub(self.positions[v], self.input[v]);
            let most = self.farthest;
            if norm_squared(moved) > most * most {
                self.positions[v] = add_scaled(self.input[v], most / norm(moved), moved);
            }
        }
    }

    /// The part of a face over a face of the body has to come out of it.
    fn part_from_body(&self, f: u32, other: u32, gap: f64, found: &mut Vec<Contact>) {
        let face = self.outfit.faces[f as usize];
        let upper = face.map(|v| self.positions[v as usize]);
        let Some(lower) = self.body.tree.triangle(other).filter(|t| !is_tiny(t)) else { return };
        let normal = normal_of(&lower);
        // A face on the other side of the limb asks for the way through it.
        let away = face.iter().fold([0.0; 3], |sum, &v| add(sum, self.outward[v as usize]));
        let seen = face.iter().fold([0.0; 3], |sum, &v| {
            add(sum, self.planes[v as usize].filter(|p| p.distance > 0.0).map_or([0.0; 3], |p| p.normal))
        });
        if dot(normal, away) < 0.0 && dot(normal, seen) <= 0.0 {
            return;
        }
        // The ground under the corner, as a height along the normal.
        let ground = dot(normal, lower[0]);
        for corner in overlap(&upper, &lower, normal).iter().filter(|c| c.height < 0.5 * gap) {
            let target = ground + (0.5 * gap).min(corner.height + LONGEST_STEP);
            found.push(Contact::face_point(face, corner.at_upper, normal, target));
        }
    }

    /// Conditions that part crossings of garments with themselves, and crumpled vertices, which are smoothed.
    fn part_folds(&mut self, gap: f64) -> (Vec<Contact>, Vec<u32>) {
        let (mut contacts, mut crumpled) = (Vec::new(), Vec::new());
        let own = std::mem::take(&mut self.crossings.own);
        let mut folded = Vec::new();
        for &(f, g) in &own {
            let (one, other) = (self.outfit.faces[f as usize], self.outfit.faces[g as usize]);
            match order(one, other, false, &self.outward) {
                Order::Along(away) => {
                    part_along(away, one, other, &self.positions, gap, LONGEST_STEP, &mut contacts);
                }
                Order::Unknown => folded.push((f, g)),
            }
        }
        for of_garment in
            folded.chunk_by(|a, b| self.outfit.garment_of_face(a.0) == self.outfit.garment_of_face(b.0))
        {
            let g = self.outfit.garment_of_face(of_garment[0].0);
            let (first, start) = (self.outfit.faces_of_garment(g).start, self.outfit.vertices(g).start);
            let had_some = of_garment.iter().any(|pair| self.known_folds.binary_search(pair).is_ok());
            let local: Vec<(u32, u32)> = of_garment.iter().map(|(f, g)| (f - first, g - first)).collect();
            let garment = self.outfit.layers[g].garment;
            let found = folds(garment, self.outfit.part(&self.positions, g), &local, gap);
            contacts.extend(found.contacts.into_iter().map(|c| c.shifted(start)));
            let here: Vec<u32> = found.crumpled.iter().map(|v| v + start).collect();
            // What the input already had is smoothed for good, what was done to it is taken back.
            match had_some {
                true => self.smooth_shape(&here),
                false => self.smooth_moves(&here),
            }
            crumpled.extend(here);
        }
        self.crossings.own = own;
        (contacts, crumpled)
    }

    /// Moves vertices half way to the middle of their neighbours, and the shape they return to with them.
    fn smooth_shape(&mut self, vertices: &[u32]) {
        let moves: Vec<[f64; 3]> = vertices
            .iter()
            .map(|&v| {
                let own = self.positions[v as usize];
                scale(sub(self.middle(v, |n| self.positions[n as usize]), own), 0.5)
            })
            .collect();
        for (&v, by) in vertices.iter().zip(moves) {
            let v = v as usize;
            self.positions[v] = add(self.positions[v], by);
            self.shape[v] = add(self.shape[v], by);
        }
    }

    /// Gives vertices the mean displacement of their neighbours.
    fn smooth_moves(&mut self, vertices: &[u32]) {
        let by = |n: u32| sub(self.positions[n as usize], self.shape[n as usize]);
        let smoothed: Vec<[f64; 3]> = vertices.iter().map(|&v| self.middle(v, by)).collect();
        for (&v, by) in vertices.iter().zip(smoothed) {
            self.positions[v as usize] = add(self.shape[v as usize], by);
        }
    }

    fn middle(&self, v: u32, value: impl Fn(u32) -> [f64; 3]) -> [f64; 3] {
        let ring = self.outfit.ring(v);
        let count = ring.len();
        if count == 0 {
            value(v)
        } else {
            scale(ring.fold([0.0; 3], |sum, n| add(sum, value(n))), 1.0 / count as f64)
        }
    }

    /// Looks again at vertices that moved, and marks the faces around them.
    fn touch(&mut self, moved: &[u32]) {
        for &v in moved {
            for f in self.outfit.faces_at(v) {
                self.crossings.is_dirty[f as usize] = true;
            }
        }
        let look = |&v: &u32| {
            let (p, away) = (self.positions[v as usize], self.outward[v as usize]);
            let view = self.body.look(p);
            let plane = view.and_then(|b| b.plane);
            // More than half way through a limb the nearest way out is its other side: cloth goes back to its own.
            let is_through = !self.settings.is_shallow
                && plane.is_some_and(|plane| plane.distance < 0.0 && dot(plane.normal, away) < 0.0);
            let own = if is_through { self.body.exit(p, away, self.settings.farthest) } else { None };
            (view.map_or(f64::INFINITY, |b| b.far), own.or(plane))
        };
        let found: Vec<_> = moved.par_iter().with_min_len(128).map(look).collect();
        for (&v, (far, plane)) in moved.iter().zip(found) {
            self.far[v as usize] = far;
            self.planes[v as usize] = plane;
        }
    }

    /// Takes other positions.
    fn move_to(&mut self, positions: &[[f64; 3]]) {
        let now = &self.positions;
        let moved: Vec<u32> =
            (0..now.len() as u32).filter(|&v| now[v as usize] != positions[v as usize]).collect();
        self.positions.copy_from_slice(positions);
        self.touch(&moved);
    }

    /// Pairs between garments, and with the body where it is drawn, that are left.
    pub fn crossings(&self) -> usize {
        let is_seen = |&&(_, other): &&(u32, u32)| !self.body.gave_way(other);
        self.crossings.layers.len() + self.crossings.body.iter().filter(is_seen).count()
    }
}
