use std::sync::Arc;

use super::*;
use crate::mesh::shapes;
use crate::query::Surface;
use crate::transform::IDENTITY;

#[test]
fn changes_turn_with_the_skinning_and_fade() {
    let quarter = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let sample = |drape: [f64; 3], transform| PathSample {
        body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
        draped: vec![vec![drape]],
        transforms: vec![transform],
    };
    let PathSample { draped, transforms, .. } = sample([1.0, 0.0, 0.0], IDENTITY);
    let state = ContactState { draped, positions: vec![vec![[1.2, 0.0, 0.4]]], transforms, intersections: 0 };
    let next = sample([0.0, 1.0, 0.0], quarter);
    let found = carried(&state, &next, 0.5)[0][0];
    for (a, b) in found.iter().zip([0.0, 1.1, 0.2]) {
        assert!((a - b).abs() < 1e-12, "{found:?}");
    }
}
