//! Cloth that was stretched or pressed together on its way gives back what it can.
//!
//! Taking garments out of the body and of each other keeps the lengths of edges only as far as contacts allow, and what one
//! round needs the next may not. Where the strain energy has risen in the end, edges are taken back towards their rest lengths
//! by small moves, the contacts are met again, and the outcome is kept if no more pairs cross than before (of garments with
//! themselves a few more may) and the energy is lower.

use std::time::Instant;

use super::body::Body;
use super::certificate::strain_joule;
use super::count::certified;
use super::garment::at;
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::relax::{keep_length, no_farther};
use super::relief::Room;
use super::sides::Sides;
use super::untangle::untangled_keeping;
use super::{Certificate, Crossed, Layer, RemainingPair, ResolveSettings, Resolved};
use crate::contact::self_triangle_pairs;
use crate::vec3::distance_squared;

/// A rise of the strain energy, as a share, that is left as it is.
const ENOUGH: f64 = 0.03;
/// Most times that cloth is eased…
pub(super) const TIMES: usize = 20;
/// …those of an outfit that is left with crossings…
const TIMES_WHERE_CROSSED: usize = 4;
/// …and those in a frame of a motion: what is left is for the next one.
pub(super) const TIMES_IN_FRAME: usize = 2;
/// Failures in a row after which it is left.
const MOST_FAILURES: usize = 4;
/// Where easing edges that are too long lowers the energy by a smaller share of what it had risen by, those that are too short
/// are eased as well, which crumples cloth a little…
const LEAST_GAIN_OF_LONG: f64 = 0.01;
/// …and where that lowers it by a smaller share than this, it ends.
const LEAST_GAIN_OF_ALL: f64 = 0.05;
/// Passes over the edges each time.
const PASSES: usize = 20;
/// Farthest that a vertex is moved each time (m): no limb is so thin that cloth could get to its other side.
const FARTHEST: f64 = 0.002;
/// Rounds in which the contacts are met again.
const ROUNDS: usize = 8;
/// Crossings of garments with themselves may become as many as there are, or one in so many of those before the post-process.
const OWN: usize = 4;
/// Rings of neighbours around a crossing that easing would make, which keep their positions.
const RINGS_HELD: usize = 3;

impl Resolved {
    /// Whether the strain energy has risen from that of `layers` by so much that [`ease`](Self::ease) has something to do.
    pub(super) fn is_strained(&self, layers: &[Layer<'_>]) -> bool {
        self.certificate.strain_joule() > (1.0 + ENOUGH) * strain_joule(layers)
    }

    /// Lowers the strain energy where it has risen from that of `layers`, at most so many `times`, without any further crossing
    /// with the body or between garments, and few of garments with themselves. What the post-process has not moved only
    /// moves where contacts ask for it. Strict limits (`settings.loosened`) allow none of this. `start`: when all of it began.
    pub(super) fn ease(
        &mut self,
        body: &Body<'_>,
        layers: &[Layer<'_>],
        settings: &ResolveSettings,
        start: Instant,
        times: usize,
    ) {
        let before = strain_joule(layers);
        let is_enough = |now: &Certificate| now.strain_joule() <= (1.0 + ENOUGH) * before;
        if settings.loosened <= 1.0 || is_enough(&self.certificate) {
            return;
        }
        let settings = ResolveSettings { is_shallow: true, loosened: 1.0, rounds: ROUNDS, ..*settings };
        let times = if self.certificate.is_clear() { times } else { times.min(TIMES_WHERE_CROSSED) };
        let own = self.certificate.self_triangle_pairs.max(own_crossings(layers, &body.drawn) / OWN);
        let mut cloth = Cloth::new(layers, &self.positions);
        let mut failures = 0;
        body.with_room(Room::AMPLE.with_share(0.0), |obstacle| {
            for _ in 0..times {
                let is_late = settings.is_late(start, layers.len());
                if is_enough(&self.certificate) || failures == MOST_FAILURES || is_late {
                    break;
                }
                let sides = Sides::of(&cloth.outfit, &self.positions.concat(), None);
                let eased = cloth.eased(&self.positions);
                let found = untangled_keeping(Some(&sides), obstacle, &at(layers, &eased), &settings);
                let clock = Instant::now();
                let certificate = certified(&body.drawn, layers, &found.positions);
                self.certificate_time += clock.elapsed();
                if certificate.is_worse(&self.certificate, own) {
                    cloth.hold_around(certificate.remaining_beside(&self.certificate));
                    failures += 1;
                    continue;
                }
                failures = 0;
                let risen = self.certificate.strain_joule();
                let gain = (risen - certificate.strain_joule()) / (risen - before);
                if gain > 0.0 {
                    (self.positions, self.certificate) = (found.positions, certificate);
                }
                match cloth.only_stretched {
                    true => cloth.only_stretched = gain >= LEAST_GAIN_OF_LONG,
                    false if gain < LEAST_GAIN_OF_ALL => break,
                    false => (),
                }
            }
        });
    }
}

/// Pairs of triangles of one garment that cross, of all garments, without pinched ones.
fn own_crossings(layers: &[Layer<'_>], body: &BodyObstacle<'_>) -> usize {
    let of_garment = |layer: &Layer<'_>| {
        let faces = layer.garment.faces();
        let is_pinched = |f: u32| body.is_pinch_at(&faces[f as usize].map(|v| layer.positions[v as usize]));
        let all = self_triangle_pairs(layer.positions, faces);
        all.into_iter().filter(|&(f, g)| !(is_pinched(f) && is_pinched(g))).count()
    };
    layers.iter().map(of_garment).sum()
}

/// Garments whose edges give back what they can.
struct Cloth<'a> {
    outfit: Outfit<'a>,
    may_move: Vec<bool>,
    /// Farthest that a vertex is moved (m).
    farthest: f64,
    /// Whether edges that are too short stay so.
    only_stretched: bool,
}

impl<'a> Cloth<'a> {
    /// Of garments that went from `layers` to `positions`: what moved may move again.
    fn new(layers: &'a [Layer<'a>], positions: &[Vec<[f64; 3]>]) -> Self {
        let moves = layers.iter().zip(positions).flat_map(|(l, now)| l.positions.iter().zip(now));
        let may_move = moves.map(|(p, q)| p != q).collect();
        Self { outfit: Outfit::new(layers), may_move, farthest: FARTHEST, only_stretched: true }
    }

    /// The garments from `positions` with edges nearer to their rest lengths, by Gauss–Seidel in a fixed order.
    fn eased(&self, positions: &[Vec<[f64; 3]>]) -> Vec<Vec<[f64; 3]>> {
        let before: Vec<[f64; 3]> = positions.concat();
        let mut eased = before.clone();
        let edges = self.edges();
        for _ in 0..PASSES {
            for &(a, b, length) in &edges {
                if !self.only_stretched || distance_squared(eased[a], eased[b]) > length * length {
                    keep_length(&mut eased, a, b, self.may_move[b], length);
                }
            }
        }
        for (p, q) in before.iter().zip(&mut eased) {
            *q = no_farther(*p, *q, self.farthest);
        }
        (0..self.outfit.len()).map(|g| self.outfit.part(&eased, g).to_vec()).collect()
    }

    /// Edges of which an end may move, the first one: packed vertices and the rest length (m).
    fn edges(&self) -> Vec<(usize, usize, f64)> {
        let of_garment = |g: usize| {
            let garment = self.outfit.layers[g].garment;
            let start = self.outfit.vertices(g).start as usize;
            let edges = garment.topology.edges.iter().zip(&garment.edge_lengths);
            edges.map(move |(edge, length)| (edge.map(|v| start + v as usize), *length))
        };
        let all = (0..self.outfit.len()).flat_map(of_garment);
        all.filter_map(|([a, b], length)| match (self.may_move[a], self.may_move[b]) {
            (true, _) => Some((a, b, length)),
            (false, true) => Some((b, a, length)),
            (false, false) => None,
        })
        .collect()
    }

    /// Keeps the garments where they are around `crossings`; where that is so already, all move half as far.
    fn hold_around<'b>(&mut self, crossings: impl Iterator<Item = &'b RemainingPair>) {
        let mut seeds = Vec::new();
        for pair in crossings {
            let mut crossed = |garment: usize, triangle: usize| {
                let first = self.outfit.faces_of_garment(garment).start as usize;
                seeds.extend(self.outfit.faces[first + triangle]);
            };
            crossed(pair.garment, pair.triangle);
            match pair.crosses {
                Crossed::Body => (),
                Crossed::Layer(inner) => crossed(inner, pair.other_triangle),
                Crossed::Itself => crossed(pair.garment, pair.other_triangle),
            }
        }
        let around = self.outfit.neighbourhood(&seeds, RINGS_HELD);
        let held =
            around.iter().filter(|&&v| std::mem::replace(&mut self.may_move[v as usize], false)).count();
        if held == 0 {
            self.farthest *= 0.5;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::{with_body, with_drawn};
    use super::super::{RestGarment, certify};
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::Surface;
    use crate::vec3::{add, norm, scale, sub};

    const RADIUS: f64 = 0.1;

    /// A ball, and a square sheet that lies 2 mm over its top.
    fn ball_and_sheet() -> (Surface<f64>, RestGarment, Vec<[f64; 3]>) {
        let ball = shapes::icosphere(RADIUS, 4);
        let sheet = shapes::irregular_grid(0.1, 0.1, 14, 14, 0.2, 3);
        let over = |[x, y, _]: [f64; 3]| {
            let flat = [y - 0.05, RADIUS, x - 0.05];
            scale(flat, (RADIUS + 0.002) / norm(flat))
        };
        let sheet = shapes::mapped(&sheet, over);
        (Surface::from_mesh(&ball), RestGarment::new(&sheet), sheet.positions().to_vec())
    }

    /// The sheet with the vertices of one half moved at random by up to `most` (m) along the ball.
    fn pulled(sheet: &[[f64; 3]], most: f64) -> Vec<[f64; 3]> {
        let mut random = SplitMix::new(5);
        let mut pull = |p: &[f64; 3]| {
            let by = std::array::from_fn(|_| most * random.symmetric());
            let pulled = add(*p, by);
            if p[0] > 0.0 { scale(pulled, norm(*p) / norm(pulled)) } else { *p }
        };
        sheet.iter().map(&mut pull).collect()
    }

    #[test]
    fn what_was_pulled_gives_back_without_a_crossing() {
        let (body, garment, sheet) = ball_and_sheet();
        let layers = [Layer { garment: &garment, positions: &sheet }];
        let crumpled = vec![pulled(&sheet, 0.002)];
        let before = garment.strain_energy(&crumpled[0]);
        let certificate = certify(&body, &at(&layers, &crumpled)).unwrap();
        assert_eq!(certificate.pairs(), 0);
        let mut resolved = Resolved { positions: crumpled, certificate, ..Resolved::default() };
        let ease = |body: &Body<'_>| {
            resolved.ease(body, &layers, &ResolveSettings::default(), Instant::now(), TIMES);
        };
        with_drawn(&body, &layers, |drawn| with_body(drawn, 1, ease));
        let after = garment.strain_energy(&resolved.positions[0]);
        assert!(after < 0.1 * before, "{before} {after}");
        let found = certify(&body, &at(&layers, &resolved.positions)).unwrap();
        assert_eq!(found.pairs(), 0);
        assert_eq!(found, resolved.certificate);
        for (p, q) in sheet.iter().zip(&resolved.positions[0]).filter(|(p, _)| p[0] <= 0.0) {
            assert_eq!(p, q, "what had not moved has not moved");
        }
    }

    #[test]
    fn nothing_is_done_where_strain_has_not_risen() {
        let (body, garment, sheet) = ball_and_sheet();
        let [more, less] = [0.002, 0.001].map(|most| pulled(&sheet, most));
        let strict = ResolveSettings { loosened: 1.0, ..ResolveSettings::default() };
        let cases = [(&more, &less, ResolveSettings::default(), false), (&sheet, &less, strict, false)];
        let risen = (&sheet, &less, ResolveSettings::default(), true);
        for (before, now, settings, is_eased) in cases.into_iter().chain([risen]) {
            let layers = [Layer { garment: &garment, positions: before }];
            let positions = vec![now.clone()];
            let certificate = certify(&body, &at(&layers, &positions)).unwrap();
            let mut resolved = Resolved { positions, certificate, ..Resolved::default() };
            let ease = |body: &Body<'_>| resolved.ease(body, &layers, &settings, Instant::now(), TIMES);
            with_drawn(&body, &layers, |drawn| with_body(drawn, 1, ease));
            assert_eq!(resolved.positions[0] != *now, is_eased);
        }
    }

    #[test]
    fn vertices_around_a_crossing_are_held_and_then_all_move_less() {
        let (_, garment, sheet) = ball_and_sheet();
        let layers = [Layer { garment: &garment, positions: &sheet }];
        let moved = vec![sheet.iter().map(|p| add(*p, [0.0, 0.001, 0.0])).collect::<Vec<_>>()];
        let mut cloth = Cloth::new(&layers, &moved);
        assert!(cloth.may_move.iter().all(|may| *may));
        let pair = RemainingPair {
            garment: 0,
            triangle: 7,
            crosses: Crossed::Body,
            other_triangle: 0,
            is_pinched: false,
        };
        cloth.hold_around(std::iter::once(&pair));
        let held = cloth.outfit.neighbourhood(&garment.faces()[7], RINGS_HELD);
        for v in 0..sheet.len() {
            assert_eq!(cloth.may_move[v], !held.contains(&(v as u32)));
        }
        assert_eq!(cloth.farthest, FARTHEST);
        cloth.hold_around(std::iter::once(&pair));
        assert_eq!(cloth.farthest, 0.5 * FARTHEST);
        let eased = cloth.eased(&moved);
        for (p, q) in moved[0].iter().zip(&eased[0]) {
            assert!(norm(sub(*p, *q)) <= cloth.farthest * (1.0 + 1e-12));
        }
    }
}
