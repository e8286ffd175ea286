//! Which faces are the outer sheet, which the inner one and which rims.

use super::facing::{Opposite, centre_and_normal};
use clothcombo_physics::mesh::DisjointSets;
use clothcombo_physics::vec3::{add, dot, norm, scale, sub};
use std::collections::{HashMap, VecDeque};

/// Of neither sheet.
const RIM: u8 = 0;
/// Faces away from what the garment encloses.
pub(super) const OUTER: u8 = 1;
/// Faces what the garment encloses.
const INNER: u8 = 2;
/// Faces whose normals have a larger cosine continue each other: a rim stands across the sheets.
const SMOOTH: f64 = 0.5;

/// A label for each face. Faces with an [`Opposite`] form smooth patches; a patch and the one it faces have different labels, the
/// links of most area first; of two sheets the one that encloses more is the outer one. The labels then grow over smooth edges,
/// and what only one label surrounds gets it too.
pub(super) fn label(positions: &[[f64; 3]], faces: &[[u32; 3]], opposite: &[Option<Opposite>]) -> Vec<u8> {
    let neighbours = neighbours(positions, faces);
    let mut patches = DisjointSets::new(faces.len());
    for (f, list) in neighbours.iter().enumerate() {
        for (g, is_smooth) in list {
            if *is_smooth && opposite[f].is_some() && opposite[*g as usize].is_some() {
                patches.join(f as u32, *g);
            }
        }
    }
    let area = |f: usize| norm(centre_and_normal(positions, faces[f]).1);
    let mut links: HashMap<[u32; 2], f64> = HashMap::new();
    for (f, found) in opposite.iter().enumerate() {
        let Some(g) = found.map(|o| o.face).filter(|g| opposite[*g as usize].is_some()) else { continue };
        let (p, q) = (patches.root(f as u32), patches.root(g));
        *links.entry([p.min(q), p.max(q)]).or_default() += area(f);
    }
    let mut links: Vec<([u32; 2], f64)> = links.into_iter().filter(|([p, q], _)| p != q).collect();
    links.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // Patches 2p and 2p+1 are p with the one and the other label.
    let mut labelled = DisjointSets::new(2 * faces.len());
    for ([p, q], _) in &links {
        if labelled.root(2 * p) != labelled.root(2 * q) {
            labelled.join(2 * p, 2 * q + 1);
            labelled.join(2 * p + 1, 2 * q);
        }
    }
    let middle = centre(positions, faces);
    let mut flux: HashMap<u32, f64> = HashMap::new();
    let is_linked: std::collections::HashSet<u32> = links.iter().flat_map(|(pair, _)| *pair).collect();
    for f in (0..faces.len()).filter(|f| opposite[*f].is_some()) {
        let (p, normal) = centre_and_normal(positions, faces[f]);
        let patch = patches.root(f as u32);
        *flux.entry(labelled.root(2 * patch)).or_default() += dot(normal, sub(p, middle));
    }
    let mut labels: Vec<u8> = (0..faces.len())
        .map(|f| {
            let patch = patches.root(f as u32);
            if opposite[f].is_none() || !is_linked.contains(&patch) {
                return RIM;
            }
            let [own, other] = [2 * patch, 2 * patch + 1].map(|side| flux.get(&labelled.root(side)));
            let [own, other] = [own, other].map(|flux| flux.copied().unwrap_or(0.0));
            if own >= other { OUTER } else { INNER }
        })
        .collect();
    grow(&mut labels, &neighbours);
    fill(&mut labels, &neighbours);
    labels
}

/// Faces across each edge with two faces, and whether they continue each other.
fn neighbours(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Vec<Vec<(u32, bool)>> {
    let mut sides: HashMap<[u32; 2], Vec<u32>> = HashMap::with_capacity(2 * faces.len());
    for ([a, b, c], f) in faces.iter().zip(0u32..) {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            sides.entry([*a.min(b), *a.max(b)]).or_default().push(f);
        }
    }
    let mut neighbours = vec![Vec::new(); faces.len()];
    for pair in sides.into_values() {
        let [f, g] = pair[..] else { continue };
        let [m, n] = [f, g].map(|f| centre_and_normal(positions, faces[f as usize]).1);
        let is_smooth = dot(m, n) >= SMOOTH * norm(m) * norm(n);
        neighbours[f as usize].push((g, is_smooth));
        neighbours[g as usize].push((f, is_smooth));
    }
    // The map has no order of its own.
    neighbours.iter_mut().for_each(|list| list.sort_unstable());
    neighbours
}

/// Mean of the faces' centres by area.
fn centre(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> [f64; 3] {
    let (sum, weight) = faces.iter().fold(([0.0; 3], 0.0), |(sum, weight), face| {
        let (centre, normal) = centre_and_normal(positions, *face);
        let area = norm(normal);
        (add(sum, scale(centre, area)), weight + area)
    });
    scale(sum, 1.0 / f64::max(weight, f64::MIN_POSITIVE))
}

/// Labels spread to faces without one that continue a labelled face, all at one speed.
fn grow(labels: &mut [u8], neighbours: &[Vec<(u32, bool)>]) {
    let mut queue: VecDeque<usize> = (0..labels.len()).filter(|f| labels[*f] != RIM).collect();
    while let Some(f) = queue.pop_front() {
        for g in neighbours[f].iter().filter(|(_, is_smooth)| *is_smooth).map(|(g, _)| *g as usize) {
            if labels[g] == RIM {
                labels[g] = labels[f];
                queue.push_back(g);
            }
        }
    }
}

/// Groups of faces without a label that touch one label only get it: creases of a sheet.
fn fill(labels: &mut [u8], neighbours: &[Vec<(u32, bool)>]) {
    let mut seen = vec![false; labels.len()];
    for seed in 0..labels.len() {
        if seen[seed] || labels[seed] != RIM {
            continue;
        }
        let (mut group, mut touched) = (vec![seed], 0u8);
        seen[seed] = true;
        let mut next = 0;
        while next < group.len() {
            for g in neighbours[group[next]].iter().map(|(g, _)| *g as usize) {
                if labels[g] != RIM {
                    touched |= labels[g];
                } else if !std::mem::replace(&mut seen[g], true) {
                    group.push(g);
                }
            }
            next += 1;
        }
        if touched == OUTER || touched == INNER {
            group.into_iter().for_each(|f| labels[f] = touched);
        }
    }
}
