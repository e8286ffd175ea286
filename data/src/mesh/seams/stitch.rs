//! Two borders become one: vertices become one vertex, and vertices that face an edge split it.

use super::borders::{Borders, Facing, mean};
use super::runs::{FacingEdges, Run};
use crate::mesh::AREA_SHARE;
use crate::mesh::clean::diagonal;
use crate::mesh::triangle::triangle_normal;
use clothcombo_physics::mesh::DisjointSets;
use clothcombo_physics::vec3::{dot, norm, sub};
use std::collections::{HashMap, HashSet};

/// Vertices closer than this share of the shorter edge become one, though their borders have other vertices.
const SNAP: f64 = 0.2;
/// Least cosine between the normals of a face before and after.
const LEAST_TURN: f64 = 0.2;
/// Attempts, each without what spoiled the one before.
const STITCH_ATTEMPTS: usize = 12;

/// A sheet whose borders were stitched, over the old vertices.
#[derive(Debug)]
pub(super) struct Stitched {
    pub positions: Vec<[f64; 3]>,
    pub faces: Vec<[u32; 3]>,
    /// For each face the one it is part of.
    pub parent: Vec<u32>,
    /// For each old vertex the one it became; itself mostly.
    pub became: Vec<u32>,
    /// Vertices that were joined to a vertex or an edge.
    pub joined: Vec<bool>,
}

/// Stitches along `runs`; `None` if nothing can be joined without a face that degenerates, turns over or is one too many.
pub(super) fn stitch(
    borders: &Borders,
    faces: &[[u32; 3]],
    runs: &[Run],
    facing: &FacingEdges,
    reach: f64,
) -> Option<Stitched> {
    let mut contacts: Vec<(u32, u32, Facing)> = Vec::new();
    for e in runs.iter().flat_map(|run| &run.edges) {
        let Some([first, _, second]) = facing[*e as usize] else { continue };
        let ends = borders.edges[*e as usize].ends;
        contacts.extend([(ends[0], *e, first), (ends[1], *e, second)]);
    }
    let mut banned = HashSet::new();
    for _ in 0..STITCH_ATTEMPTS {
        let plan = StitchPlan::new(borders, &contacts, &banned, reach);
        if !plan.joined.contains(&true) {
            return None;
        }
        let stitched = plan.apply(borders, faces);
        let spoiled = spoiled(borders.positions, faces, &stitched);
        if spoiled.is_empty() {
            return Some(stitched);
        }
        let before = banned.len();
        banned.extend(spoiled);
        if banned.len() == before {
            return None;
        }
    }
    None
}

/// Which vertices become one, and which split an edge.
struct StitchPlan {
    became: Vec<u32>,
    joined: Vec<bool>,
    /// Per border edge the vertices that split it, by their share of it.
    splits: HashMap<u32, Vec<(f64, u32)>>,
    /// Where the vertices of a cluster are drawn to.
    pulls: HashMap<u32, Vec<[f64; 3]>>,
}

impl StitchPlan {
    fn new(borders: &Borders, contacts: &[(u32, u32, Facing)], banned: &HashSet<u32>, reach: f64) -> Self {
        let position = |v: u32| borders.positions[v as usize];
        let distance = |a: u32, b: u32| norm(sub(position(a), position(b)));
        let mut neighbours: HashSet<[u32; 2]> = HashSet::new();
        borders.edges.iter().for_each(|e| {
            neighbours.insert([e.ends[0].min(e.ends[1]), e.ends[0].max(e.ends[1])]);
        });
        let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
        let allowed = || contacts.iter().filter(|(v, ..)| !banned.contains(v));
        for (v, e, there) in allowed() {
            let [own, other] = [*e, there.edge].map(|n| &borders.edges[n as usize]);
            let snap = reach.max(SNAP * own.length.min(other.length));
            for w in other.ends.into_iter().filter(|w| w != v && !banned.contains(w)) {
                let apart = distance(*v, w);
                if apart <= snap {
                    pairs.push((apart, (*v).min(w), (*v).max(w)));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        pairs.dedup();
        let mut members: HashMap<u32, Vec<u32>> = HashMap::new();
        let mut sets = DisjointSets::new(borders.positions.len());
        for (apart, a, b) in pairs {
            let (p, q) = (sets.root(a), sets.root(b));
            if p == q {
                continue;
            }
            let of = |root: u32| members.get(&root).cloned().unwrap_or_else(|| vec![root]);
            let (one, two) = (of(p), of(q));
            let fits = one.iter().all(|x| {
                two.iter().all(|y| {
                    !neighbours.contains(&[*x.min(y), *x.max(y)])
                        && borders.are_apart(*x, *y)
                        && distance(*x, *y) <= 2.0 * apart.max(reach)
                })
            });
            if fits {
                sets.join(p, q);
                members.insert(sets.root(p), [one, two].concat());
            }
        }
        let mut plan = Self {
            became: (0..borders.positions.len() as u32).map(|v| sets.root(v)).collect(),
            joined: vec![false; borders.positions.len()],
            splits: HashMap::new(),
            pulls: HashMap::new(),
        };
        for (root, list) in &members {
            if list.len() > 1 && plan.became[*root as usize] == *root {
                list.iter().for_each(|v| plan.joined[*v as usize] = true);
                plan.pulls.insert(*root, list.iter().map(|v| position(*v)).collect());
            }
        }
        for (v, _, there) in allowed() {
            let root = plan.became[*v as usize];
            let ends = borders.edges[there.edge as usize].ends;
            let touches = ends.iter().any(|w| plan.became[*w as usize] == root || banned.contains(w));
            if touches || !(there.share > 0.0 && there.share < 1.0) {
                continue;
            }
            let splits = plan.splits.entry(there.edge).or_default();
            if splits.iter().all(|(_, w)| *w != root) {
                splits.push((there.share, root));
                plan.joined[*v as usize] = true;
                let pulls = plan.pulls.entry(root).or_insert_with(|| vec![position(*v)]);
                pulls.push(borders.point(there.edge, there.share));
            }
        }
        plan
    }

    fn apply(mut self, borders: &Borders, faces: &[[u32; 3]]) -> Stitched {
        let mut positions = borders.positions.to_vec();
        for (root, pulls) in &self.pulls {
            positions[*root as usize] = mean(pulls);
        }
        let mut split_edges: HashMap<u32, Vec<u32>> = HashMap::new();
        // In a fixed order: a face may have several.
        let mut numbers: Vec<u32> = self.splits.keys().copied().collect();
        numbers.sort_unstable();
        for number in &numbers {
            let Some(splits) = self.splits.get_mut(number) else { continue };
            splits.sort_by(|a, b| a.0.total_cmp(&b.0));
            split_edges.entry(borders.edges[*number as usize].face).or_default().push(*number);
        }
        let mut stitched = Stitched {
            positions,
            faces: Vec::with_capacity(faces.len()),
            parent: Vec::with_capacity(faces.len()),
            became: self.became,
            joined: self.joined,
        };
        for (face, number) in faces.iter().zip(0u32..) {
            // In old vertices as far as they are the face's own, so that its edges are found.
            let mut parts = vec![*face];
            for edge in split_edges.get(&number).into_iter().flatten() {
                let [a, b] = borders.edges[*edge as usize].ends;
                let side = |t: &[u32; 3]| (0..3).find(|i| t[*i] == a && t[(*i + 1) % 3] == b);
                let Some(part) = parts.iter().position(|t| side(t).is_some()) else { continue };
                let Some(i) = side(&parts[part]) else { continue };
                let apex = parts.swap_remove(part)[(i + 2) % 3];
                let between = self.splits[edge].iter().map(|(_, v)| *v);
                let chain: Vec<u32> = [a].into_iter().chain(between).chain([b]).collect();
                parts.extend(chain.windows(2).map(|w| [w[0], w[1], apex]));
            }
            stitched.parent.resize(stitched.faces.len() + parts.len(), number);
            stitched.faces.extend(parts.into_iter().map(|t| t.map(|v| stitched.became[v as usize])));
        }
        stitched
    }
}

/// Old vertices of faces that the stitches spoil.
fn spoiled(old: &[[f64; 3]], faces: &[[u32; 3]], new: &Stitched) -> HashSet<u32> {
    let least = AREA_SHARE * diagonal(old).powi(2);
    let mut spoiled = HashSet::new();
    let mut uses: HashMap<[u32; 2], Vec<u32>> = HashMap::with_capacity(2 * new.faces.len());
    for (face, parent) in new.faces.iter().zip(&new.parent) {
        let [a, b, c] = *face;
        for [a, b] in [[a, b], [b, c], [c, a]] {
            uses.entry([a.min(b), a.max(b)]).or_default().push(*parent);
        }
        let before = triangle_normal(faces[*parent as usize].map(|v| old[v as usize]));
        let after = triangle_normal(face.map(|v| new.positions[v as usize]));
        let is_flat = a == b || b == c || c == a || norm(after) <= least;
        if is_flat || dot(before, after) < LEAST_TURN * norm(before) * norm(after) {
            spoiled.extend(faces[*parent as usize]);
            // The vertices that split it have no other way to be found.
            spoiled.extend(face);
        }
    }
    for ([a, b], parents) in uses {
        // Edges with more than two faces have been cut before: any that is there now is new.
        if parents.len() > 2 {
            spoiled.extend(parents.iter().flat_map(|f| faces[*f as usize]));
            spoiled.extend([a, b]);
        }
    }
    spoiled
}
