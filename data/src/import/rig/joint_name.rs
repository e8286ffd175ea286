//! What joint names of capture software mean.
//!
//! A name is cut into words (`mixamorig:LeftUpLeg` → left, up, leg), its side is taken out, and the rest is looked up in
//! [`MEANINGS`]. Some names mean different joints in different rigs: `Shoulder` is the collarbone where an `Arm` hangs on it and
//! the upper arm elsewhere. The table lists all meanings; the tree decides ([`super::rig`]).

/// Side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodySide {
    /// The subject's left.
    Left,
    /// The subject's right.
    Right,
}

/// A part of the body that a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyPart {
    /// The root of trunk and legs.
    Pelvis,
    /// The neck.
    Neck,
    /// The head.
    Head,
    /// Leg joints from the hip (0) over knee (1) and ankle (2) to the ball of the foot (3).
    Leg(usize),
    /// Arm joints from the collarbone (0) over shoulder (1) and elbow (2) to the wrist (3).
    Arm(usize),
}

use BodyPart::{Arm, Head, Leg, Neck, Pelvis};

/// Names without their side, and the parts they may mean, the likeliest first. Collections: CMU, LAFAN1, Bandai-Namco, Mixamo,
/// Rokoko, Perception Neuron, Xsens (BVH and segment names), OptiTrack, mocapbank, Poser, 3ds Max Biped, Unreal, ASF.
const MEANINGS: [(&[&str], &[BodyPart]); 15] = [
    (&["pelvis", "hips", "hip", "hiproot", "root"], &[Pelvis]),
    (&["neck", "neck1", "neck01", "neckbase", "lowerneck", "cervical"], &[Neck]),
    (&["head", "skull", "headbase"], &[Head]),
    (&["upleg", "upperleg", "thigh", "upthigh", "femur", "legupper", "hip", "hipjoint"], &[Leg(0)]),
    (&["leg"], &[Leg(1), Leg(0)]),
    (&["knee", "lowleg", "lowerleg", "shin", "calf", "tibia", "shank", "leglower"], &[Leg(1)]),
    (&["ankle"], &[Leg(2)]),
    (&["foot"], &[Leg(2), Leg(3)]),
    (&["toe", "toes", "toebase", "toe0", "toe1", "ball", "ballfoot", "forefoot", "football"], &[Leg(3)]),
    (&["collar", "clavicle", "clav", "collarbone"], &[Arm(0)]),
    (&["shoulder", "shldr"], &[Arm(1), Arm(0)]),
    (&["arm", "upperarm", "uparm", "uarm", "humerus", "armupper"], &[Arm(1)]),
    (&["elbow", "forearm", "lowerarm", "lowarm", "radius", "armlower", "farm"], &[Arm(2)]),
    (&["wrist"], &[Arm(3)]),
    (&["hand", "palm"], &[Arm(3)]),
];

/// Words that say nothing about the part.
const NOISE_WORDS: [&str; 9] = ["joint", "jnt", "j", "bone", "bn", "def", "jt", "skel", "sk"];
const LEFT_WORDS: [&str; 3] = ["left", "l", "lft"];
const RIGHT_WORDS: [&str; 3] = ["right", "r", "rgt"];

/// What a name may mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Meaning {
    /// The side, if it has one.
    pub side: Option<BodySide>,
    /// The parts, the likeliest first; empty for an unknown name.
    pub parts: Vec<BodyPart>,
}

impl Meaning {
    /// The meaning of `name`, of which a prefix that all names of its rig share is cut off already.
    pub fn of(name: &str) -> Self {
        let words = words(name);
        let with_noise = meaning(&words);
        if !with_noise.parts.is_empty() {
            return with_noise;
        }
        let told: Vec<String> =
            words.into_iter().filter(|word| !NOISE_WORDS.contains(&word.as_str())).collect();
        meaning(&told)
    }
}

/// Words in lower case: cut at separators, at digits, and where a capital follows a small letter.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for (i, c) in name.chars().enumerate() {
        let next_is_small = name.chars().nth(i + 1).is_some_and(char::is_lowercase);
        let starts_word = (c.is_uppercase()
            && (before.is_lowercase() || (before.is_uppercase() && next_is_small)))
            || (c.is_ascii_digit() != before.is_ascii_digit());
        if starts_word || !c.is_alphanumeric() {
            words.push(String::new());
        }
        if let (true, Some(word)) = (c.is_alphanumeric(), words.last_mut()) {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

fn meaning(words: &[String]) -> Meaning {
    let side_of = |word: &str| match word {
        _ if LEFT_WORDS.contains(&word) => Some(BodySide::Left),
        _ if RIGHT_WORDS.contains(&word) => Some(BodySide::Right),
        _ => None,
    };
    let mut side = words.iter().find_map(|word| side_of(word));
    let mut rest: String = words.iter().filter(|word| side_of(word).is_none()).map(String::as_str).collect();
    if side.is_none() {
        // Run together, as in "leftupleg" and "lfemur"; "leg" is no "eg" on the left.
        let cut = |long: &str, short: &str| {
            let after = |prefix: &str| rest.strip_prefix(prefix).filter(|rest| !parts(rest, true).is_empty());
            after(long).or_else(|| after(short).filter(|_| parts(&rest, false).is_empty())).map(str::to_owned)
        };
        let found = cut("left", "l").map(|rest| (BodySide::Left, rest));
        if let Some((found, cut)) = found.or_else(|| cut("right", "r").map(|rest| (BodySide::Right, rest))) {
            (side, rest) = (Some(found), cut);
        }
    }
    Meaning { side, parts: parts(&rest, side.is_some()) }
}

/// The parts that `name`, without its side, may mean.
fn parts(name: &str, is_sided: bool) -> Vec<BodyPart> {
    let fits = |part: &BodyPart| is_sided == matches!(part, Leg(_) | Arm(_));
    let rows = MEANINGS.iter().filter(|(names, _)| names.contains(&name));
    rows.flat_map(|(_, parts)| parts.iter().copied().filter(fits)).collect()
}

/// The names without what all but the first, which is the root's, begin with: `mixamorig:`, `Skeleton_`, `Bip01 `.
pub fn without_common_prefix<'a>(names: &[&'a str]) -> Vec<&'a str> {
    // A namespace may differ from joint to joint.
    let names: Vec<&str> = names.iter().map(|name| name.rsplit([':', '|']).next().unwrap_or(name)).collect();
    let Some((first, others)) = names.get(1..).and_then(<[_]>::split_first) else { return names };
    if others.is_empty() {
        return names;
    }
    let common =
        |a: &str, b: &str| a.char_indices().zip(b.chars()).find(|((_, x), y)| x != y).map(|((i, _), _)| i);
    let shared = others.iter().map(|name| common(first, name).unwrap_or(first.len().min(name.len())));
    let shared = &first[..shared.min().unwrap_or(0)];
    // A prefix ends at a separator, or before a capital in every name.
    let ends_at = |end: &usize| {
        let is_separator = shared[..*end].ends_with(|c: char| !c.is_alphanumeric());
        let is_word = |name: &&str| name[*end..].starts_with(char::is_uppercase);
        is_separator || (shared[..*end].ends_with(char::is_lowercase) && names[1..].iter().all(is_word))
    };
    let ends: Vec<usize> = (1..=shared.len()).filter(|end| shared.is_char_boundary(*end)).collect();
    let prefix = ends.into_iter().rev().find(ends_at).map_or("", |end| &shared[..end]);
    names.iter().map(|name| name.strip_prefix(prefix).unwrap_or(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_every_kind_of_rig_are_understood() {
        use BodySide::{Left, Right};
        for (name, side, part) in [
            ("LeftUpLeg", Some(Left), Leg(0)),
            ("RightUpperLeg", Some(Right), Leg(0)),
            ("thigh.L", Some(Left), Leg(0)),
            ("thigh_r", Some(Right), Leg(0)),
            ("L Thigh", Some(Left), Leg(0)),
            ("lfemur", Some(Left), Leg(0)),
            ("LHipJoint", Some(Left), Leg(0)),
            ("LeftLeg", Some(Left), Leg(1)),
            ("R_Calf", Some(Right), Leg(1)),
            ("leftShin", Some(Left), Leg(1)),
            ("RightToeBase", Some(Right), Leg(3)),
            ("LToe", Some(Left), Leg(3)),
            ("ball_l", Some(Left), Leg(3)),
            ("lCollar", Some(Left), Arm(0)),
            ("clavicle_l", Some(Left), Arm(0)),
            ("LeftShoulder", Some(Left), Arm(1)),
            ("rShldr", Some(Right), Arm(1)),
            ("upperarm_l", Some(Left), Arm(1)),
            ("leftforearm", Some(Left), Arm(2)),
            ("RHand", Some(Right), Arm(3)),
            ("Hips", None, Pelvis),
            ("Head", None, Head),
            ("Neck1", None, Neck),
        ] {
            let found = Meaning::of(name);
            assert_eq!((found.side, found.parts.first()), (side, Some(&part)), "{name}");
        }
        for name in [
            "Spine1",
            "l5",
            "t12",
            "LeftHandIndex1",
            "LThumb",
            "Chest",
            "leg",
            "LowerBack",
            "RightFingerBase",
            "",
        ] {
            assert!(Meaning::of(name).parts.is_empty(), "{name}: {:?}", Meaning::of(name));
        }
    }

    #[test]
    fn a_prefix_that_all_joints_share_is_cut_off() {
        for (names, first, last) in [
            (vec!["mixamorig:Hips", "mixamorig:Spine", "mixamorig:LeftLeg"], "Hips", "LeftLeg"),
            (vec!["mixamorigHips", "mixamorigSpine", "mixamorigLeftLeg"], "Hips", "LeftLeg"),
            (vec!["Skeleton_Hips", "Skeleton_Spine", "Skeleton_LeftLeg"], "Hips", "LeftLeg"),
            (vec!["Bip01", "Bip01_Pelvis", "Bip01_L_Thigh"], "Bip01", "L_Thigh"),
            (vec!["Hips", "Spine", "Spine1"], "Hips", "Spine1"),
            (vec!["a:Hips"], "Hips", "Hips"),
            (vec!["a:Hips", "b:Spine"], "Hips", "Spine"),
        ] {
            let cut = without_common_prefix(&names);
            assert_eq!((cut[0], cut[cut.len() - 1]), (first, last), "{names:?}");
        }
    }
}
