//! Whether every connected piece of a garment is on the body: what lies beside it intersects nothing, and looks like a good fit.

use crate::mesh::gaps_to;
use clothcombo_physics::query::VertexIndex;
use clothcombo_physics::{Surface, Topology};
use std::fmt;

/// Cloth farther from the body, and from cloth that is on the body, than this does not touch it (m).
const TOUCH_REACH: f64 = 0.1;
/// Least share of a piece's vertices that touch, if limbs pass through the openings of another one and not through its own.
const TOUCHING_SHARE: f64 = 0.5;

/// A connected piece that is not on the body.
#[derive(Clone, Debug, PartialEq)]
pub struct StrayPiece {
    /// Its lowest vertex number (from 0).
    pub first_vertex: u32,
    /// Its vertices.
    pub vertices: usize,
    /// Connected pieces of the garment.
    pub pieces: usize,
    /// Distance of its nearest vertex to the body (m).
    pub distance: f64,
}

impl StrayPiece {
    /// What to do about it.
    pub(super) fn hint(&self) -> &'static str {
        match self.pieces {
            1 => "is --offset, or the body of --from-body, the right one?",
            _ => {
                "delete it or move it onto the body, or --keep largest leaves it out; export one file per garment"
            }
        }
    }
}

impl fmt::Display for StrayPiece {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first_vertex, vertices, pieces, distance } = self;
        let which = match pieces {
            1 => "it".to_owned(),
            _ => format!("one of its {pieces} pieces ({vertices} vertices, from vertex {first_vertex} on)"),
        };
        match *distance > TOUCH_REACH {
            true => write!(f, "{which} lies {distance:.2} m beside the body"),
            false => write!(
                f,
                "{which} lies beside the body: no limb passes through it, and most of it is farther than {TOUCH_REACH} m"
            ),
        }
    }
}

/// Connected pieces that are not on the body, whose surface this is (m); `worn` are those that limbs pass through. Trimmings are
/// on the body if they are on cloth that is.
pub fn stray_pieces(
    positions: &[[f64; 3]],
    topology: &Topology,
    body: &Surface<f64>,
    worn: &[u32],
) -> Vec<StrayPiece> {
    let mut gaps = gaps_to(positions, body);
    let mut pieces: Vec<Vec<u32>> = vec![Vec::new(); topology.component_count];
    topology.component_of_vertex.iter().zip(0..).for_each(|(piece, v)| pieces[*piece as usize].push(v));
    pieces.retain(|piece| piece.len() > 1);
    let count = pieces.len();
    let is_on = |piece: &Vec<u32>, gaps: &[f64]| {
        let touching = piece.iter().filter(|v| gaps[**v as usize] < TOUCH_REACH).count();
        let is_worn = worn.contains(&topology.component_of_vertex[piece[0] as usize]);
        let is_panel = worn.is_empty();
        touching > 0 && (is_worn || is_panel || touching as f64 >= TOUCHING_SHARE * piece.len() as f64)
    };
    let own = gaps.clone();
    loop {
        let (on, off): (Vec<_>, Vec<_>) = pieces.into_iter().partition(|piece| is_on(piece, &gaps));
        if on.is_empty() || off.is_empty() {
            let nearest = |piece: &Vec<u32>| piece.iter().map(|v| own[*v as usize]).fold(f64::MAX, f64::min);
            let stray = |piece: &Vec<u32>| StrayPiece {
                first_vertex: piece[0],
                vertices: piece.len(),
                pieces: count,
                distance: nearest(piece),
            };
            return off.iter().map(stray).collect();
        }
        // What lies on cloth that is on the body is on it, too.
        let points: Vec<[f64; 3]> = on.iter().flatten().map(|v| positions[*v as usize]).collect();
        let index = VertexIndex::new(&points);
        for v in off.iter().flatten() {
            let squared = index.nearest(positions[*v as usize]).1;
            gaps[*v as usize] = gaps[*v as usize].min(squared.sqrt());
        }
        pieces = off;
    }
}
