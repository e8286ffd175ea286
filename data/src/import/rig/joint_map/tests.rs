use super::*;
use crate::import::rig::{Recording, RigJoint};

/// A rig of `parent > child > …` lines; the first name of a line is there already.
fn rig(lines: &[&str]) -> Recording {
    let mut rig = Recording::new(Vec::new(), 10.0, Vec::new());
    for line in lines {
        let mut parent: Option<usize> = None;
        for name in line.split(" > ") {
            let known = rig.joint(name);
            parent = Some(known.unwrap_or_else(|| {
                let (name, channels) = (name.to_owned(), Vec::new());
                rig.joints.push(RigJoint { name, parent, offset: [0.0; 3], axes: None, channels });
                rig.joints.len() - 1
            }));
        }
    }
    rig
}

/// Both sides of a line with `{}` for the side.
fn both(line: &str, sides: [&str; 2]) -> [String; 2] {
    sides.map(|side| line.replace("{}", side))
}

fn names(rig: &Recording) -> [Option<&str>; 22] {
    resolve(rig).map(|joint| joint.map(|joint| rig.joints[joint].name.as_str()))
}

/// Trunk, leg and arm of a rig, and what spine, neck, hip, knee, ankle, toes, collar, shoulder, elbow and wrist are called in it.
#[rustfmt::skip]
const RIGS: [(&str, [&str; 2], [&str; 3], [&str; 3], [&str; 8]); 14] = [
    ("Mixamo", ["Left", "Right"],
     ["Hips > Spine > Spine1 > Spine2 > Neck > Head > HeadTop_End", "Hips > {}UpLeg > {}Leg > {}Foot > {}ToeBase > {}Toe_End",
      "Spine2 > {}Shoulder > {}Arm > {}ForeArm > {}Hand > {}HandThumb1"], ["Spine", "Spine1", "Spine2"],
     ["{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase", "{}Shoulder", "{}Arm", "{}ForeArm", "{}Hand"]),
    ("Mixamo with its namespace", ["Left", "Right"],
     ["mixamorig1:Hips > mixamorig1:Spine > mixamorig1:Neck > mixamorig1:Head",
      "mixamorig1:Hips > mixamorig1:{}UpLeg > mixamorig1:{}Leg > mixamorig1:{}Foot",
      "mixamorig1:Spine > mixamorig1:{}Shoulder > mixamorig1:{}Arm > mixamorig1:{}ForeArm > mixamorig1:{}Hand"],
     ["mixamorig1:Spine", "", ""],
     ["mixamorig1:{}UpLeg", "mixamorig1:{}Leg", "mixamorig1:{}Foot", "", "mixamorig1:{}Shoulder", "mixamorig1:{}Arm",
      "mixamorig1:{}ForeArm", "mixamorig1:{}Hand"]),
    ("CMU", ["Left", "Right"],
     ["Hips > LowerBack > Spine > Spine1 > Neck > Neck1 > Head", "Hips > {}HipJoint > {}UpLeg > {}Leg > {}Foot > {}ToeBase",
      "Spine1 > {}Shoulder > {}Arm > {}ForeArm > {}Hand > {}FingerBase > {}HandIndex1"], ["LowerBack", "Spine", "Spine1"],
     ["{}UpLeg", "{}Leg", "{}Foot", "{}ToeBase", "{}Shoulder", "{}Arm", "{}ForeArm", "{}Hand"]),
    ("mocapbank", ["Left", "Right"],
     ["Hips > Chest > Chest2 > Neck > Head", "Hips > {}Hip > {}Knee > {}Ankle > {}Toe",
      "Chest2 > {}Collar > {}Shoulder > {}Elbow > {}Wrist"], ["Chest", "", "Chest2"],
     ["{}Hip", "{}Knee", "{}Ankle", "{}Toe", "{}Collar", "{}Shoulder", "{}Elbow", "{}Wrist"]),
    ("Xsens BVH", ["Left", "Right"],
     ["Hips > Chest > Chest2 > Chest3 > Chest4 > Neck > Head", "Hips > {}Hip > {}Knee > {}Ankle > {}Toe",
      "Chest4 > {}Collar > {}Shoulder > {}Elbow > {}Wrist"], ["Chest", "Chest3", "Chest4"],
     ["{}Hip", "{}Knee", "{}Ankle", "{}Toe", "{}Collar", "{}Shoulder", "{}Elbow", "{}Wrist"]),
    ("Xsens segments", ["Left", "Right"],
     ["Pelvis > L5 > L3 > T12 > T8 > Neck > Head", "Pelvis > {}UpperLeg > {}LowerLeg > {}Foot > {}Toe",
      "T8 > {}Shoulder > {}UpperArm > {}ForeArm > {}Hand"], ["L5", "T12", "T8"],
     ["{}UpperLeg", "{}LowerLeg", "{}Foot", "{}Toe", "{}Shoulder", "{}UpperArm", "{}ForeArm", "{}Hand"]),
    ("Rokoko", ["Left", "Right"],
     ["Hips > Spine > Spine1 > Spine2 > Spine3 > Neck > Head", "Hips > {}Thigh > {}Shin > {}Foot > {}Toe > {}ToeEnd",
      "Spine3 > {}Shoulder > {}Arm > {}ForeArm > {}Hand"], ["Spine", "Spine2", "Spine3"],
     ["{}Thigh", "{}Shin", "{}Foot", "{}Toe", "{}Shoulder", "{}Arm", "{}ForeArm", "{}Hand"]),
    ("OptiTrack", ["L", "R"],
     ["Skeleton_001_Hip > Skeleton_001_Ab > Skeleton_001_Chest > Skeleton_001_Neck > Skeleton_001_Head",
      "Skeleton_001_Hip > Skeleton_001_{}Thigh > Skeleton_001_{}Shin > Skeleton_001_{}Foot > Skeleton_001_{}Toe",
      "Skeleton_001_Chest > Skeleton_001_{}Shoulder > Skeleton_001_{}UArm > Skeleton_001_{}FArm > Skeleton_001_{}Hand"],
     ["Skeleton_001_Ab", "", "Skeleton_001_Chest"],
     ["Skeleton_001_{}Thigh", "Skeleton_001_{}Shin", "Skeleton_001_{}Foot", "Skeleton_001_{}Toe", "Skeleton_001_{}Shoulder",
      "Skeleton_001_{}UArm", "Skeleton_001_{}FArm", "Skeleton_001_{}Hand"]),
    ("3ds Max Biped, collarbones on the neck", ["L", "R"],
     ["Bip01 > Bip01 Pelvis > Bip01 Spine > Bip01 Spine1 > Bip01 Neck > Bip01 Head",
      "Bip01 Pelvis > Bip01 {} Thigh > Bip01 {} Calf > Bip01 {} Foot > Bip01 {} Toe0",
      "Bip01 Neck > Bip01 {} Clavicle > Bip01 {} UpperArm > Bip01 {} Forearm > Bip01 {} Hand > Bip01 {} Finger0"],
     ["Bip01 Spine", "", "Bip01 Spine1"],
     ["Bip01 {} Thigh", "Bip01 {} Calf", "Bip01 {} Foot", "Bip01 {} Toe0", "Bip01 {} Clavicle", "Bip01 {} UpperArm",
      "Bip01 {} Forearm", "Bip01 {} Hand"]),
    ("Bandai-Namco", ["L", "R"],
     ["joint_Root > Hips > Spine > Chest > Neck > Head", "Hips > UpperLeg_{} > LowerLeg_{} > Foot_{} > Toes_{}",
      "Chest > Shoulder_{} > UpperArm_{} > LowerArm_{} > Hand_{}"], ["Spine", "", "Chest"],
     ["UpperLeg_{}", "LowerLeg_{}", "Foot_{}", "Toes_{}", "Shoulder_{}", "UpperArm_{}", "LowerArm_{}", "Hand_{}"]),
    ("Unreal", ["l", "r"],
     ["root > pelvis > spine_01 > spine_02 > spine_03 > neck_01 > head", "pelvis > thigh_{} > calf_{} > foot_{} > ball_{}",
      "spine_03 > clavicle_{} > upperarm_{} > lowerarm_{} > hand_{} > index_01_{}"], ["spine_01", "spine_02", "spine_03"],
     ["thigh_{}", "calf_{}", "foot_{}", "ball_{}", "clavicle_{}", "upperarm_{}", "lowerarm_{}", "hand_{}"]),
    ("Blender", ["L", "R"],
     ["hips > spine > chest > neck > head", "hips > thigh.{} > shin.{} > foot.{} > toe.{}",
      "chest > shoulder.{} > upper_arm.{} > forearm.{} > hand.{}"], ["spine", "", "chest"],
     ["thigh.{}", "shin.{}", "foot.{}", "toe.{}", "shoulder.{}", "upper_arm.{}", "forearm.{}", "hand.{}"]),
    ("Poser", ["l", "r"],
     ["hip > abdomen > chest > neck > head", "hip > {}Thigh > {}Shin > {}Foot > {}Toe",
      "chest > {}Collar > {}Shldr > {}ForeArm > {}Hand"], ["abdomen", "", "chest"],
     ["{}Thigh", "{}Shin", "{}Foot", "{}Toe", "{}Collar", "{}Shldr", "{}ForeArm", "{}Hand"]),
    ("ASF", ["l", "r"],
     ["root > lowerback > upperback > thorax > lowerneck > upperneck > head", "root > {}hipjoint > {}femur > {}tibia > {}foot > {}toes",
      "thorax > {}clavicle > {}humerus > {}radius > {}wrist > {}hand > {}fingers"], ["lowerback", "upperback", "thorax"],
     ["{}femur", "{}tibia", "{}foot", "{}toes", "{}clavicle", "{}humerus", "{}radius", "{}wrist"]),
];

#[test]
fn rigs_of_capture_software_are_resolved() {
    for (title, sides, [trunk, leg, arm], spine, limbs) in RIGS {
        let lines: Vec<String> =
            [[trunk.to_owned(), trunk.to_owned()], both(leg, sides), both(arm, sides)].concat();
        let recording = rig(&lines.iter().map(String::as_str).collect::<Vec<_>>());
        let found = names(&recording);
        assert!(missing(&resolve(&recording)).is_empty(), "{title}: {found:?}");
        assert_eq!(found[0], leg.split(" > ").next(), "{title}");
        assert_eq!([3, 6, 9].map(|joint: usize| found[joint].unwrap_or("")), spine, "{title}");
        for (joints, side) in
            [([1, 4, 7, 10, 13, 16, 18, 20], sides[0]), ([2, 5, 8, 11, 14, 17, 19, 21], sides[1])]
        {
            for (joint, limb) in joints.into_iter().zip(limbs) {
                let expected = limb.replace("{}", side);
                assert_eq!(found[joint].unwrap_or(""), expected, "{title}, {}", BODY_JOINT_NAMES[joint]);
            }
        }
        assert!(found[15].is_some(), "{title}");
    }
}

#[test]
fn joints_in_the_wrong_place_of_the_tree_are_not_taken() {
    // The left knee hangs on the right hip.
    let lines = [
        "Hips > Spine > Head",
        "Hips > LeftUpLeg > LeftFoot",
        "Hips > RightUpLeg > RightLeg > RightFoot",
        "RightUpLeg > LeftLeg",
        "Spine > LeftArm > LeftForeArm > LeftHand",
        "Spine > RightArm > RightForeArm > RightHand",
    ];
    let map = resolve(&rig(&lines));
    assert_eq!(missing(&map), ["left_knee"]);
    assert_eq!(missing(&resolve(&rig(&["a > b > c"]))).len(), 15);
    // One limb joint of a strange name hides no other joint.
    let strange = [lines[0], "Hips > Foo > LeftLeg > LeftFoot", lines[2], lines[4], lines[5]];
    assert_eq!(missing(&resolve(&rig(&strange))), ["left_hip"]);
}

#[test]
fn the_spine_is_spread_over_three_joints() {
    let spread = |n: usize| spread(&(0..n).collect::<Vec<_>>());
    assert_eq!(spread(0), [None; 3]);
    assert_eq!(spread(1), [Some(0), None, None]);
    assert_eq!(spread(2), [Some(0), None, Some(1)]);
    assert_eq!(spread(3), [Some(0), Some(1), Some(2)]);
    assert_eq!(spread(4), [Some(0), Some(2), Some(3)]);
    assert_eq!(spread(6), [Some(1), Some(3), Some(5)]);
}
