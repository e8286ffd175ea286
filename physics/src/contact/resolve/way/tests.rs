use std::sync::Arc;

use super::*;
use crate::mesh::shapes;
use crate::query::Surface;
use crate::transform::IDENTITY;

#[test]
fn changes_turn_with_the_skinning_and_fade() {
    let quarter = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let stage = |drape: [f64; 3], transform| PathSample {
        body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
        draped: vec![vec![drape]],
        transforms: vec![transform],
    };
    let PathSample { draped, transforms, .. } = stage([1.0, 0.0, 0.0], IDENTITY);
    let reached = Reached { draped, positions: vec![vec![[1.2, 0.0, 0.4]]], transforms, crossings: 0 };
    let next = stage([0.0, 1.0, 0.0], quarter);
    let found = carried(&reached, &next, 0.5)[0][0];
    for (a, b) in found.iter().zip([0.0, 1.1, 0.2]) {
        assert!((a - b).abs() < 1e-12, "{found:?}");
    }
}

#[test]
fn garments_with_themselves_count_in_short_steps_only() {
    let reached = || Reached { draped: vec![], positions: vec![], transforms: vec![], crossings: 2 };
    let place =
        |own| Place { reached: reached(), gave_way: None, own, sides: OnceLock::new(), sides_before: None };
    let found = |crossings, own| Untangled { crossings, own, ..Untangled::default() };
    for is_short in [false, true] {
        assert!(place(Some(50)).crosses_less_than(&found(3, 0), is_short));
        assert!(!place(Some(50)).crosses_less_than(&found(2, 56), is_short));
        assert_eq!(place(Some(50)).crosses_less_than(&found(0, 57), is_short), is_short);
        assert!(!place(Some(0)).crosses_less_than(&found(0, 4), is_short));
        assert!(!place(None).crosses_less_than(&found(0, 1000), is_short));
    }
}
