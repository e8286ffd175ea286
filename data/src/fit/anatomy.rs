//! Which parts of the body pass through the openings of a garment, and whether bones pass through its cloth.

use super::body_field::LimbTurn;
use super::limb_pose::LIMB_ROOTS;
use crate::asset::Body;
use clothcombo_physics::vec3::{add, cross, dot, scale, sub};

/// The ends of the body, each with the joints on the way there from the pelvis.
const LIMB_CHAINS: [&[&str]; 5] = [
    &["pelvis", "spine1", "spine2", "spine3", "neck", "head"],
    &["pelvis", "spine1", "spine2", "spine3", "left_collar", "left_shoulder", "left_elbow", "left_wrist"],
    &["pelvis", "spine1", "spine2", "spine3", "right_collar", "right_shoulder", "right_elbow", "right_wrist"],
    &["pelvis", "left_hip", "left_knee", "left_ankle"],
    &["pelvis", "right_hip", "right_knee", "right_ankle"],
];
/// How far limbs are extended beyond their last joint (m).
const BEYOND_LIMB: f64 = 20.0;

/// What an opening of a garment goes around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opening {
    Neck,
    LeftArm,
    RightArm,
    LeftLeg,
    RightLeg,
    /// The trunk, or both legs together.
    Trunk,
    /// Several limbs at once, such as the neck and an arm.
    Several,
    /// No part of the body.
    Nothing,
}

/// The bones of the zero body, from the pelvis to the five ends.
pub(super) struct BodySkeleton {
    limbs: [Vec<[f64; 3]>; 5],
    /// Of left and right arm, left and right leg the joint that turns it.
    roots: [Option<[f64; 3]>; 4],
}

type Segment = [[f64; 3]; 2];

/// Bones that pass through cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct PiercingBones {
    pub arms: usize,
    pub others: usize,
}

impl PiercingBones {
    /// The same where arms are bones like any other.
    pub fn anywhere(self) -> Self {
        Self { arms: 0, others: self.arms + self.others }
    }
}

impl BodySkeleton {
    pub fn new(body: &Body) -> Self {
        Self {
            limbs: LIMB_CHAINS.map(|names| names.iter().filter_map(|n| body.joint_place(n)).collect()),
            roots: std::array::from_fn(|limb| body.joint_place(LIMB_ROOTS[limb / 2][limb % 2])),
        }
    }

    /// Bones of every limb, turned, and the ray beyond its end.
    fn bones(&self, turn: LimbTurn) -> [(Vec<Segment>, Option<Segment>); 5] {
        std::array::from_fn(|limb| {
            let mut points = self.limbs[limb].clone();
            if let (1.., Some(root)) = (limb, limb.checked_sub(1).and_then(|limb| self.roots[limb])) {
                let from = points.iter().position(|p| *p == root).unwrap_or(points.len());
                let side = if limb % 2 == 1 { 1.0 } else { -1.0 };
                let turn = if limb < 3 { turn.arms } else { turn.legs };
                points[from..].iter_mut().for_each(|p| *p = turn.applied(*p, root, side));
            }
            let bones: Vec<Segment> = points.windows(2).map(|pair| [pair[0], pair[1]]).collect();
            let beyond = bones.last().map(|[a, b]| {
                let along = sub(*b, *a);
                [*b, add(*b, scale(along, BEYOND_LIMB / dot(along, along).sqrt().max(1e-9)))]
            });
            (bones, beyond)
        })
    }

    /// How many bones pass through cloth: those of the arms, which sleeves made for other arms miss, and all others.
    pub fn piercing(&self, positions: &[[f64; 3]], faces: &[[u32; 3]], turn: LimbTurn) -> PiercingBones {
        let limbs = self.bones(turn);
        let mut bones: Vec<(Segment, bool)> = Vec::new();
        for (limb, (chain, _)) in limbs.iter().enumerate() {
            // Upper arm and forearm are the last ones.
            let arm = if matches!(limb, 1 | 2) { chain.len().saturating_sub(2) } else { chain.len() };
            bones.extend(chain.iter().enumerate().map(|(k, bone)| (*bone, k >= arm)));
        }
        bones.sort_by(|(a, _), (b, _)| {
            a.as_flattened().partial_cmp(b.as_flattened()).unwrap_or(std::cmp::Ordering::Equal)
        });
        bones.dedup();
        let crossed = |bone: &Segment| {
            faces.iter().any(|f| {
                let corners = f.map(|v| positions[v as usize]);
                let is_near = (0..3).all(|k| {
                    let (least, most) = (bone[0][k].min(bone[1][k]), bone[0][k].max(bone[1][k]));
                    corners.iter().any(|c| c[k] <= most) && corners.iter().any(|c| c[k] >= least)
                });
                is_near && passes_through(bone, &corners) != 0
            })
        };
        let count = |is_arm| bones.iter().filter(|(bone, is)| *is == is_arm && crossed(bone)).count();
        PiercingBones { arms: count(true), others: count(false) }
    }

    /// What a closed border goes around: the limbs whose ends its spanning surface separates from the other ends.
    pub fn opening(&self, border: &[[f64; 3]], turn: LimbTurn) -> Opening {
        let centre = scale(border.iter().fold([0.0; 3], |s, p| add(s, *p)), 1.0 / border.len().max(1) as f64);
        let through = self.bones(turn).map(|(bones, beyond)| {
            let segments = bones.iter().chain(&beyond);
            segments
                .map(|segment| {
                    let fan = (0..border.len()).map(|i| [border[i], border[(i + 1) % border.len()], centre]);
                    fan.map(|triangle| passes_through(segment, &triangle)).sum::<i32>()
                })
                .sum::<i32>()
        });
        let apart = |limb: usize| through[limb] != through[0];
        match [apart(1), apart(2), apart(3), apart(4)] {
            [false, false, false, false] => Opening::Nothing,
            [true, true, true, true] => Opening::Neck,
            [true, false, false, false] => Opening::LeftArm,
            [false, true, false, false] => Opening::RightArm,
            [false, false, true, false] => Opening::LeftLeg,
            [false, false, false, true] => Opening::RightLeg,
            [false, false, true, true] => Opening::Trunk,
            _ => Opening::Several,
        }
    }
}

/// +1 or −1 where the segment passes through the triangle along or against its normal, else 0.
fn passes_through([a, b]: &Segment, [p, q, r]: &[[f64; 3]; 3]) -> i32 {
    let normal = cross(sub(*q, *p), sub(*r, *p));
    let (from, to) = (dot(normal, sub(*a, *p)), dot(normal, sub(*b, *p)));
    if (from < 0.0) == (to < 0.0) {
        return 0;
    }
    let direction = sub(*b, *a);
    let turn = |u: [f64; 3], v: [f64; 3]| dot(direction, cross(sub(u, *a), sub(v, *a))) > 0.0;
    // An edge has the same side in both of its triangles, also where the segment meets it.
    let side = |u: [f64; 3], v: [f64; 3]| if u <= v { turn(u, v) } else { !turn(v, u) };
    let sides = [side(*p, *q), side(*q, *r), side(*r, *p)];
    if sides == [true; 3] || sides == [false; 3] { if to > from { 1 } else { -1 } } else { 0 }
}
