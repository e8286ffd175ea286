//! The fast pass: what the networks leave, slight penetrations, is parted where it is, in some ten milliseconds.
//!
//! Triangles that intersect, found exactly, and vertices on the wrong side around them tell where; conditions there and on what is
//! near ([`conditions`]) are met by a few smooth sweeps over two rings of neighbours ([`relax`]). The first round moves freely, the
//! others through the step filter, so that they make no new intersection. It ends when nothing intersects, or when a round no
//! longer removes a fifth of what does: the rest is for the continuation path.

mod conditions;
#[cfg(test)]
mod tests;

use std::time::Instant;

use super::body::with_drawn;
use super::count::certified;
use super::garment::check;
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::over::outward;
use super::relax::{LastPasses, no_farther, relax};
use super::resolved::Stage;
use super::{GarmentWork, Layer, ResolveError, ResolveSettings, Resolved};
use crate::contact::step_filter::{ContactMesh, StepFilter};
use crate::query::Surface;

/// Rings of neighbours around a defect that move along.
const RINGS: usize = 2;
/// Sweeps of the relaxation in a round.
const SWEEPS: usize = 10;
/// Rounds at most; stalling ends it long before.
const ROUNDS: usize = 20;
/// A round that leaves more than this share of the intersections is the last one.
const STALLED: f64 = 0.8;
/// What elements stay apart in a filtered step, as a share of the gap.
const FILTER_MARGIN: f64 = 0.05;

/// Takes `layers`, innermost first, out of `body` and out of each other where they lie hardly in: the result if no garment
/// intersects the body or another one any more, no more triangles of garments intersect others of their own, and no cloth is torn;
/// else none. Deterministic for any number of threads; a clean input comes back to the bit.
///
/// # Errors
/// Those of [`super::resolve`].
pub fn fast_pass(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Result<Option<Resolved>, ResolveError> {
    settings.check()?;
    check(body, layers)?;
    let start = Instant::now();
    Ok(with_drawn(body, layers, |drawn| {
        let body_time = start.elapsed();
        let outfit = Outfit::new(layers);
        let mesh = contact_mesh(&outfit, &drawn);
        let mut pass = FastPass::new(&outfit, &drawn, &mesh, settings);
        let own_before = pass.own();
        let rounds = pass.run();
        if pass.between() > 0 || pass.own() > own_before {
            return None;
        }
        let positions: Vec<Vec<[f64; 3]>> =
            (0..outfit.len()).map(|g| outfit.part(&pass.positions, g).to_vec()).collect();
        let certifying = Instant::now();
        let certificate = certified(&drawn, layers, &positions);
        let certificate_time = certifying.elapsed();
        let work = GarmentWork { rounds, ..GarmentWork::default() };
        let mut resolved = Resolved {
            positions,
            certificate,
            garments: vec![work; layers.len()],
            stage: Stage::FastPass,
            filter: pass.filter.work,
            body_time,
            certificate_time,
            ..Resolved::default()
        };
        resolved.compare_since(layers, start);
        (resolved.certificate.is_clear() && resolved.certificate.tears() == 0).then_some(resolved)
    }))
}

/// The faces of an outfit and of what of the body is near it.
fn contact_mesh(outfit: &Outfit<'_>, body: &BodyObstacle<'_>) -> ContactMesh {
    let start = outfit.vertex_count() as u32;
    let near = body.tree.part().iter().map(|&f| body.surface.faces[f as usize].map(|v| v + start));
    ContactMesh::new(outfit.vertex_count() + body.surface.positions.len(), &outfit.faces, near)
}

/// An outfit on its way.
struct FastPass<'a> {
    outfit: &'a Outfit<'a>,
    body: &'a BodyObstacle<'a>,
    settings: &'a ResolveSettings,
    filter: StepFilter<'a>,
    input: Vec<[f64; 3]>,
    /// Vertices of the garments, then those of the body.
    positions: Vec<[f64; 3]>,
    /// Directions away from the body.
    outward: Vec<[f64; 3]>,
}

impl<'a> FastPass<'a> {
    fn new(
        outfit: &'a Outfit<'a>,
        body: &'a BodyObstacle<'a>,
        mesh: &'a ContactMesh,
        settings: &'a ResolveSettings,
    ) -> Self {
        let input: Vec<[f64; 3]> = outfit.layers.iter().flat_map(|l| l.positions).copied().collect();
        let positions = [input.as_slice(), &body.surface.positions].concat();
        let filter = StepFilter::new(mesh, &positions);
        Self { outfit, body, settings, filter, input, positions, outward: Vec::new() }
    }

    /// Rounds until nothing intersects or a round hardly helps; how many it took.
    fn run(&mut self) -> usize {
        let mut left = self.between();
        if std::env::var("TALK").is_ok() {
            eprintln!("  start {left} own {}", self.own());
        }
        if left == 0 {
            return 0;
        }
        let away = |v: u32| {
            let view = self.body.look(self.positions[v as usize]);
            view.and_then(|view| view.plane).map_or([0.0; 3], |plane| plane.normal)
        };
        self.outward = outward(self.outfit, &self.input, away);
        let mut is_free = true;
        for round in 1..=ROUNDS {
            self.round(is_free);
            let before = std::mem::replace(&mut left, self.between());
            if left == 0 {
                return round;
            }
            if left as f64 > STALLED * before as f64 {
                if !is_free {
                    return round;
                }
                is_free = false;
            }
        }
        ROUNDS
    }

    fn round(&mut self, is_free: bool) {
        let t = Instant::now();
        let defects = self.defects();
        let t_defects = t.elapsed();
        let t = Instant::now();
        let contacts = self.conditions(&defects);
        let t_conditions = t.elapsed();
        let t = Instant::now();
        let mut to = self.positions.clone();
        let cloth = &mut to[..self.input.len()];
        let region = &defects.region;
        let (stretch, most) = (self.settings.stretch, self.settings.farthest);
        relax(self.outfit, cloth, &self.input, region, &contacts, stretch, (SWEEPS, LastPasses::FEW));
        for &v in region {
            cloth[v as usize] = no_farther(self.input[v as usize], cloth[v as usize], most);
        }
        let t_relax = t.elapsed();
        let t = Instant::now();
        match is_free {
            true => self.filter.step_freely(&self.positions, &to),
            false => self.filter.step(&self.positions, &mut to, None, FILTER_MARGIN * self.settings.gap),
        }
        self.positions = to;
        if std::env::var("TALK").is_ok() {
            eprintln!(
                "  round {is_free}: region {} contacts {} defects {:.1} conditions {:.1} relax {:.1} step {:.1} ms; left {} own {} {:?}",
                defects.region.len(), contacts.len(), 1e3 * t_defects.as_secs_f64(), 1e3 * t_conditions.as_secs_f64(),
                1e3 * t_relax.as_secs_f64(), 1e3 * t.elapsed().as_secs_f64(), self.between(), self.own(), self.filter.work
            );
        }
    }

    /// Pairs that are left of garments with the body and with each other, but for pinched ones.
    fn between(&self) -> usize {
        self.parted().count()
    }

    /// Pairs that are left of garments with themselves.
    fn own(&self) -> usize {
        self.filter.intersections.iter().filter(|pair| self.is_own(pair)).count()
    }

    fn is_own(&self, &(f, g): &(u32, u32)) -> bool {
        !self.filter.mesh.is_body(g) && self.outfit.garment_of_face(f) == self.outfit.garment_of_face(g)
    }

    /// The pairs of [`between`](Self::between).
    fn parted(&self) -> impl Iterator<Item = &(u32, u32)> {
        let is_counted = |&&(f, g): &&(u32, u32)| match self.body_face(g) {
            Some(face) => !self.body.is_pinched(face),
            None => !self.is_own(&(f, g)) && !(self.is_pinch(f) && self.is_pinch(g)),
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
