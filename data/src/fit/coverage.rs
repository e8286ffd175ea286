//! Which part of the body a mesh covers.

use crate::asset::Body;

/// Where a mesh on the zero body lies that covers neither trunk nor hips; `None` if it covers one of them.
pub fn off_trunk(positions: &[[f64; 3]], body: &Body) -> Option<&'static str> {
    let joint = |name: &str| body.joint_place(name).unwrap_or([0.0; 3]);
    let (neck, knee, shoulder) = (joint("neck"), joint("left_knee"), joint("left_shoulder"));
    let all = |test: &dyn Fn(&[f64; 3]) -> bool| positions.iter().all(test);
    if all(&|p| p[1] > neck[1]) {
        Some("it covers the head only")
    } else if all(&|p| p[1] < knee[1]) {
        Some("it covers the feet only")
    } else if all(&|p| p[0].abs() > shoulder[0]) {
        Some("it covers the arms only")
    } else {
        None
    }
}
