//! Stretches of border that run along another border.

use super::borders::{Borders, Facing};

/// Two borders along each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seam {
    /// Length (in the unit of the positions, as the others).
    pub length: f64,
    /// Median distance between the borders.
    pub gap: f64,
    /// Largest distance between them.
    pub widest: f64,
    /// First and last vertex of one of the borders, as they were before.
    pub ends: [u32; 2],
    /// Whether most of it was joined.
    pub is_joined: bool,
}

/// A stretch of border whose every edge faces another one.
#[derive(Debug)]
pub(super) struct Run {
    /// Its edges, in order.
    pub edges: Vec<u32>,
    length: f64,
}

/// What faces the border edges: at their first end, middle and second end.
pub(super) type FacingEdges = Vec<Option<[Facing; 3]>>;

/// All stretches at least `least` long that lie within `reach` of another border.
pub(super) fn runs(borders: &Borders, reach: f64, least: f64) -> (Vec<Run>, FacingEdges) {
    let facing: FacingEdges = (0..borders.edges.len() as u32)
        .map(|e| {
            let at = |share| borders.facing(e, share, reach);
            Some([at(0.0)?, at(0.5)?, at(1.0)?])
        })
        .collect();
    let mut has_before = vec![false; facing.len()];
    for (edge, found) in borders.edges.iter().zip(&facing) {
        if let (Some(next), true) = (edge.next, found.is_some()) {
            has_before[next as usize] = true;
        }
    }
    let mut taken = vec![false; facing.len()];
    let mut runs = Vec::new();
    // Whole loops have no first edge: they come second.
    let starts = (0..facing.len()).filter(|e| !has_before[*e]).chain(0..facing.len());
    for start in starts {
        let mut run = Run { edges: Vec::new(), length: 0.0 };
        let mut at = Some(start as u32);
        while let Some(e) = at.filter(|e| facing[*e as usize].is_some() && !taken[*e as usize]) {
            taken[e as usize] = true;
            run.edges.push(e);
            run.length += borders.edges[e as usize].length;
            at = borders.edges[e as usize].next;
        }
        if run.length >= least && !run.edges.is_empty() {
            runs.push(run);
        }
    }
    (runs, facing)
}

/// The runs as seams, the longest first, each pair of borders once. `is_joined` says of a vertex whether it was joined to another one.
pub(super) fn seams(
    borders: &Borders,
    runs: &[Run],
    facing: &FacingEdges,
    is_joined: impl Fn(u32) -> bool,
) -> Vec<Seam> {
    let mut run_of = vec![None; borders.edges.len()];
    for (run, number) in runs.iter().zip(0..) {
        run.edges.iter().for_each(|e| run_of[*e as usize] = Some(number));
    }
    let mut seams = Vec::new();
    for (number, run) in runs.iter().enumerate() {
        let found = || run.edges.iter().filter_map(|e| facing[*e as usize]);
        let mut partners: Vec<usize> = found().filter_map(|f| run_of[f[1].edge as usize]).collect();
        partners.sort_unstable();
        let most = partners.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).map(|same| same[0]);
        // The other border tells of both.
        if most.is_some_and(|partner| partner < number) {
            continue;
        }
        let is_fold = most == Some(number);
        let mut gaps: Vec<f64> = found().map(|f| f[1].distance).collect();
        gaps.sort_by(f64::total_cmp);
        let vertices: Vec<u32> = run.edges.iter().map(|e| borders.edges[*e as usize].ends[0]).collect();
        let last = run.edges.last().map_or(0, |e| borders.edges[*e as usize].ends[1]);
        let joined = vertices.iter().filter(|v| is_joined(**v)).count();
        seams.push(Seam {
            length: if is_fold { 0.5 * run.length } else { run.length },
            gap: gaps[gaps.len() / 2],
            widest: gaps[gaps.len() - 1],
            ends: [vertices[0], last],
            is_joined: 2 * joined > vertices.len(),
        });
    }
    seams.sort_by(|a, b| b.length.total_cmp(&a.length));
    seams
}
