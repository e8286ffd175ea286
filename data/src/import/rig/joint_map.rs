//! Which joint of a rig is which of the 22 body joints.
//!
//! Names tell what a joint may be ([`joint_name`](super::joint_name)); the tree decides between meanings and refuses joints that
//! hang elsewhere: leg and arm joints lie on one path each, in order, and pelvis, spine, neck and head on the paths between them.
//! The spine is what lies between pelvis and arms, whatever its joints are called and however many they are.

use super::joint_name::{BodyPart, BodySide, Meaning, without_common_prefix};
use super::recording::Recording;
use crate::asset::skeleton::BODY_JOINT_NAMES;
use crate::import::retarget::JointMap;

/// Body joints of the limbs, from the trunk outwards.
const LEGS: [(BodySide, [usize; 4]); 2] = [(BodySide::Left, [1, 4, 7, 10]), (BodySide::Right, [2, 5, 8, 11])];
const ARMS: [(BodySide, [usize; 4]); 2] =
    [(BodySide::Left, [13, 16, 18, 20]), (BodySide::Right, [14, 17, 19, 21])];
const PELVIS: usize = 0;
const SPINE: [usize; 3] = [3, 6, 9];
const NECK: usize = 12;
const HEAD: usize = 15;

/// The body joints without which nothing can be retargeted, with one of the spine's, and neck or head.
const REQUIRED_JOINTS: [usize; 13] = [0, 1, 2, 4, 5, 7, 8, 16, 17, 18, 19, 20, 21];

struct Rig<'a> {
    recording: &'a Recording,
    meanings: Vec<Meaning>,
}

/// The joint of `recording` for each body joint, as far as it is found. Collarbones, toes, and spine joints beyond the first may be
/// missing: they follow their parents.
pub fn resolve(recording: &Recording) -> JointMap {
    let names: Vec<&str> = recording.joints.iter().map(|joint| joint.name.as_str()).collect();
    let meanings = without_common_prefix(&names).into_iter().map(Meaning::of).collect();
    Rig { recording, meanings }.map()
}

/// Names of the body joints that `map` lacks, and that are needed.
pub fn missing(map: &JointMap) -> Vec<&'static str> {
    let mut missing: Vec<&str> = REQUIRED_JOINTS
        .into_iter()
        .filter(|joint| map[*joint].is_none())
        .map(|j| BODY_JOINT_NAMES[j])
        .collect();
    for one_of in [&SPINE[..], &[NECK, HEAD]] {
        if one_of.iter().all(|joint| map[*joint].is_none()) {
            missing.push(BODY_JOINT_NAMES[one_of[0]]);
        }
    }
    missing
}

impl Rig<'_> {
    fn map(&self) -> JointMap {
        let mut map: JointMap = [None; BODY_JOINT_NAMES.len()];
        for (side, joints) in LEGS {
            let leg = self.limb(side, |part| if let BodyPart::Leg(n) = part { Some(n) } else { None }, true);
            joints.into_iter().zip(leg).for_each(|(joint, found)| map[joint] = found);
        }
        for (side, joints) in ARMS {
            let arm = self.limb(side, |part| if let BodyPart::Arm(n) = part { Some(n) } else { None }, false);
            joints.into_iter().zip(arm).for_each(|(joint, found)| map[joint] = found);
        }
        // Where one joint of a limb is not known, the next one hangs from the same fork.
        let first = |joints: [usize; 4]| joints.into_iter().find_map(|joint| map[joint]);
        let [[left_leg, right_leg], [left_arm, right_arm]] =
            [LEGS, ARMS].map(|sides| sides.map(|(_, joints)| first(joints)));
        let Some(crotch) = self.fork(left_leg, right_leg) else { return map };
        let named = self.path(crotch).into_iter().rev().find(|joint| self.is(*joint, BodyPart::Pelvis));
        let pelvis = named.unwrap_or(crotch);
        map[PELVIS] = Some(pelvis);
        let Some(chest) = self.fork(left_arm, right_arm) else { return map };
        let Some(base) = self.fork(Some(pelvis), Some(chest)) else { return map };
        let is_trunk = |joint: &usize| !self.is(*joint, BodyPart::Neck) && !self.is(*joint, BodyPart::Head);
        let spine: Vec<usize> = self
            .path(chest)
            .into_iter()
            .skip_while(|joint| *joint != base)
            .skip(1)
            .filter(is_trunk)
            .collect();
        for (joint, found) in SPINE.into_iter().zip(spread(&spine)) {
            map[joint] = found;
        }
        let below = |joint: &usize| self.path(*joint).contains(&base);
        let all = || 0..self.meanings.len();
        map[HEAD] = all().find(|joint| self.is(*joint, BodyPart::Head) && below(joint));
        let above_head = |joint: &usize| map[HEAD].is_none_or(|head| self.path(head).contains(joint));
        map[NECK] = all().find(|joint| self.is(*joint, BodyPart::Neck) && below(joint) && above_head(joint));
        map
    }

    fn is(&self, joint: usize, part: BodyPart) -> bool {
        self.meanings[joint].parts.contains(&part)
    }

    /// The joints from the root to `joint`, itself included.
    fn path(&self, joint: usize) -> Vec<usize> {
        let mut path: Vec<usize> =
            std::iter::successors(Some(joint), |joint| self.recording.joints[*joint].parent).collect();
        path.reverse();
        path
    }

    /// The last joint that the paths to two joints share.
    fn fork(&self, a: Option<usize>, b: Option<usize>) -> Option<usize> {
        let (a, b) = (self.path(a?), self.path(b?));
        a.iter().zip(&b).take_while(|(x, y)| x == y).last().map(|(joint, _)| *joint)
    }

    /// The four joints of a limb: of all paths the one on which most of them are found. Of two candidates for the first joint the
    /// `deeper` one is taken if so (a hip joint may have one of its own above it), of those for the others the one nearer to the
    /// trunk.
    fn limb(
        &self,
        side: BodySide,
        slot: impl Fn(BodyPart) -> Option<usize>,
        deeper: bool,
    ) -> [Option<usize>; 4] {
        let slots = |joint: usize| -> Vec<usize> {
            let meaning = &self.meanings[joint];
            let parts = if meaning.side == Some(side) { &meaning.parts[..] } else { &[] };
            parts.iter().filter_map(|part| slot(*part)).collect()
        };
        let candidates = |joint: usize| -> Vec<(usize, Vec<usize>)> {
            let path = self.path(joint).into_iter().map(|joint| (joint, slots(joint)));
            path.filter(|(_, slots)| !slots.is_empty()).collect()
        };
        let mut best = Assignment::default();
        for end in (0..self.meanings.len()).filter(|joint| !slots(*joint).is_empty()) {
            let found = assign(&candidates(end), deeper);
            if found.score() > best.score() {
                best = found;
            }
        }
        best.joints
    }
}

/// Joints of a limb, and how many of them have their likeliest meaning.
#[derive(Clone, Copy, Default)]
struct Assignment {
    joints: [Option<usize>; 4],
    likeliest: usize,
}

impl Assignment {
    fn score(&self) -> (usize, usize) {
        (self.joints.iter().flatten().count(), self.likeliest)
    }
}

/// The best assignment of `candidates`, trunk first, to the four slots in order.
fn assign(candidates: &[(usize, Vec<usize>)], deeper: bool) -> Assignment {
    // The best of the candidates looked at so far, from the end of the limb on, by the first slot that may be taken.
    let mut best = [Assignment::default(); 5];
    for (joint, slots) in candidates.iter().rev() {
        let beyond = best;
        for (first, best) in best.iter_mut().enumerate() {
            for (rank, slot) in slots.iter().enumerate().filter(|(_, slot)| **slot >= first) {
                let mut taken = beyond[slot + 1];
                taken.joints[*slot] = Some(*joint);
                taken.likeliest += usize::from(rank == 0);
                let prefers_deeper = deeper && *slot == 0;
                if taken.score() > best.score() || (taken.score() == best.score() && !prefers_deeper) {
                    *best = taken;
                }
            }
        }
    }
    best[0]
}

/// Three spine joints among those of a rig: evenly along the chain, the last one where the arms hang.
fn spread(chain: &[usize]) -> [Option<usize>; 3] {
    let mut last = None;
    [1, 2, 3].map(|k| {
        // Rounded k/3 of the chain; a joint is used once, the next one follows it.
        let place = ((2 * k * chain.len() + 3) / 6).max(1) - 1;
        let new = (!chain.is_empty() && last != Some(place)).then_some(place);
        last = new.or(last);
        new.map(|place| chain[place])
    })
}

#[cfg(test)]
mod tests;
