//! Brings all garments of an outfit to the right side of the body and of each other, together.

mod step;

use rayon::prelude::*;

use super::budget::Budget;
use super::contact::{Contact, Plane};
use super::defects::Defects;
use super::detect::Crossings;
use super::layer_constraint::{LayerConstraint, layer_constraints, outward};
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::sides::Sides;
use super::{Layer, ResolveSettings};
use crate::query::triangle_tree::{KeptTree, TriangleTree, self_triangle_pairs};
use crate::vec3::dot;

/// A half-space is remembered for a vertex that is nearer to it than this (m), or too close: smoothing may carry it there.
const WATCH: f64 = 0.01;
/// Rounds without progress after which an outfit is left as it is.
const PATIENCE: usize = 8;
/// The same where cloth keeps its sides: that ends soon or never.
const PATIENCE_WITH_SIDES: usize = 4;
/// The same in a step that may be halved: a shorter one costs less than a long wait.
const PATIENCE_IN_LONG_STEP: usize = 3;
/// Rounds in which vertices that are merely closer than asked for still count.
const ROUNDS_FOR_GAPS: usize = 3;

/// An outfit on its way.
pub(super) struct Untangling<'a> {
    outfit: &'a Outfit<'a>,
    body: &'a BodyObstacle<'a>,
    settings: &'a ResolveSettings,
    budget: &'a Budget,
    /// Limits of the present attempt, as in the settings.
    farthest: f64,
    stretch: f64,
    input: Vec<[f64; 3]>,
    /// The shape that displacements are measured from: the input, with its crumples smoothed.
    shape: Vec<[f64; 3]>,
    pub positions: Vec<[f64; 3]>,
    /// Distance of every vertex to the body's exposed surface, without sign (m).
    far: Vec<f64>,
    /// What the body leaves to it; none where the body is pinched.
    planes: Vec<Option<Plane>>,
    /// Directions away from the body; zero where there is none.
    outward: Vec<[f64; 3]>,
    over: Vec<LayerConstraint>,
    /// Trees of the garments where they were last looked at.
    trees: Vec<KeptTree>,
    crossings: Crossings,
    /// Crossings of the input's garments with themselves, ascending.
    known_self_intersections: Vec<(u32, u32)>,
    /// Conditions that all crossings so far asked for: a mended place would be torn again by its neighbours without them.
    remembered: Vec<Contact>,
    /// What tells the order of sheets, where it was known a step before; otherwise the directions away from the body do.
    sides: Option<&'a Sides>,
}

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
    pub fn new(
        outfit: &'a Outfit<'a>,
        body: &'a BodyObstacle<'a>,
        settings: &'a ResolveSettings,
        (budget, sides): (&'a Budget, Option<&'a Sides>),
    ) -> Self {
        let input: Vec<[f64; 3]> = outfit.layers.iter().flat_map(|l| l.positions).copied().collect();
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
            crossings: Crossings::new(outfit.faces.len()),
            known_self_intersections: Vec::new(),
            remembered: Vec::new(),
            sides,
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

    /// Rounds of detection and relaxation until nothing is wrong or nothing gets better. Where crossings are left, a second attempt
    /// with wider limits is kept if it ends with none.
    pub fn run(&mut self) {
        self.detect();
        self.known_self_intersections.clone_from(&self.crossings.own);
        self.attempt();
        if self.crossings.between() == 0 || self.settings.loosened <= 1.0 || self.budget.is_spent() {
            return;
        }
        let (positions, shape) = (self.positions.clone(), self.shape.clone());
        self.farthest *= self.settings.loosened;
        self.stretch = 1.0 + (self.stretch - 1.0) * self.settings.loosened;
        self.attempt();
        if self.crossings.between() > 0 || self.crossings.own.len() > self.known_self_intersections.len() {
            self.move_to(&positions);
            self.shape = shape;
            self.detect();
        }
    }

    /// Rounds within the limits as they are. The crossings are those of the positions afterwards.
    fn attempt(&mut self) {
        let mut best = Best::default();
        let patience = match (self.sides, self.settings.is_patient) {
            (Some(_), _) => PATIENCE_WITH_SIDES,
            (None, true) => PATIENCE,
            (None, false) => PATIENCE_IN_LONG_STEP,
        };
        for round in 0..=self.settings.rounds {
            let is_violated = self.planes.iter().flatten().any(|p| self.is_violated(p, round))
                || self.over.iter().any(|o| o.height < self.least(round));
            if !is_violated && self.crossings.count() == 0 {
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

    /// Pairs that are left, self-intersections included: all are to be parted; and vertices on the wrong side.
    fn defects(&self) -> Defects {
        let wrong = self.planes.iter().flatten().filter(|p| self.is_violated(p, ROUNDS_FOR_GAPS)).count()
            + self.over.iter().filter(|o| o.height < 0.0).count();
        Defects {
            intersections: self.crossings.count() + wrong,
            self_intersections: self.crossings.own.len(),
            ..Defects::default()
        }
    }

    /// Up to which distance half-spaces and sheets are remembered (m).
    fn watch(&self) -> f64 {
        WATCH.max(self.settings.trigger * self.settings.gap)
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
        let reach = (self.settings.reach, self.watch());
        if self.sides.is_none() {
            self.over = layer_constraints(outfit, &trees, positions, &self.outward, reach);
        }
        // What crosses where the body is pinched has no side in the next step.
        let counted = (self.settings.self_contact, self.sides.is_some());
        self.crossings.update(outfit, self.body, &trees, positions, &self.far, counted);
        self.trees = trees.into_iter().map(TriangleTree::into_kept).collect();
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
        self.layer_crossings() + self.crossings.body.iter().filter(is_seen).count()
    }

    /// Pairs between garments that are left.
    fn layer_crossings(&self) -> usize {
        let corners = |f: u32| self.outfit.faces[f as usize].map(|v| self.positions[v as usize]);
        let is_pinch = |f: u32| self.body.is_pinch_at(&corners(f));
        self.crossings.layers.iter().filter(|&&(f, g)| !(is_pinch(f) && is_pinch(g))).count()
    }

    /// All pairs with the body that are left.
    pub fn body_crossings(&self) -> usize {
        self.crossings.body.len()
    }

    /// Pairs of garments with themselves that are left.
    pub fn own_crossings(&self) -> usize {
        self.crossings.own.len()
    }
}

/// What untangling left.
#[derive(Clone, Default)]
pub(super) struct Untangled {
    pub positions: Vec<Vec<[f64; 3]>>,
    /// Pairs with the body where it is drawn and between garments, but for pinched ones.
    pub crossings: usize,
    /// Pairs with the body, where it gives way too.
    pub with_body: usize,
    /// Pairs of garments with themselves, pinched ones too.
    pub own: usize,
}

impl Untangled {
    pub fn defects(&self) -> Defects {
        Defects { intersections: self.crossings, self_intersections: self.own, ..Defects::default() }
    }
}

pub(super) fn untangled(
    body: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    budget: &Budget,
) -> Untangled {
    untangled_keeping(None, body, layers, settings, budget)
}

/// [`untangled`] where the order of sheets is known from a step before.
pub(super) fn untangled_keeping(
    sides: Option<&Sides>,
    body: &BodyObstacle<'_>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
    budget: &Budget,
) -> Untangled {
    let outfit = Outfit::new(layers);
    let mut untangling = Untangling::new(&outfit, body, settings, (budget, sides));
    untangling.run();
    let positions: Vec<Vec<_>> =
        (0..outfit.len()).map(|g| outfit.part(&untangling.positions, g).to_vec()).collect();
    // Where contact orientation is kept, pinched pairs have been counted already.
    let own = match settings.self_contact && sides.is_none() {
        true => {
            let garments = layers.iter().zip(&positions);
            garments.map(|(layer, now)| self_triangle_pairs(now, layer.garment.faces()).len()).sum()
        }
        false => untangling.own_crossings(),
    };
    let (crossings, with_body) = (untangling.crossings(), untangling.body_crossings());
    Untangled { positions, crossings, with_body, own }
}
