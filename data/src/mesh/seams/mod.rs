//! Open seams: borders that run along each other because the panels of a garment are not joined.
//!
//! Borders that nearly coincide are joined; wider ones only if that is asked for, and named otherwise. A border faces another
//! one where the two run in parallel, the sheets continue each other and do not lie on each other, and the way along the border
//! is no shortcut: corners, touching trouser legs and cuffs are no seams.

mod borders;
mod runs;
mod stitch;

use borders::Borders;
pub use runs::Seam;
use runs::{runs, seams};
use stitch::{Stitched, stitch};

/// Borders closer than this share of the median border edge coincide.
pub const COINCIDE_SHARE: f64 = 0.05;
/// Fewest edges, of median length, along which borders run for a seam.
const LEAST_EDGES: f64 = 2.0;
/// A seam is longer than this many times the gap.
const LEAST_SLENDERNESS: f64 = 3.0;

/// A sheet after its seams were joined.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JoinedSheet {
    /// Vertices, as many as before; those that became another one are used by no face.
    pub positions: Vec<[f64; 3]>,
    /// Faces; those of a split edge take the place of their parent.
    pub faces: Vec<[u32; 3]>,
    /// For each face the one it was part of.
    pub parent: Vec<u32>,
    /// For each vertex the one it became.
    pub became: Vec<u32>,
    /// What was found, the longest first.
    pub seams: Vec<Seam>,
}

/// Joins the borders of a manifold sheet that are within `reach` of each other; without `reach` those that coincide within
/// [`COINCIDE_SHARE`]. Vertices that have a partner meet halfway, the others split the edge they face. No edge gets a third face,
/// and no face loses its area or turns over: where one would, the borders stay apart.
pub fn join_seams(positions: &[[f64; 3]], faces: &[[u32; 3]], reach: Option<f64>) -> Option<JoinedSheet> {
    let median = Borders::new(positions, faces, 0.0).median_length();
    let reach = reach.unwrap_or(COINCIDE_SHARE * median);
    if !(reach > 0.0 && median > 0.0 && reach.is_finite()) {
        return None;
    }
    let borders = Borders::new(positions, faces, reach);
    let least = (LEAST_EDGES * median).max(LEAST_SLENDERNESS * reach);
    let (runs, facing) = runs(&borders, reach, least);
    let stitched = stitch(&borders, faces, &runs, &facing, reach)?;
    let seams = seams(&borders, &runs, &facing, |v| stitched.joined[v as usize]);
    let Stitched { positions, faces, parent, became, .. } = stitched;
    Some(JoinedSheet { positions, faces, parent, became, seams })
}

/// Borders that run along each other within `reach` and at least over `least`, the longest first.
pub fn open_seams(positions: &[[f64; 3]], faces: &[[u32; 3]], reach: f64, least: f64) -> Vec<Seam> {
    if !(reach > 0.0 && reach.is_finite()) {
        return Vec::new();
    }
    let borders = Borders::new(positions, faces, reach);
    let (runs, facing) = runs(&borders, reach, least.max(LEAST_SLENDERNESS * reach));
    seams(&borders, &runs, &facing, |_| false)
}

#[cfg(test)]
mod tests;
