//! The 22 body joints shared by SMPL, SMPL-H and SMPL-X, in their common order.

/// Number of body joints (hands, jaw and eyes excluded).
pub const BODY_JOINT_COUNT: usize = 22;

/// Names of the body joints in SMPL order.
pub const BODY_JOINT_NAMES: [&str; BODY_JOINT_COUNT] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
];

/// Parent of each body joint; `None` for the pelvis.
pub const BODY_JOINT_PARENTS: [Option<usize>; BODY_JOINT_COUNT] = [
    None,
    Some(0),
    Some(0),
    Some(0),
    Some(1),
    Some(2),
    Some(3),
    Some(4),
    Some(5),
    Some(6),
    Some(7),
    Some(8),
    Some(9),
    Some(9),
    Some(9),
    Some(12),
    Some(13),
    Some(14),
    Some(16),
    Some(17),
    Some(18),
    Some(19),
];

/// Index of a body joint by its SMPL name.
pub fn joint_index(name: &str) -> Option<usize> {
    BODY_JOINT_NAMES.iter().position(|n| *n == name)
}

/// Names of the `joint_count` joints of an SMPL (24), SMPL-H (52) or SMPL-X (55) skeleton; joints past the known ones
/// are called `joint_<index>`.
pub fn joint_names(joint_count: usize) -> Vec<String> {
    let mut names: Vec<String> = BODY_JOINT_NAMES.iter().map(|n| n.to_string()).collect();
    if joint_count == 24 {
        names.extend(["left_hand".to_string(), "right_hand".to_string()]);
    } else if joint_count >= 52 {
        if joint_count >= 55 {
            names.extend(["jaw", "left_eye_smplhf", "right_eye_smplhf"].map(String::from));
        }
        for side in ["left", "right"] {
            for finger in FINGERS {
                names.extend((1..=3).map(|k| format!("{side}_{finger}{k}")));
            }
        }
    }
    for j in names.len()..joint_count {
        names.push(format!("joint_{j}"));
    }
    names.truncate(joint_count);
    names
}

/// The ancestors of a joint of the SMPL family (SMPL, SMPL-H, SMPL-X), by name, from its parent on; none for another name.
pub fn family_ancestors(name: &str) -> impl Iterator<Item = String> {
    std::iter::successors(family_parent(name), |parent| family_parent(parent))
}

fn family_parent(name: &str) -> Option<String> {
    if let Some(joint) = joint_index(name) {
        return BODY_JOINT_PARENTS[joint].map(|parent| BODY_JOINT_NAMES[parent].to_owned());
    }
    if ["jaw", "left_eye_smplhf", "right_eye_smplhf"].contains(&name) {
        return Some("head".into());
    }
    let (side, part) = name.split_once('_').filter(|(side, _)| ["left", "right"].contains(side))?;
    let finger = part.strip_suffix(['1', '2', '3']).filter(|finger| FINGERS.contains(finger));
    match (finger, part) {
        (Some(finger), _) if part.ends_with('2') => Some(format!("{side}_{finger}1")),
        (Some(finger), _) if part.ends_with('3') => Some(format!("{side}_{finger}2")),
        (Some(_), _) | (None, "hand") => Some(format!("{side}_wrist")),
        _ => None,
    }
}

/// Fingers in the order of SMPL-H.
const FINGERS: [&str; 5] = ["index", "middle", "pinky", "ring", "thumb"];

/// The joint on the other side of the body (itself on the midline), for any SMPL-family joint count.
pub fn mirrored_joint(joint: usize, joint_count: usize) -> usize {
    let names = joint_names(joint_count);
    let Some(name) = names.get(joint) else { return joint };
    let other = if let Some(rest) = name.strip_prefix("left_") {
        format!("right_{rest}")
    } else if let Some(rest) = name.strip_prefix("right_") {
        format!("left_{rest}")
    } else {
        return joint;
    };
    names.iter().position(|n| *n == other).unwrap_or(joint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_before_children() {
        for (joint, parent) in BODY_JOINT_PARENTS.iter().enumerate() {
            assert_eq!(joint == 0, parent.is_none());
            assert!(parent.is_none_or(|p| p < joint));
        }
    }

    #[test]
    fn ancestors_lead_to_the_pelvis() {
        for name in joint_names(55).into_iter().chain(joint_names(24)).skip(1) {
            assert_eq!(
                family_ancestors(&name).last().as_deref(),
                (name != "pelvis").then_some("pelvis"),
                "{name}"
            );
        }
        let thumb: Vec<String> = family_ancestors("left_thumb3").take(3).collect();
        assert_eq!(thumb, ["left_thumb2", "left_thumb1", "left_wrist"]);
        assert_eq!(family_ancestors("tail").count(), 0);
    }

    #[test]
    fn mirroring_joints_is_an_involution_that_keeps_the_tree() {
        for count in [22, 24, 52, 55, 60] {
            assert_eq!(joint_names(count).len(), count);
            for joint in 0..count {
                assert_eq!(mirrored_joint(mirrored_joint(joint, count), count), joint);
            }
        }
        for joint in 1..BODY_JOINT_COUNT {
            let parent = BODY_JOINT_PARENTS[joint].unwrap();
            assert_eq!(BODY_JOINT_PARENTS[mirrored_joint(joint, 22)], Some(mirrored_joint(parent, 22)));
        }
        assert_eq!(mirrored_joint(25, 55), 40);
        assert_eq!(mirrored_joint(22, 55), 22);
    }
}
