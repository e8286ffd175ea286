//! Brings one garment to the right side of the body and of the garments under it.

use std::time::Instant;

use rayon::prelude::*;

use super::contact::{Contact, is_tiny, overlap};
use super::folds::{Folds, folds};
use super::obstacle::{BodyObstacle, LayerObstacle, Plane, bounds};
use super::relax::{neighbourhood, relax};
use super::{Layer, ResolveSettings, RestGarment};
use crate::contact::TriangleTree;
use crate::vec3::{add, distance_squared, dot, norm, scale, sub};

/// A half-space is remembered for a vertex that is nearer to it than this [m]: smoothing may carry it there.
const WATCH: f64 = 0.01;
/// No contact asks for a longer step than this in a round [m].
const LONGEST_STEP: f64 = 0.03;
/// Rounds without progress after which a garment is left as it is.
const PATIENCE: usize = 8;
/// Rounds for which the conditions of a crossing hold on: long enough that a mended place is not torn again by its neighbour.
const REMEMBERED: usize = 8;
/// Rounds for crossings of a garment with itself, and those without progress before it is left as it is.
const FOLD_ROUNDS: usize = 20;
const FOLD_PATIENCE: usize = 4;
/// Rounds in which vertices that are merely closer than asked for still count.
const ROUNDS_FOR_GAPS: usize = 4;

/// What a vertex knows of its surroundings.
#[derive(Debug, Clone, Default)]
struct Surroundings {
    /// Distance to the body's exposed surface, without sign [m].
    body: f64,
    /// Direction away from the body; zero where the body is pinched or missing.
    outward: [f64; 3],
    planes: Vec<Plane>,
}

/// What was done to one garment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Work {
    pub rounds: usize,
    pub found_pairs: usize,
}

/// One garment on its way.
pub(super) struct Untangling<'a> {
    garment: &'a RestGarment,
    body: &'a BodyObstacle<'a>,
    inner: &'a [LayerObstacle<'a>],
    settings: &'a ResolveSettings,
    input: &'a [[f64; 3]],
    pub positions: Vec<[f64; 3]>,
    surroundings: Vec<Surroundings>,
    /// Faces whose crossings have to be looked for (again).
    is_dirty: Vec<bool>,
    /// (obstacle, face, face of the obstacle): 0 the body, i + 1 inner garment i.
    pairs: Vec<(usize, u32, u32)>,
    /// Conditions that crossings of the last rounds asked for, and the round.
    crossings: Vec<(usize, Contact)>,
}

/// How wrong a state is: fewer is better, in this order.
type Defects = (usize, usize);

impl<'a> Untangling<'a> {
    /// From `start`, another state of `layer`.
    pub fn new(
        layer: &Layer<'a>,
        start: &[[f64; 3]],
        body: &'a BodyObstacle<'a>,
        inner: &'a [LayerObstacle<'a>],
        settings: &'a ResolveSettings,
    ) -> Self {
        let Layer { garment, positions: input } = *layer;
        let mut untangling = Self {
            garment,
            body,
            inner,
            settings,
            input,
            positions: start.to_vec(),
            surroundings: vec![Surroundings::default(); input.len()],
            is_dirty: vec![true; garment.faces.len()],
            pairs: Vec::new(),
            crossings: Vec::new(),
        };
        let all: Vec<u32> = (0..input.len() as u32).collect();
        untangling.look(&all);
        untangling
    }

    /// The direction away from the body at vertex `v`; zero where there is none.
    pub fn outward(&self, v: usize) -> [f64; 3] {
        self.surroundings[v].outward
    }

    /// Rounds of detection and relaxation until nothing is wrong or nothing gets better.
    pub fn run(&mut self) -> Work {
        let start = Instant::now();
        let mut work = Work::default();
        let mut best: Option<(Defects, Vec<[f64; 3]>)> = None;
        let mut stale = 0;
        for round in 0..=self.settings.rounds {
            let violated = self.violated(round);
            let wrong = self.violated(ROUNDS_FOR_GAPS).len();
            // Crossings of what lies on the wrong side anyway say little.
            let looks_for_pairs = round > 0 || violated.is_empty();
            if looks_for_pairs {
                self.find_pairs();
                work.found_pairs = work.found_pairs.max(self.pairs.len());
            }
            if violated.is_empty() && self.pairs.is_empty() {
                return work;
            }
            if looks_for_pairs {
                let defects = (self.pairs.len() + wrong, wrong);
                if best.as_ref().is_none_or(|(least, _)| defects < *least) {
                    best = Some((defects, self.positions.clone()));
                    stale = 0;
                } else {
                    stale += 1;
                }
            }
            let is_late = self.settings.time.is_some_and(|limit| start.elapsed() > limit);
            if round == self.settings.rounds || stale > PATIENCE || is_late {
                break;
            }
            work.rounds += 1;
            self.step(&violated, round, Folds::default());
        }
        if let Some((_, positions)) = best {
            self.move_to(positions);
            self.find_pairs();
        }
        work
    }

    /// Parts crossings of the garment with itself, without new crossings of anything else. Returns the rounds it took.
    pub fn part_folds(&mut self) -> usize {
        let start = Instant::now();
        let all: Vec<u32> = (0..self.garment.faces.len() as u32).collect();
        let mut folded = self.self_pairs(&all);
        if folded.is_empty() {
            return 0;
        }
        let others = |s: &Self| s.pairs.len() + s.violated(ROUNDS_FOR_GAPS).len();
        let allowed = others(self);
        let mut best: (usize, Vec<[f64; 3]>) = (folded.len(), self.positions.clone());
        let mut stale = 0;
        let mut rounds = 0;
        for round in 0..self.settings.rounds.min(FOLD_ROUNDS) {
            let is_late = self.settings.time.is_some_and(|limit| start.elapsed() > limit);
            if (folded.is_empty() && others(self) <= allowed) || stale > FOLD_PATIENCE || is_late {
                break;
            }
            rounds += 1;
            let found = folds(self.garment, &self.positions, &folded, 0.25 * self.settings.gap);
            let violated = self.violated(ROUNDS_FOR_GAPS);
            self.smooth(&found.crumpled);
            self.step(&violated, round, found);
            let dirty = self.dirty();
            self.find_pairs();
            let is_dirty = |f: &u32| dirty.binary_search(f).is_ok();
            folded.retain(|(f, g)| !is_dirty(f) && !is_dirty(g));
            folded.extend(self.self_pairs(&dirty));
            folded.sort_unstable();
            folded.dedup();
            if others(self) <= allowed && folded.len() < best.0 {
                best = (folded.len(), self.positions.clone());
                stale = 0;
            } else {
                stale += 1;
            }
        }
        self.move_to(best.1);
        self.find_pairs();
        rounds
    }

    /// Crossings of `faces` with any face of the garment, outside of pinched regions.
    fn self_pairs(&self, faces: &[u32]) -> Vec<(u32, u32)> {
        let tree = TriangleTree::new(&self.positions, &self.garment.faces);
        let centre = |f: u32| {
            let [a, b, c] = self.garment.faces[f as usize].map(|v| self.positions[v as usize]);
            scale(add(add(a, b), c), 1.0 / 3.0)
        };
        let mut pairs = tree.self_pairs_of_faces(faces);
        pairs.retain(|&(f, g)| !(self.body.is_pinch(centre(f)) && self.body.is_pinch(centre(g))));
        pairs
    }

    /// Moves vertices half way to the middle of their neighbours.
    fn smooth(&mut self, vertices: &[u32]) {
        let middle = |v: u32| {
            let ring = self.garment.topology.ring(v as usize);
            let sum = ring.iter().fold([0.0; 3], |sum, &n| add(sum, self.positions[n as usize]));
            let own = self.positions[v as usize];
            if ring.is_empty() { own } else { scale(add(own, scale(sum, 1.0 / ring.len() as f64)), 0.5) }
        };
        let smoothed: Vec<[f64; 3]> = vertices.iter().map(|&v| middle(v)).collect();
        for (&v, p) in vertices.iter().zip(smoothed) {
            self.positions[v as usize] = p;
        }
        self.touch(vertices);
    }

    /// Faces whose crossings have to be looked for again, ascending.
    fn dirty(&self) -> Vec<u32> {
        (0..self.garment.faces.len() as u32).filter(|&f| self.is_dirty[f as usize]).collect()
    }

    /// Vertices on the wrong side, or (in the first rounds) too close.
    fn violated(&self, round: usize) -> Vec<u32> {
        let least = if round < ROUNDS_FOR_GAPS { self.settings.trigger * self.settings.gap } else { 0.0 };
        let is_violated = |s: &Surroundings| s.planes.iter().any(|p| !p.is_held && p.distance < least);
        (0..self.surroundings.len() as u32).filter(|&v| is_violated(&self.surroundings[v as usize])).collect()
    }

    fn step(&mut self, violated: &[u32], round: usize, folds: Folds) {
        let gap = self.settings.gap * (1.0 + 0.1 * round as f64).min(3.0);
        self.crossings.retain(|(found, _)| found + REMEMBERED > round);
        self.add_crossings(gap, round);
        let faces = self.pairs.iter().flat_map(|&(_, f, _)| self.garment.faces[f as usize]);
        let parted = folds.contacts.iter().flat_map(|c| c.vertices);
        let seeds: Vec<u32> =
            violated.iter().copied().chain(faces).chain(parted).chain(folds.crumpled).collect();
        let region = neighbourhood(self.garment, &seeds, self.settings.rings);
        let mut contacts: Vec<Contact> = Vec::new();
        for &v in &region {
            for plane in &self.surroundings[v as usize].planes {
                let wanted = if plane.is_held { plane.distance.clamp(0.0, gap) } else { gap };
                let reachable = wanted.min(plane.distance + LONGEST_STEP);
                contacts.push(Contact::vertex(v, plane, reachable));
            }
        }
        contacts.extend(self.crossings.iter().map(|(_, contact)| contact));
        contacts.extend(folds.contacts);
        relax(self.garment, &mut self.positions, self.input, &region, &contacts, self.settings.sweeps);
        self.touch(&region);
    }

    /// Faces around moved vertices may cross something else now.
    fn touch(&mut self, moved: &[u32]) {
        for &v in moved {
            for &f in self.garment.faces_of(v) {
                self.is_dirty[f as usize] = true;
            }
        }
        self.look(moved);
    }

    /// Takes other positions.
    fn move_to(&mut self, positions: Vec<[f64; 3]>) {
        let moved: Vec<u32> = (0..positions.len() as u32)
            .filter(|&v| positions[v as usize] != self.positions[v as usize])
            .collect();
        self.positions = positions;
        self.touch(&moved);
    }

    /// Looks at the surroundings of `vertices`.
    fn look(&mut self, vertices: &[u32]) {
        let reach = self.settings.reach;
        let found: Vec<Surroundings> = vertices
            .par_iter()
            .with_min_len(128)
            .map(|&v| {
                let p = self.positions[v as usize];
                let body = self.body.look(p);
                let far = body.map_or(f64::INFINITY, |b| b.far);
                let layers = self.inner.iter().filter_map(|i| i.look(p, reach, self.settings.gap));
                let plane = body.and_then(|b| b.plane);
                let planes = plane.into_iter().chain(layers).filter(|p| p.distance < WATCH).collect();
                Surroundings { body: far, outward: plane.map_or([0.0; 3], |p| p.normal), planes }
            })
            .collect();
        for (&v, found) in vertices.iter().zip(found) {
            self.surroundings[v as usize] = found;
        }
    }

    /// Brings the list of crossings up to date, pinched faces of the body left out.
    fn find_pairs(&mut self) {
        let dirty = self.dirty();
        self.pairs.retain(|&(_, f, _)| !self.is_dirty[f as usize]);
        let near_body: Vec<u32> = dirty.iter().copied().filter(|&f| self.may_touch_body(f)).collect();
        let faces = &self.garment.faces;
        let with_body = self.body.tree.pairs_of_faces(&self.positions, faces, &near_body);
        let body = self.body;
        self.pairs
            .extend(with_body.into_iter().filter(|&(_, b)| !body.is_pinched(b)).map(|(f, b)| (0, f, b)));
        for (i, inner) in self.inner.iter().enumerate() {
            if inner.is_near(bounds(&self.positions), 0.0) {
                let found = inner.tree.pairs_of_faces(&self.positions, faces, &dirty);
                self.pairs.extend(found.into_iter().map(|(f, b)| (i + 1, f, b)));
            }
        }
        self.pairs.sort_unstable();
        self.is_dirty.fill(false);
    }

    /// No face reaches farther from a corner than its longest edge.
    fn may_touch_body(&self, f: u32) -> bool {
        let [a, b, c] = self.garment.faces[f as usize].map(|v| self.positions[v as usize]);
        let longest = distance_squared(a, b).max(distance_squared(b, c)).max(distance_squared(c, a)).sqrt();
        self.garment.faces[f as usize]
            .iter()
            .all(|&v| self.surroundings[v as usize].body <= longest * (1.0 + 1e-9))
    }

    fn tree_of(&self, obstacle: usize) -> (&TriangleTree<'a>, Option<&LayerObstacle<'a>>) {
        match obstacle {
            0 => (&self.body.tree, None),
            i => (&self.inner[i - 1].tree, Some(&self.inner[i - 1])),
        }
    }

    /// For every crossing: the part of the face over the obstacle's face has to come out of it.
    fn add_crossings(&mut self, gap: f64, round: usize) {
        let mut added = Vec::new();
        for &(obstacle, f, other) in &self.pairs {
            let (tree, layer) = self.tree_of(obstacle);
            let face = self.garment.faces[f as usize];
            let upper = face.map(|v| self.positions[v as usize]);
            let Some(mut lower) = tree.triangle(other).filter(|t| !is_tiny(t)) else { continue };
            if layer.is_some_and(|l| l.facing(other) < 0.0) {
                lower.swap(1, 2);
            }
            let (normal, corners) = overlap(&upper, &lower);
            for corner in corners.iter().filter(|c| c.height < 0.5 * gap) {
                // The ground under the corner, as a height along the normal.
                let ground = dot(normal, lower[0]);
                let target = ground + (0.5 * gap).min(corner.height + LONGEST_STEP);
                added.push((round, Contact::face_point(face, corner.at_upper, normal, target)));
            }
        }
        self.crossings.extend(added);
    }

    /// Largest move from the input [m].
    pub fn largest_move(&self) -> f64 {
        let moves = self.positions.iter().zip(self.input).map(|(p, q)| norm(sub(*p, *q)));
        moves.fold(0.0, f64::max)
    }

    /// Vertices that moved.
    pub fn moved(&self) -> usize {
        self.positions.iter().zip(self.input).filter(|(p, q)| p != q).count()
    }
}
