//! Strain relaxation: cloth that was stretched or compressed returns towards its rest lengths.
//!
//! Untangling keeps edge lengths only as far as contacts allow, and a stretch that one round needs may not be needed later. If
//! the strain energy has risen in the end, small moves bring edges towards their rest lengths. Each move passes the step filter,
//! so that it makes no intersection, and is taken if the energy falls.

use super::Resolved;
use super::budget::Budget;
use super::certificate::strain_joule;
use super::count::certified;
use super::garment::{at, triangles};
use super::near::near_cloth;
use super::obstacle::BodyObstacle;
use super::packed_cloth::PackedCloth;
use super::relax::{keep_length, no_farther};
use super::task::Task;
use crate::contact::step_filter::{ContactMesh, StepFilter};
use crate::vec3::distance_squared;

/// Most moves.
pub(super) const TIMES: usize = 20;
/// Most moves in a frame of a motion: what is left is for the next one.
pub(super) const TIMES_IN_FRAME: usize = 2;
/// Where relaxing edges that are too long lowers the energy by a smaller share of what it had risen by, those that are too short
/// are relaxed as well, which crumples cloth a little; where that lowers it by less, it ends.
const LEAST_RELAXED: f64 = 0.02;
/// Passes over the edges in a move.
const PASSES: usize = 20;
/// Farthest that a vertex is moved at once (m).
const FARTHEST_AT_ONCE: f64 = 0.002;

impl Resolved {
    /// Lowers the strain energy where it has risen from that before the post-process, by at most so many moves (`times`) of what
    /// was moved before, none of which makes an intersection. Strict limits (`settings.loosened`) allow none of this, nor does a
    /// budget of which the time is over.
    pub(super) fn relax_strain(&mut self, drawn: &BodyObstacle<'_>, task: Task<'_>, times: usize) {
        let Task { layers, settings, budget } = task;
        let has_risen = self.certificate.strain_joule() > strain_joule(layers);
        if settings.loosened <= 1.0 || !has_risen || budget.is_late() {
            return;
        }
        let surface = drawn.surface;
        let near = near_cloth(&surface.positions, &surface.faces, &triangles(&at(layers, &self.positions)));
        let is_near = |face: &&[u32; 3]| face.iter().any(|&v| near[v as usize]);
        let outfit = PackedCloth::new(layers);
        let mesh = contact_mesh(&outfit, surface.positions.len(), surface.faces.iter().filter(is_near));
        let mut positions = self.positions.concat();
        positions.extend(&surface.positions);
        let mut filter = StepFilter::new(&mesh, &positions);
        StrainRelaxation::new(&outfit, task).relax_strain(&mut filter, &mut positions, times);
        let relaxed = outfit.split(&positions);
        if relaxed != self.positions {
            self.certificate = budget.certifying(|| certified(drawn, layers, &relaxed));
            self.positions = relaxed;
        }
    }
}

/// The faces of an outfit and some of a body with so many vertices.
pub(super) fn contact_mesh<'a>(
    outfit: &PackedCloth<'_>,
    body_vertices: usize,
    body_faces: impl Iterator<Item = &'a [u32; 3]>,
) -> ContactMesh {
    let start = outfit.vertex_count() as u32;
    let body_faces = body_faces.map(|face| face.map(|v| v + start));
    ContactMesh::new(outfit.vertex_count() + body_vertices, &outfit.faces, body_faces)
}

/// Garments whose edges relax.
pub(super) struct StrainRelaxation<'a> {
    /// The garments as they were before the post-process.
    outfit: &'a PackedCloth<'a>,
    /// What elements stay apart (m).
    margin: f64,
    budget: &'a Budget,
    /// Whether edges that are too short stay so.
    only_stretched: bool,
}

impl<'a> StrainRelaxation<'a> {
    pub fn new(outfit: &'a PackedCloth<'a>, Task { settings, budget, .. }: Task<'a>) -> Self {
        Self { outfit, margin: settings.least_gap(), budget, only_stretched: true }
    }

    /// Relaxes the garments at the start of `positions`, those of the `filter`, until their strain energy is what it was before
    /// the post-process, a move gains too little, or the time is over.
    pub fn relax_strain(mut self, filter: &mut StepFilter<'_>, positions: &mut Vec<[f64; 3]>, times: usize) {
        let before = strain_joule(self.outfit.layers);
        let mut now = self.strain(positions);
        if now <= before {
            return;
        }
        let may_move = self.may_move(filter, positions);
        let edges = self.edges(&may_move);
        for _ in 0..times {
            if now <= before || self.budget.is_late() {
                break;
            }
            let mut relaxed = self.moved(&edges, &may_move, positions);
            filter.step(positions, &mut relaxed, self.margin);
            let then = self.strain(&relaxed);
            let gain = (now - then) / (now - before);
            if gain > 0.0 {
                (*positions, now) = (relaxed, then);
            } else {
                filter.step_freely(&relaxed, positions);
            }
            if gain < LEAST_RELAXED && !std::mem::take(&mut self.only_stretched) {
                break;
            }
        }
    }

    /// Strain energy of all garments at `positions` (J).
    fn strain(&self, positions: &[[f64; 3]]) -> f64 {
        let outfit = self.outfit;
        (0..outfit.len()).map(|g| outfit.layers[g].garment.strain_energy(outfit.part(positions, g))).sum()
    }

    /// What the post-process has moved, but for corners of triangles that intersect others: they stay where they are counted.
    fn may_move(&self, filter: &StepFilter<'_>, positions: &[[f64; 3]]) -> Vec<bool> {
        let before = self.outfit.layers.iter().flat_map(|layer| layer.positions);
        let mut may_move: Vec<bool> = before.zip(positions).map(|(p, q)| p != q).collect();
        for f in filter.intersections.iter().flat_map(|&(f, g)| [f, g]).filter(|&f| !filter.mesh.is_body(f)) {
            filter.mesh.faces[f as usize].iter().for_each(|&v| may_move[v as usize] = false);
        }
        may_move
    }

    /// `positions` with edges nearer to their rest lengths, by Gauss–Seidel in a fixed order.
    fn moved(
        &self,
        edges: &[(usize, usize, f64)],
        may_move: &[bool],
        positions: &[[f64; 3]],
    ) -> Vec<[f64; 3]> {
        let mut moved = positions.to_vec();
        for _ in 0..PASSES {
            for &(a, b, length) in edges {
                if !self.only_stretched || distance_squared(moved[a], moved[b]) > length * length {
                    keep_length(&mut moved, a, b, may_move[b], length);
                }
            }
        }
        for (p, q) in positions.iter().zip(&mut moved) {
            *q = no_farther(*p, *q, FARTHEST_AT_ONCE);
        }
        moved
    }

    /// Edges of which an end may move, the first one: packed vertices and the rest length (m).
    fn edges(&self, may_move: &[bool]) -> Vec<(usize, usize, f64)> {
        let of_garment = |g: usize| {
            let garment = self.outfit.layers[g].garment;
            let start = self.outfit.vertices(g).start as usize;
            let edges = garment.topology.edges.iter().zip(&garment.edge_lengths);
            edges.map(move |(edge, length)| (edge.map(|v| start + v as usize), *length))
        };
        let all = (0..self.outfit.len()).flat_map(of_garment);
        all.filter_map(|([a, b], length)| match (may_move[a], may_move[b]) {
            (true, _) => Some((a, b, length)),
            (false, true) => Some((b, a, length)),
            (false, false) => None,
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Layer, ResolveSettings, RestGarment, certify};
    use super::*;
    use crate::mesh::shapes::{self, SplitMix};
    use crate::query::Surface;
    use crate::vec3::{add, norm, scale};

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
    fn pulled_cloth_relaxes_without_intersections() {
        let (body, garment, sheet) = ball_and_sheet();
        let layers = [Layer { garment: &garment, positions: &sheet }];
        let crumpled = vec![pulled(&sheet, 0.002)];
        let before = garment.strain_energy(&crumpled[0]);
        let certificate = certify(&body, &at(&layers, &crumpled)).unwrap();
        assert_eq!(certificate.pairs(), 0);
        let mut resolved = Resolved { positions: crumpled, certificate, ..Resolved::default() };
        let (drawn, settings) = (BodyObstacle::near_layers(&body, &layers), &ResolveSettings::default());
        let task = Task { layers: &layers, settings, budget: &Budget::new(settings, 1) };
        resolved.relax_strain(&drawn, task, TIMES);
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
            let task = Task { layers: &layers, settings: &settings, budget: &Budget::new(&settings, 1) };
            resolved.relax_strain(&BodyObstacle::near_layers(&body, &layers), task, TIMES);
            assert_eq!(resolved.positions[0] != *now, is_eased);
        }
    }
}
