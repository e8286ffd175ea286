//! The fast pass: separates the slight penetrations that the networks leave, in some ten milliseconds.
//!
//! Triangles that intersect, found exactly, and vertices on the wrong side around them tell where; conditions there and
//! on what is near ([`conditions`]) are met by a few smooth sweeps over two rings of neighbours ([`relax`]). Rounds
//! move freely as long as they help: cloth that lies deeper than one triangle could not come out through the step
//! filter. The last ones are filtered, so that they make no new intersection. What parted triangles once is asked for
//! in all later rounds. It ends when nothing intersects, or when rounds no longer help: the rest is left to relaxation.

mod certificate;
mod conditions;
#[cfg(test)]
mod tests;

use super::budget::Budget;
use super::certificate::Certificate;
use super::condition::{Condition, Plane};
use super::layer_constraint::outward;
use super::obstacle::BodyObstacle;
use super::packed_cloth::PackedCloth;
use super::relax::{LastPasses, no_farther, relax};
use super::self_intersections::part_self_intersections;
use super::strain_relaxation::{StrainRelaxation, TIMES, contact_mesh};
use super::task::Task;
use super::{ResolveSettings, Resolved};
use crate::contact::step_filter::{ContactMesh, FacePairs, StepFilter};
use rayon::prelude::*;

/// Self-intersecting pairs that may be left where nothing else intersects.
pub(super) const FEW_SELF_PAIRS: usize = 8;
/// Rings of neighbours around a defect that move along.
const RINGS: usize = 2;
/// Sweeps of the relaxation in a round.
const FAST_SWEEPS: usize = 10;
/// Rounds at most; stalling ends it long before.
const ROUNDS: usize = 20;
/// A round that leaves more than this share of the intersections hardly helps.
const STALLED: f64 = 0.8;
/// After so many rounds that hardly helped steps are filtered…
const FREE_STALLS: usize = 3;
/// …and after so many the outfit is left to relaxation.
const STALLS: usize = 5;
/// More intersections than this after a round that hardly helped are not for the fast pass.
const MANY: usize = 200;
/// Distance to which sheets of one garment are separated, as a share of the gap.
const SELF_GAP: f64 = 0.25;
/// A share of vertices under an inner garment from which whole parts lie on the wrong side without intersecting anything.
const ORDER_VIOLATIONS: f64 = 1e-2;
/// What elements stay apart in a filtered step, as a share of the gap.
const FILTER_MARGIN: f64 = 0.05;

/// Takes the garments of `task` out of the body and out of each other where they lie hardly in: the result if no garment
/// intersects the body or another one any more, at most eight pairs of triangles of one garment intersect, and no cloth has
/// excess strain; else none. Deterministic for any number of threads; a clean input comes back to the bit. The body is `drawn`
/// near the garments.
pub(super) fn fast_pass(drawn: &BodyObstacle<'_>, task: Task<'_>) -> Option<Resolved> {
    let Task { layers, settings, budget } = task;
    let outfit = PackedCloth::new(layers);
    let surface = drawn.surface;
    let near = drawn.tree.part().iter().map(|&f| &surface.faces[f as usize]);
    let mesh = contact_mesh(&outfit, surface.positions.len(), near);
    let mut pass = FastPass::new(&outfit, drawn, &mesh, settings);
    let rounds = pass.run(budget);
    let most_self_intersections = match mends_self_intersections(settings) {
        true => FEW_SELF_PAIRS,
        false => pass.known_self_intersections.len(),
    };
    if pass.between() > 0
        || pass.parted_self_intersections().count() > most_self_intersections
        || pass.self_pairs().count() > pass.known_self_intersections.len()
    {
        return None;
    }
    pass.relax_strain(task);
    let positions = outfit.split(&pass.positions);
    let certificate = budget.certifying(|| pass.certificate(&positions));
    let mut resolved = Resolved { positions, certificate, ..Resolved::default() };
    resolved.compare_since(layers, budget);
    resolved.garments.iter_mut().for_each(|work| work.rounds = rounds);
    is_good(&resolved.certificate, most_self_intersections).then_some(resolved)
}

/// Whether self-intersections of the input are mended, not only those that were made: strict limits leave them.
fn mends_self_intersections(settings: &ResolveSettings) -> bool {
    settings.self_contact && settings.loosened > 1.0
}

/// Whether nothing is left to relaxation: no intersection, at most `most_self_intersections` pairs of garments with themselves,
/// no whole part on the wrong side, no excess strain.
fn is_good(certificate: &Certificate, most_self_intersections: usize) -> bool {
    certificate.is_clear()
        && certificate.self_triangle_pairs <= most_self_intersections
        && certificate.vertices_inside == 0
        && certificate.order_violations <= ORDER_VIOLATIONS
        && certificate.excess_strain() == 0
}

/// The state of an outfit between rounds.
struct FastPass<'a> {
    outfit: &'a PackedCloth<'a>,
    body: &'a BodyObstacle<'a>,
    settings: &'a ResolveSettings,
    filter: StepFilter<'a>,
    input: Vec<[f64; 3]>,
    /// The shape that displacements are measured from: the input, with its crumples smoothed.
    shape: Vec<[f64; 3]>,
    /// Vertices of the garments, then those of the body.
    positions: Vec<[f64; 3]>,
    /// The half-space that the body leaves to every vertex of the garments.
    planes: Vec<Option<Plane>>,
    /// Directions away from the body.
    outward: Vec<[f64; 3]>,
    /// Pairs of the input's garments with themselves, ascending.
    known_self_intersections: FacePairs,
    /// Conditions that separated triangles so far: without them their neighbours would pull them in again.
    remembered: Vec<Condition>,
}

impl<'a> FastPass<'a> {
    fn new(
        outfit: &'a PackedCloth<'a>,
        body: &'a BodyObstacle<'a>,
        mesh: &'a ContactMesh,
        settings: &'a ResolveSettings,
    ) -> Self {
        let input = outfit.positions();
        let positions = [input.as_slice(), &body.surface.positions].concat();
        let filter = StepFilter::new(mesh, &positions);
        let look = |p: &[f64; 3]| body.look(*p)?.plane;
        let planes = input.par_iter().with_min_len(128).map(look).collect();
        let mut pass = Self {
            outfit,
            body,
            settings,
            filter,
            shape: input.clone(),
            input,
            positions,
            planes,
            outward: Vec::new(),
            known_self_intersections: Vec::new(),
            remembered: Vec::new(),
        };
        pass.known_self_intersections = pass.self_pairs().copied().collect();
        pass
    }

    /// Rounds until nothing intersects, a round hardly helps, or the budget is spent; how many it took.
    fn run(&mut self, budget: &Budget) -> usize {
        let mut left = self.left();
        if left == [0, 0] {
            return 0;
        }
        let away = |v: u32| self.planes[v as usize].map_or([0.0; 3], |plane| plane.normal);
        self.outward = outward(self.outfit, &self.input, away);
        let mut stalls = 0;
        for round in 1..=ROUNDS {
            if budget.is_spent() {
                return round - 1;
            }
            self.round(stalls < FREE_STALLS);
            let before = std::mem::replace(&mut left, self.left());
            let hardly = |k: usize| left[k] as f64 >= STALLED * before[k] as f64;
            stalls += usize::from(hardly(0) && hardly(1));
            let is_hopeless = stalls > 0 && left[0] > MANY;
            if left == [0, 0] || stalls == STALLS || is_hopeless {
                return round;
            }
        }
        ROUNDS
    }

    fn round(&mut self, is_free: bool) {
        let defects = self.defects();
        let mut contacts = self.conditions(&defects);
        let mut to = self.positions.clone();
        let cloth = &mut to[..self.input.len()];
        let region = &defects.region;
        let parted: Vec<(u32, u32)> = self.parted_self_intersections().copied().collect();
        let (pairs, shape) =
            ((parted.as_slice(), self.known_self_intersections.as_slice()), self.shape.as_mut_slice());
        let gap = SELF_GAP * self.settings.gap;
        contacts.extend(part_self_intersections(self.outfit, pairs, gap, &self.positions, (cloth, shape)).0);
        let (stretch, most) = (self.settings.stretch, self.settings.farthest);
        relax(self.outfit, cloth, &self.shape, region, &contacts, stretch, (FAST_SWEEPS, LastPasses::FEW));
        for &v in region {
            cloth[v as usize] = no_farther(self.input[v as usize], cloth[v as usize], most);
        }
        match is_free {
            true => self.filter.step_freely(&self.positions, &to),
            false => self.filter.step(&self.positions, &mut to, FILTER_MARGIN * self.settings.gap),
        }
        let before = std::mem::replace(&mut self.positions, to);
        self.look_again(&before);
    }

    /// Relaxes strain, unless limits are strict.
    fn relax_strain(&mut self, task: Task<'_>) {
        if self.settings.loosened > 1.0 {
            let before = self.positions.clone();
            let relaxing = StrainRelaxation::new(self.outfit, task);
            relaxing.relax_strain(&mut self.filter, &mut self.positions, TIMES);
            self.look_again(&before);
        }
    }

    /// Looks at the body again from vertices that are not where they were `before`.
    fn look_again(&mut self, before: &[[f64; 3]]) {
        let body = self.body;
        let moved = self.planes.par_iter_mut().zip(before).zip(&self.positions).with_min_len(128);
        moved.filter(|((_, from), to)| from != to).for_each(|((plane, _), to)| {
            *plane = body.look(*to).and_then(|view| view.plane);
        });
    }

    /// Pairs that are left of garments with the body and with each other, but for pinched ones.
    fn between(&self) -> usize {
        self.parted().count()
    }

    /// Pairs that should go: [`between`](Self::between), and of garments with themselves.
    fn left(&self) -> [usize; 2] {
        [self.between(), self.parted_self_intersections().count()]
    }

    /// Pairs that are left of garments with themselves.
    fn self_pairs(&self) -> impl Iterator<Item = &(u32, u32)> {
        self.filter.intersections.iter().filter(|pair| self.is_self_pair(pair))
    }

    /// Pairs of garments with themselves that are to be parted.
    fn parted_self_intersections(&self) -> impl Iterator<Item = &(u32, u32)> {
        let is_known = |pair| self.known_self_intersections.binary_search(pair).is_ok();
        let is_asked = move |pair| mends_self_intersections(self.settings) || !is_known(pair);
        self.self_pairs()
            .filter(move |pair| is_asked(pair) && !(self.is_pinch(pair.0) && self.is_pinch(pair.1)))
    }

    fn is_self_pair(&self, &(f, g): &(u32, u32)) -> bool {
        !self.filter.mesh.is_body(g) && self.outfit.garment_of_face(f) == self.outfit.garment_of_face(g)
    }

    /// The pairs of [`between`](Self::between).
    fn parted(&self) -> impl Iterator<Item = &(u32, u32)> {
        let is_counted = |&&(f, g): &&(u32, u32)| match self.body_face(g) {
            Some(face) => !self.body.is_pinched(face),
            None => !(self.is_self_pair(&(f, g)) || self.is_pinch(f) && self.is_pinch(g)),
        };
        self.filter.intersections.iter().filter(is_counted)
    }

    /// The number that the body has for face `f`, if it is one of its.
    fn body_face(&self, f: u32) -> Option<u32> {
        let at = f.checked_sub(self.filter.mesh.cloth_faces as u32)?;
        Some(self.body.tree.part()[at as usize])
    }

    fn is_pinch(&self, f: u32) -> bool {
        self.body.is_pinch_at(&self.corners(f))
    }

    fn corners(&self, f: u32) -> [[f64; 3]; 3] {
        self.filter.mesh.faces[f as usize].map(|v| self.positions[v as usize])
    }
}
