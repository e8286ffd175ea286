//! Self-intersections of a garment: on which side of each other its sheets belong, and the conditions for it.
//!
//! No order of layers decides. As in "Untangling cloth" (Baraff, Witkin and Kass 2003) the curve in which two sheets intersect
//! cuts each of them in two, and the smaller part is the one that went astray. Where one sheet runs into itself next to a
//! fold, or a fold is crumpled, there are no two sheets; there the cloth is smoothed.

use std::collections::HashMap;

use super::RestGarment;
use super::condition::{Condition, is_tiny, normal_of, overlap};
use super::packed_cloth::PackedCloth;
use crate::mesh::DisjointSets;
use crate::vec3::{add, cross, dot, neg, scale, sub};

/// Rings around an intersection that are counted to find the smaller side.
const COUNTED_RINGS: usize = 10;

/// Conditions for the self-intersections of a garment.
#[derive(Debug, Default)]
pub(super) struct PartingConditions {
    /// Conditions that part two sheets.
    pub contacts: Vec<Condition>,
    /// Vertices of crumples, to be smoothed.
    pub crumpled: Vec<u32>,
}

/// Looks at `pairs` of intersecting faces (each ascending) at `positions`; sheets are parted by `gap`.
fn parting_conditions(
    garment: &RestGarment,
    positions: &[[f64; 3]],
    pairs: &[(u32, u32)],
    gap: f64,
) -> PartingConditions {
    let mut found = PartingConditions::default();
    let faces = &garment.faces;
    let mut intersections: HashMap<(u32, u32), Vec<(u32, u32)>> = HashMap::new();
    let mut order: Vec<(u32, u32)> = Vec::new();
    for (&(f, g), (a, b)) in pairs.iter().zip(sheets(garment, pairs)) {
        if a == b {
            found.crumpled.extend(faces[f as usize].iter().chain(&faces[g as usize]));
            continue;
        }
        let (key, pair) = if a < b { ((a, b), (f, g)) } else { ((b, a), (g, f)) };
        let known = intersections.entry(key).or_insert_with(|| {
            order.push(key);
            Vec::new()
        });
        known.push(pair);
    }
    for key in order {
        let pairs = &intersections[&key];
        let turned: Vec<(u32, u32)> = pairs.iter().map(|&(f, g)| (g, f)).collect();
        let (one, other) = (vote(garment, positions, pairs), vote(garment, positions, &turned));
        // The clearer of the two sheets decides.
        let (pairs, vote) = if one.abs() >= other.abs() { (pairs, one) } else { (&turned, other) };
        for &(f, g) in pairs {
            part(garment, positions, (f, g), vote < 0.0, gap, &mut found);
        }
    }
    found.crumpled.sort_unstable();
    found.crumpled.dedup();
    found
}

/// Conditions that part `pairs` of faces at `positions`, each of one garment, one garment after the other, and the vertices of
/// crumples. Those are smoothed: in positions and shape where a garment has a pair `known` from the input; otherwise towards the
/// shape.
pub(super) fn part_self_intersections(
    outfit: &PackedCloth<'_>,
    (pairs, known): (&[(u32, u32)], &[(u32, u32)]),
    gap: f64,
    positions: &[[f64; 3]],
    (smoothed, shape): (&mut [[f64; 3]], &mut [[f64; 3]]),
) -> (Vec<Condition>, Vec<u32>) {
    let (mut contacts, mut crumpled) = (Vec::new(), Vec::new());
    for pairs in pairs.chunk_by(|a, b| outfit.garment_of_face(a.0) == outfit.garment_of_face(b.0)) {
        let g = outfit.garment_of_face(pairs[0].0);
        let (first, start) = (outfit.faces_of_garment(g).start, outfit.vertices(g).start);
        let local: Vec<(u32, u32)> = pairs.iter().map(|(f, g)| (f - first, g - first)).collect();
        let found = parting_conditions(outfit.layers[g].garment, outfit.part(positions, g), &local, gap);
        contacts.extend(found.contacts.into_iter().map(|contact| contact.shifted(start)));
        let is_of_input = pairs.iter().any(|pair| known.binary_search(pair).is_ok());
        for v in found.crumpled.into_iter().map(|v| v + start) {
            crumpled.push(v);
            let ring = outfit.ring(v);
            let share = 1.0 / ring.len().max(1) as f64;
            let v = v as usize;
            if is_of_input {
                let mean = scale(ring.fold([0.0; 3], |sum, n| add(sum, positions[n as usize])), share);
                let by = scale(sub(mean, positions[v]), 0.5);
                smoothed[v] = add(positions[v], by);
                shape[v] = add(shape[v], by);
            } else {
                let by = |n: u32| sub(positions[n as usize], shape[n as usize]);
                let mean = scale(ring.fold([0.0; 3], |sum, n| add(sum, by(n))), share);
                smoothed[v] = add(shape[v], mean);
            }
        }
    }
    (contacts, crumpled)
}

/// The connected components of the intersecting faces: for every pair the numbers of the sheets of its faces.
fn sheets(garment: &RestGarment, pairs: &[(u32, u32)]) -> Vec<(u32, u32)> {
    let mut all: Vec<u32> = pairs.iter().flat_map(|&(f, g)| [f, g]).collect();
    all.sort_unstable();
    all.dedup();
    let number = |f: u32| all.binary_search(&f).ok().map(|number| number as u32);
    let mut sheets = DisjointSets::new(all.len());
    for (f, &face) in (0u32..).zip(&all) {
        for &v in &garment.faces[face as usize] {
            garment.faces_of(v).iter().filter_map(|&g| number(g)).for_each(|g| sheets.join(f, g));
        }
    }
    let mut sheet_of = |f: u32| number(f).map_or(f, |number| sheets.root(number));
    pairs.iter().map(|&(f, g)| (sheet_of(f), sheet_of(g))).collect()
}

/// How clearly the sheet of the first faces belongs above (positive) or below that of the second ones: its vertices above minus
/// those below the curve, as a share, counted ring by ring away from the curve.
fn vote(garment: &RestGarment, positions: &[[f64; 3]], pairs: &[(u32, u32)]) -> f64 {
    let mut heights: HashMap<u32, f64> = HashMap::new();
    let mut front: Vec<u32> = Vec::new();
    for &(f, g) in pairs {
        let [a, b, c] = garment.faces[g as usize].map(|v| positions[v as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        for &v in &garment.faces[f as usize] {
            let height = dot(normal, sub(positions[v as usize], a));
            *heights.entry(v).or_insert_with(|| {
                front.push(v);
                0.0
            }) += height.signum();
        }
    }
    let mut is_above: HashMap<u32, bool> = front.iter().map(|v| (*v, heights[v] >= 0.0)).collect();
    let mut counts = [0usize; 2];
    front.iter().for_each(|v| counts[usize::from(is_above[v])] += 1);
    for _ in 0..COUNTED_RINGS {
        let mut next = Vec::new();
        for v in front {
            let above = is_above[&v];
            for &n in garment.topology.ring(v as usize) {
                is_above.entry(n).or_insert_with(|| {
                    next.push(n);
                    counts[usize::from(above)] += 1;
                    above
                });
            }
        }
        front = next;
    }
    (counts[1] as f64 - counts[0] as f64) / (counts[0] + counts[1]).max(1) as f64
}

/// Face `f` has to lie above face `g`, or below.
fn part(
    garment: &RestGarment,
    positions: &[[f64; 3]],
    (f, g): (u32, u32),
    is_below: bool,
    gap: f64,
    found: &mut PartingConditions,
) {
    let (face, other) = (garment.faces[f as usize], garment.faces[g as usize]);
    let (upper, lower) = (face.map(|v| positions[v as usize]), other.map(|v| positions[v as usize]));
    if is_tiny(&lower) {
        found.crumpled.extend(other);
        return;
    }
    let normal = normal_of(&lower);
    for corner in overlap(&upper, &lower, normal) {
        let sides = ((face, corner.at_upper), (other, corner.at_lower));
        let contact = match is_below {
            false if corner.height < gap => Condition::face_points(sides.0, sides.1, normal, gap),
            true if corner.height > -gap => Condition::face_points(sides.0, sides.1, neg(normal), gap),
            _ => continue,
        };
        found.contacts.push(contact);
    }
}
