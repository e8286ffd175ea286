//! Isotropic remeshing of a level set, whole or cut along curves.
//!
//! Botsch & Kobbelt, "A Remeshing Approach to Multiresolution Modeling", 2004: split long edges, collapse short ones,
//! flip towards larger angles, relax in the tangent plane, project back. Here every vertex is projected to the implicit
//! surface it belongs to, a boundary vertex to the intersection of that surface with its cut, so that hems stay exact.

use super::editable::{DEAD, EditableMesh};
use super::triangle::smallest_sine;
use clothcombo_physics::vec3::{add, cross, dot, norm, norm_squared, normalized, scale, sub};
use std::collections::VecDeque;

/// The surface that remeshing has to keep to, and the edge length it should have.
pub trait RemeshTarget: Sync {
    /// The point of the surface (label 0), of a boundary curve (one bit) or the corner (several bits) next to `point`.
    fn project(&self, point: [f64; 3], label: u32) -> [f64; 3];
    /// Wanted edge length at a point in metres.
    fn edge_length(&self, point: [f64; 3]) -> f64;
}

/// Limits a finished mesh should satisfy.
#[derive(Debug, Clone, Copy)]
pub struct Quality {
    /// Smallest triangle angle in degrees.
    pub angle: f64,
    /// Shortest and longest edge relative to the median.
    pub edge_ratio: [f64; 2],
}

const LONG: f64 = 4.0 / 3.0;
const SHORT: f64 = 0.8;

/// Runs `iterations` rounds, then repairs single triangles that miss `quality`.
pub fn remesh(sheet: &mut EditableMesh, target: &impl RemeshTarget, iterations: usize, quality: Quality) {
    // First on the polygonised surface as it is: projecting its slivers one by one would fold them.
    let flat = Unprojected(target);
    for _ in 0..2 {
        collapse_short_edges(sheet, &flat);
        flip_edges(sheet);
    }
    for iteration in 0..iterations {
        split_long_edges(sheet, target);
        collapse_short_edges(sheet, target);
        flip_edges(sheet);
        relax(sheet, target);
        if iteration + 1 < iterations {
            flip_edges(sheet);
        }
    }
    flip_edges(sheet);
    for _ in 0..8 {
        if !repair(sheet, target, quality) {
            break;
        }
    }
}

/// Keeps the edge lengths of a target but leaves points where they are.
struct Unprojected<'a, T>(&'a T);

impl<T: RemeshTarget> RemeshTarget for Unprojected<'_, T> {
    fn project(&self, point: [f64; 3], _label: u32) -> [f64; 3] {
        point
    }

    fn edge_length(&self, point: [f64; 3]) -> f64 {
        self.0.edge_length(point)
    }
}

/// Wanted edge length at every vertex. It varies over decimetres, so it is looked up once a pass, not once a question.
struct Sizing(Vec<f64>);

impl Sizing {
    fn new(sheet: &EditableMesh, target: &impl RemeshTarget) -> Self {
        Self(sheet.positions.iter().map(|p| target.edge_length(*p)).collect())
    }

    /// Wanted length of the edge `ab`.
    fn of(&self, a: u32, b: u32) -> f64 {
        0.5 * (self.0[a as usize] + self.0[b as usize])
    }

    /// Length of the edge `ab` relative to the wanted one.
    fn ratio(&self, sheet: &EditableMesh, a: u32, b: u32) -> f64 {
        sheet.length(a, b) / self.of(a, b)
    }
}

fn split_edge(
    sheet: &mut EditableMesh,
    target: &impl RemeshTarget,
    sizing: &mut Sizing,
    a: u32,
    b: u32,
) -> u32 {
    let middle = scale(add(sheet.point(a), sheet.point(b)), 0.5);
    let v = sheet.split(a, b, middle);
    sizing.0.push(sizing.of(a, b));
    sheet.positions[v as usize] = target.project(middle, sheet.labels[v as usize]);
    v
}

/// The edges whose length relative to the wanted one is as asked for, each with that ratio.
fn edges_by_ratio(
    sheet: &EditableMesh,
    sizing: &Sizing,
    is_wanted: impl Fn(f64) -> bool,
) -> Vec<(f64, [u32; 2])> {
    let edges = sheet.edges().into_iter().map(|[a, b]| (sizing.ratio(sheet, a, b), [a, b]));
    edges.filter(|(ratio, _)| is_wanted(*ratio)).collect()
}

fn split_long_edges(sheet: &mut EditableMesh, target: &impl RemeshTarget) {
    let mut sizing = Sizing::new(sheet, target);
    for _ in 0..4 {
        let mut long = edges_by_ratio(sheet, &sizing, |ratio| ratio > LONG);
        if long.is_empty() {
            break;
        }
        long.sort_by(|p, q| q.0.total_cmp(&p.0));
        for (_, [a, b]) in long {
            // Faces only shrink while splitting, so the edge is still there; its length has not changed.
            split_edge(sheet, target, &mut sizing, a, b);
        }
    }
}

/// Collapses `ab` if the result has no edge above the limit and no bad triangle.
fn try_collapse(
    sheet: &mut EditableMesh,
    target: &impl RemeshTarget,
    sizing: &Sizing,
    [a, b]: [u32; 2],
    limit: f64,
    least_angle: f64,
) -> bool {
    let label = |v: u32| sheet.labels[v as usize];
    let order =
        if label(a).count_ones() > label(b).count_ones() { [(b, a), (a, b)] } else { [(a, b), (b, a)] };
    let middle = scale(add(sheet.point(a), sheet.point(b)), 0.5);
    for (gone, kept) in order {
        if !sheet.can_collapse(gone, kept) {
            continue;
        }
        // The middle keeps the spacing even; the kept end moves fewer triangles and nearly always fits.
        let same = label(gone) == label(kept) && label(kept).count_ones() <= 1;
        let candidates = [same.then(|| target.project(middle, label(kept))), Some(sheet.point(kept))]
            .into_iter()
            .flatten();
        for position in candidates {
            let near = |u: u32, v: u32| {
                let longest = limit * sizing.of(u, v);
                norm_squared(sub(sheet.point(u), position)) < longest * longest
            };
            let fits = |v: u32, other: u32| {
                let mut corners = sheet.incident(v).iter().flat_map(|f| sheet.faces[*f as usize]);
                corners.all(|u| u == v || u == other || near(u, v))
            };
            if fits(gone, kept)
                && fits(kept, gone)
                && sheet.can_move(gone, position, kept, least_angle)
                && sheet.can_move(kept, position, gone, least_angle)
            {
                sheet.collapse(gone, kept, position);
                return true;
            }
        }
    }
    false
}

/// Removes interior vertices with only three faces. They cannot be relaxed out of a sliver, and while they are there the
/// edges around them cannot be collapsed.
fn remove_three_valent(sheet: &mut EditableMesh) {
    let mut around = Vec::new();
    for v in 0..sheet.positions.len() as u32 {
        if sheet.labels[v as usize] == 0 && sheet.incident(v).len() == 3 {
            sheet.neighbours(v, &mut around);
            if let Some(kept) = around.iter().copied().find(|u| sheet.can_collapse(v, *u)) {
                sheet.collapse(v, kept, sheet.point(kept));
            }
        }
    }
}

fn collapse_short_edges(sheet: &mut EditableMesh, target: &impl RemeshTarget) {
    remove_three_valent(sheet);
    let sizing = Sizing::new(sheet, target);
    for _ in 0..6 {
        let mut short = edges_by_ratio(sheet, &sizing, |ratio| ratio < SHORT);
        short.sort_by(|p, q| p.0.total_cmp(&q.0));
        let mut collapsed = 0;
        for (_, [a, b]) in short {
            if sheet.is_alive(a)
                && sheet.is_alive(b)
                && sizing.ratio(sheet, a, b) < SHORT
                && try_collapse(sheet, target, &sizing, [a, b], LONG, 8.0)
            {
                collapsed += 1;
            }
        }
        if collapsed == 0 {
            break;
        }
    }
}

fn flip_edges(sheet: &mut EditableMesh) {
    for _ in 0..4 {
        let mut flipped = 0;
        for [a, b] in sheet.edges() {
            flipped += usize::from(sheet.flip_if_better(a, b, 0.02));
        }
        if flipped == 0 {
            break;
        }
    }
}

/// Where relaxation wants a vertex: the area-weighted centre of its faces in the tangent plane, or the middle of its
/// boundary neighbours.
fn relaxed(sheet: &EditableMesh, target: &impl RemeshTarget, v: u32) -> Option<[f64; 3]> {
    let p = sheet.point(v);
    let label = sheet.labels[v as usize];
    match label.count_ones() {
        0 => {
            let (mut sum, mut weight, mut normal) = ([0.0; 3], 0.0, [0.0; 3]);
            for f in sheet.incident(v) {
                let n = sheet.normal(*f);
                let [a, b, c] = sheet.faces[*f as usize].map(|u| sheet.point(u));
                let area = norm(n);
                sum = add(sum, scale(add(add(a, b), c), area / 3.0));
                weight += area;
                normal = add(normal, n);
            }
            if weight <= 0.0 {
                return None;
            }
            let step = sub(scale(sum, 1.0 / weight), p);
            let n = normalized(normal);
            Some(target.project(add(p, scale(sub(step, scale(n, dot(n, step))), 0.8)), 0))
        }
        1 => {
            let [a, b] = sheet.boundary_neighbours(v)?;
            let middle = scale(add(sheet.point(a), sheet.point(b)), 0.5);
            let tangent = normalized(sub(sheet.point(b), sheet.point(a)));
            let along = scale(tangent, 0.6 * dot(tangent, sub(middle, p)));
            Some(target.project(add(p, along), label))
        }
        _ => None,
    }
}

fn relax(sheet: &mut EditableMesh, target: &impl RemeshTarget) {
    for v in 0..sheet.positions.len() as u32 {
        if sheet.is_alive(v)
            && let Some(moved) = relaxed(sheet, target, v)
            && sheet.can_move(v, moved, u32::MAX, 5.0)
        {
            sheet.positions[v as usize] = moved;
        }
    }
}

/// Median length of all edges.
fn median_edge_length(sheet: &EditableMesh) -> f64 {
    let mut lengths: Vec<f64> = sheet.edges().into_iter().map(|[a, b]| sheet.length(a, b)).collect();
    let middle = lengths.len() / 2;
    if lengths.is_empty() { 0.0 } else { *lengths.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// One pass over the triangles that miss the limits with a margin: flip, collapse, split or move, whichever helps first.
/// Returns whether there was something to do.
fn repair(sheet: &mut EditableMesh, target: &impl RemeshTarget, quality: Quality) -> bool {
    let median = median_edge_length(sheet);
    let mut sizing = Sizing::new(sheet, target);
    let sine = (quality.angle * 1.25).to_radians().sin();
    let [low, high] = [quality.edge_ratio[0] * 1.15 * median, quality.edge_ratio[1] / 1.15 * median];
    let mut queue: VecDeque<u32> = (0..sheet.faces.len() as u32).collect();
    let mut worked = false;
    while let Some(f) = queue.pop_front() {
        let face = sheet.faces[f as usize];
        if face == DEAD {
            continue;
        }
        let mut sides: Vec<(f64, u32, u32)> =
            (0..3).map(|i| (sheet.length(face[i], face[(i + 1) % 3]), face[i], face[(i + 1) % 3])).collect();
        sides.sort_by(|p, q| p.0.total_cmp(&q.0));
        let thin = smallest_sine(face.map(|v| sheet.point(v))) < sine;
        if !thin && sides[0].0 >= low && sides[2].0 <= high {
            continue;
        }
        worked = true;
        let (_, a, b) = sides[0];
        let (_, c, d) = sides[2];
        if thin && sides.iter().rev().any(|(_, a, b)| sheet.flip_if_better(*a, *b, 0.02)) {
            continue;
        }
        if (sides[0].0 < low || (thin && sides[0].0 < 0.75 * median))
            && try_collapse(sheet, target, &sizing, [a, b], 1.6, 12.0)
        {
            continue;
        }
        if sides[2].0 > high || (thin && sides[2].0 > 1.45 * median) {
            let v = split_edge(sheet, target, &mut sizing, c, d);
            let mut around = Vec::new();
            sheet.neighbours(v, &mut around);
            let spokes: Vec<[u32; 2]> = around.iter().map(|u| [v, *u]).collect();
            for [p, q] in spokes {
                sheet.flip_if_better(p, q, 0.02);
            }
        }
        for v in face {
            improve(sheet, target, v);
        }
    }
    remove_three_valent(sheet);
    flip_edges(sheet);
    worked
}

/// Moves one vertex if that raises the smallest angle around it: towards the relaxed position, or a few steps around.
fn improve(sheet: &mut EditableMesh, target: &impl RemeshTarget, v: u32) {
    if !sheet.is_alive(v) || sheet.labels[v as usize].count_ones() > 1 {
        return;
    }
    let worst = |sheet: &EditableMesh, p: [f64; 3]| {
        sheet
            .incident(v)
            .iter()
            .map(|f| smallest_sine(sheet.faces[*f as usize].map(|u| if u == v { p } else { sheet.point(u) })))
            .fold(f64::MAX, f64::min)
    };
    let label = sheet.labels[v as usize];
    let start = sheet.point(v);
    let (mut best, mut best_value) = (start, worst(sheet, start));
    let mut candidates: Vec<[f64; 3]> = relaxed(sheet, target, v).into_iter().collect();
    let normal = normalized(sheet.vertex_normal(v));
    let helper = if normal[0].abs() < 0.7 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let u = normalized(cross(normal, helper));
    let w = cross(normal, u);
    let reach = 0.25
        * sheet
            .incident(v)
            .iter()
            .map(|f| norm_squared(sheet.normal(*f)).powf(0.25))
            .fold(f64::MAX, f64::min)
            .max(1e-4);
    for i in 0..8 {
        let (s, c) = (std::f64::consts::FRAC_PI_4 * i as f64).sin_cos();
        let moved = add(start, add(scale(u, reach * c), scale(w, reach * s)));
        candidates.push(target.project(moved, label));
    }
    for candidate in candidates {
        let value = worst(sheet, candidate);
        if value > best_value && sheet.can_move(v, candidate, u32::MAX, 0.0) {
            (best, best_value) = (candidate, value);
        }
    }
    sheet.positions[v as usize] = best;
}
