//! Relaxation in rounds: brings all garments of an outfit outside the body and into their order, together.

mod step;

use rayon::prelude::*;

use super::ResolveSettings;
use super::budget::Budget;
use super::condition::{Condition, Plane};
use super::contact_orientation::ContactOrientation;
use super::defects::Defects;
use super::detect::IntersectingPairs;
use super::layer_constraint::{LayerConstraint, layer_constraints, outward};
use super::obstacle::BodyObstacle;
use super::packed_cloth::PackedCloth;
use super::task::Task;
use crate::contact::ORDER_RADIUS;
use crate::query::triangle_tree::{KeptTree, TriangleTree, self_triangle_pairs};

/// A vertex nearer to a half-space than this (m) is kept out of it: smoothing may carry it there.
const WATCHED: f64 = 0.01;
/// Rounds without progress after which an outfit is left as it is.
const PATIENCE: usize = 8;
/// The same where cloth keeps its contact orientation: that ends soon or never.
const PATIENCE_WITH_ORIENTATION: usize = 4;
/// The same in a step that may be halved: a shorter one costs less than a long wait.
const PATIENCE_IN_LONG_STEP: usize = 3;
/// Rounds in which vertices that are merely closer than asked for still count.
const ROUNDS_FOR_GAPS: usize = 3;

/// The state of an outfit between rounds.
pub(super) struct UntanglingState<'a> {
    outfit: &'a PackedCloth<'a>,
    body: &'a BodyObstacle<'a>,
    settings: &'a ResolveSettings,
    budget: &'a Budget,
    /// Limits of the present attempt, as in the settings.
    farthest: f64,
    stretch: f64,
    input: Vec<[f64; 3]>,
    /// The shape that displacements are measured from: the input, with its crumples smoothed.
    shape: Vec<[f64; 3]>,
    positions: Vec<[f64; 3]>,
    /// Distance of every vertex to the body's exposed surface, without sign (m).
    far: Vec<f64>,
    /// The half-space that the body leaves to every vertex; none where the body is pinched.
    planes: Vec<Option<Plane>>,
    /// Outward directions; zero where there is none.
    outward: Vec<[f64; 3]>,
    over: Vec<LayerConstraint>,
    /// Trees of the garments at their last positions.
    trees: Vec<KeptTree>,
    intersections: IntersectingPairs,
    /// Intersections of the input's garments with themselves, ascending.
    known_self_intersections: Vec<(u32, u32)>,
    /// Conditions of all intersections so far: without them its neighbours would pull a mended place apart again.
    remembered: Vec<Condition>,
    /// Orders the sheets, if it is known from a step before; otherwise the outward directions do.
    orientation: Option<&'a ContactOrientation>,
}

/// The best state so far.
#[derive(Default)]
struct BestState {
    defects: Option<Defects>,
    positions: Vec<[f64; 3]>,
    /// Rounds since it was found.
    stale: usize,
}

impl BestState {
    fn look(&mut self, defects: Defects, positions: &[[f64; 3]]) {
        self.stale += 1;
        if self.defects.is_none_or(|least| defects < least) {
            *self = Self { defects: Some(defects), positions: positions.to_vec(), stale: 0 };
        }
    }
}

impl<'a> UntanglingState<'a> {
    fn new(
        outfit: &'a PackedCloth<'a>,
        body: &'a BodyObstacle<'a>,
        Task { settings, budget, .. }: Task<'a>,
        orientation: Option<&'a ContactOrientation>,
    ) -> Self {
        let input = outfit.positions();
        let count = input.len();
        let mut untangling = Self {
            outfit,
            body,
            settings,
            budget,
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
            intersections: IntersectingPairs::new(outfit.faces.len()),
            known_self_intersections: Vec::new(),
            remembered: Vec::new(),
            orientation,
        };
        let all: Vec<u32> = (0..count as u32).collect();
        untangling.touch(&all);
        let away = |v: u32| untangling.planes[v as usize].map_or([0.0; 3], |p| p.normal);
        untangling.outward = outward(outfit, &untangling.positions, away);
        // Once more, now that the outward directions are known.
        let is_inside = |&v: &u32| untangling.planes[v as usize].is_some_and(|p| p.distance < 0.0);
        let inside: Vec<u32> = all.into_iter().filter(is_inside).collect();
        untangling.touch(&inside);
        untangling
    }

    /// Rounds of detection and relaxation until nothing is wrong or nothing gets better. Where intersections are left, a second
    /// attempt with wider limits is kept if it ends with none.
    fn run(&mut self) {
        self.detect();
        self.known_self_intersections.clone_from(&self.intersections.self_pairs);
        self.attempt();
        if self.intersections.between() == 0 || self.settings.loosened <= 1.0 || self.budget.is_spent() {
            return;
        }
        let (positions, shape) = (self.positions.clone(), self.shape.clone());
        self.farthest *= self.settings.loosened;
        self.stretch = 1.0 + (self.stretch - 1.0) * self.settings.loosened;
        self.attempt();
        if self.intersections.between() > 0
            || self.intersections.self_pairs.len() > self.known_self_intersections.len()
        {
            self.move_to(&positions);
            self.shape = shape;
            self.detect();
        }
    }

    /// Rounds within the limits as they are. The intersections are those of the positions afterwards.
    fn attempt(&mut self) {
        let mut best = BestState::default();
        let patience = match (self.orientation, self.settings.is_patient) {
            (Some(_), _) => PATIENCE_WITH_ORIENTATION,
            (None, true) => PATIENCE,
            (None, false) => PATIENCE_IN_LONG_STEP,
        };
        for round in 0..=self.settings.rounds {
            let is_violated = self.planes.iter().flatten().any(|p| self.is_violated(p, round))
                || self.over.iter().any(|o| o.height < self.least(round));
            if !is_violated && self.intersections.count() == 0 {
                return;
            }
            best.look(self.defects(), &self.positions);
            if round == self.settings.rounds || best.stale > patience || self.budget.is_spent() {
                break;
            }
            self.budget.spend_round();
            self.step(round);
            self.detect();
        }
        self.move_to(&best.positions);
        self.detect();
    }

    /// Pairs, self-intersections included, and vertices on the wrong side.
    fn defects(&self) -> Defects {
        let wrong = self.planes.iter().flatten().filter(|p| self.is_violated(p, ROUNDS_FOR_GAPS)).count()
            + self.over.iter().filter(|o| o.height < 0.0).count();
        Defects {
            intersections: self.intersections.count() + wrong,
            self_intersections: self.intersections.self_pairs.len(),
            ..Defects::default()
        }
    }

    /// Up to which distance half-spaces and sheets are remembered (m).
    fn watch(&self) -> f64 {
        WATCHED.max(self.settings.least_gap())
    }

    /// The distance that counts as too close in a round: what is merely close is left alone after the first ones.
    fn least(&self, round: usize) -> f64 {
        if round < ROUNDS_FOR_GAPS { self.settings.least_gap() } else { 0.0 }
    }

    fn is_violated(&self, plane: &Plane, round: usize) -> bool {
        !plane.is_held && plane.distance < self.least(round)
    }

    /// Brings intersections and the order of layers up to date.
    fn detect(&mut self) {
        let (outfit, positions) = (self.outfit, &self.positions);
        let trees: Vec<TriangleTree<'_>> = std::mem::take(&mut self.trees)
            .into_par_iter()
            .enumerate()
            .map(|(g, tree)| {
                TriangleTree::refitted(tree, outfit.part(positions, g), &outfit.layers[g].garment.faces)
            })
            .collect();
        let reach = (ORDER_RADIUS, self.watch());
        if self.orientation.is_none() {
            self.over = layer_constraints(outfit, &trees, positions, &self.outward, reach);
        }
        // Pinched pairs count with contact orientation: they would have none in the next step.
        let counted = (self.settings.self_contact, self.orientation.is_some());
        self.intersections.update(outfit, self.body, &trees, positions, &self.far, counted);
        self.trees = trees.into_iter().map(TriangleTree::into_kept).collect();
    }

    /// Updates what the body leaves to vertices that moved, and marks the faces around them.
    fn touch(&mut self, moved: &[u32]) {
        for &v in moved {
            for f in self.outfit.faces_at(v) {
                self.intersections.is_dirty[f as usize] = true;
            }
        }
        let look = |&v: &u32| {
            let (p, away) = (self.positions[v as usize], self.outward[v as usize]);
            let view = self.body.look(p);
            let plane = view.and_then(|b| b.plane);
            let plane = match self.settings.is_shallow {
                true => plane,
                false => self.body.back_from_through(plane, p, away, self.settings.farthest),
            };
            (view.map_or(f64::INFINITY, |b| b.far), plane)
        };
        let found: Vec<_> = moved.par_iter().with_min_len(128).map(look).collect();
        for (&v, (far, plane)) in moved.iter().zip(found) {
            self.far[v as usize] = far;
            self.planes[v as usize] = plane;
        }
    }

    /// Moves to other positions.
    fn move_to(&mut self, positions: &[[f64; 3]]) {
        let now = &self.positions;
        let moved: Vec<u32> =
            (0..now.len() as u32).filter(|&v| now[v as usize] != positions[v as usize]).collect();
        self.positions.copy_from_slice(positions);
        self.touch(&moved);
    }

    /// Intersecting pairs between garments, and with the body where it does not yield.
    fn intersections(&self) -> usize {
        let is_seen = |&&(_, other): &&(u32, u32)| !self.body.yielded(other);
        let corners = |f: u32| self.outfit.faces[f as usize].map(|v| self.positions[v as usize]);
        let is_pinch = |f: u32| self.body.is_pinch_at(&corners(f));
        let is_counted = |&&(f, g): &&(u32, u32)| !(is_pinch(f) && is_pinch(g));
        self.intersections.layers.iter().filter(is_counted).count()
            + self.intersections.body.iter().filter(is_seen).count()
    }
}

/// The result of untangling.
pub(super) struct Untangled {
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Pairs with the body where it does not yield, and between garments, without pinched ones.
    pub intersections: usize,
    /// Pairs with the body, also where it yields.
    pub with_body: usize,
    /// Pairs of garments with themselves, pinched ones too.
    pub self_intersections: usize,
}

impl Untangled {
    pub fn defects(&self) -> Defects {
        Defects {
            intersections: self.intersections,
            self_intersections: self.self_intersections,
            ..Defects::default()
        }
    }
}

/// The garments of `task` outside of `body` and in their order, as far as it gets; with the contact orientation of a step before,
/// if there is one.
pub(super) fn untangled(
    body: &BodyObstacle<'_>,
    task: Task<'_>,
    orientation: Option<&ContactOrientation>,
) -> Untangled {
    let Task { layers, settings, .. } = task;
    let outfit = PackedCloth::new(layers);
    let mut untangling = UntanglingState::new(&outfit, body, task, orientation);
    untangling.run();
    let positions = outfit.split(&untangling.positions);
    // Where contact orientation is kept, pinched pairs have been counted already.
    let self_intersections = match settings.self_contact && orientation.is_none() {
        true => {
            let garments = layers.iter().zip(&positions);
            garments.map(|(layer, now)| self_triangle_pairs(now, layer.garment.faces()).len()).sum()
        }
        false => untangling.intersections.self_pairs.len(),
    };
    let with_body = untangling.intersections.body.len();
    Untangled { positions, intersections: untangling.intersections(), with_body, self_intersections }
}
