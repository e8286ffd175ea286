//! Which part of the body a vertex belongs to.

use crate::asset::{BODY_JOINT_COUNT, Body};

/// The body joint with the largest weight per vertex; hand, jaw and eye joints count as their ancestor.
pub(super) fn dominant_joints(body: &Body) -> Vec<usize> {
    (0..body.vertex_count())
        .map(|v| {
            let heaviest = body.skin_weights.of_vertex(v).max_by(|a, b| a.1.total_cmp(&b.1));
            let mut joint = heaviest.map_or(0, |(joint, _)| joint);
            while joint >= BODY_JOINT_COUNT {
                match body.parents.get(joint).copied().flatten() {
                    Some(parent) => joint = parent,
                    None => return 0,
                }
            }
            joint
        })
        .collect()
}
