//! The T-posed body as the placement search sees it: signed distances on grids, with limbs that turn at shoulders and hips.

use super::limb_pose::{LIMB_ROOTS, LimbPose};
use super::placement::Placement;
use crate::asset::Body;
use crate::generate::garment::measures::BodyMeasures;
use crate::mesh::{DistanceGrid, compact};
use clothcombo_physics::vec3::{add, norm, scale, sub};
use clothcombo_physics::{Topology, TriMesh};
use std::sync::Arc;

/// Node spacing of the grids (m).
const FIELD_STEP: f64 = 0.02;
/// Largest distance the grids tell (m): cloth farther away says nothing about where it belongs.
const FIELD_BAND: f64 = 0.25;

/// Signed distance to the body with its arms lowered by any angle.
///
/// Trunk and arms are closed surfaces of their own; the distance to their union is the least of the three.
#[derive(Clone)]
pub(super) struct BodyField {
    /// The trunk as it is.
    trunk: Arc<DistanceGrid>,
    /// The trunk as taut cloth sees it.
    form: Arc<DistanceGrid>,
    arms: Arc<[Arm]>,
    /// Left and right hip (m).
    hips: Option<[[f64; 3]; 2]>,
    /// How much of the left (positive) or right (negative) arm's and leg's weight the body next to a point has, in one pose.
    weights: [Option<Arc<DistanceGrid>>; 2],
    pub levels: Levels,
    /// Lowest and highest corner of the zero body (m).
    pub low: [f64; 3],
    pub high: [f64; 3],
    /// Mean z of the spine (m).
    pub spine_z: f64,
}

/// Parts of the body on which cloth may lie differently: legs, hips, chest, shoulders and neck, arms.
pub(super) const BODY_PARTS: usize = 5;

/// Heights of the zero body (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels {
    pub crotch: f64,
    pub hip: f64,
    pub waist: f64,
    pub armpit: f64,
}

struct Arm {
    /// +1 for the left arm, −1 for the right one.
    side: f64,
    shoulder: [f64; 3],
    /// Radius of the cut through the shoulder (m): the deltoid stays round when the arm turns.
    radius: f64,
    distance: DistanceGrid,
}

/// How arms hang below the horizontal and legs are turned outwards.
#[derive(Clone, Copy)]
pub(super) struct LimbTurn {
    pub arms: Turn,
    pub legs: Turn,
}

impl LimbTurn {
    pub fn of(placement: &Placement) -> Self {
        // The left leg is turned outwards as the left arm is raised.
        Self { arms: Turn::new(placement.arm_angle_degrees), legs: Turn::new(-placement.leg_angle_degrees) }
    }
}

/// Sine and cosine of an angle by which the left limb is lowered, the right one mirrored.
#[derive(Clone, Copy)]
pub(super) struct Turn {
    sine: f64,
    cosine: f64,
}

impl Turn {
    fn new(degrees: f64) -> Self {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        Self { sine, cosine }
    }

    /// A point of the turned limb of this side, turned back to the T-pose about its joint.
    fn undone(self, p: [f64; 3], joint: [f64; 3], side: f64) -> [f64; 3] {
        let [x, y, z] = sub(p, joint);
        let sine = side * self.sine;
        add(joint, [self.cosine * x - sine * y, sine * x + self.cosine * y, z])
    }

    /// The inverse of [`Turn::undone`].
    pub fn applied(self, p: [f64; 3], joint: [f64; 3], side: f64) -> [f64; 3] {
        Self { sine: -self.sine, ..self }.undone(p, joint, side)
    }
}

impl BodyField {
    pub fn new(body: &Body) -> Self {
        let weights = limb_weights(body, LIMB_ROOTS[0]);
        let mut parts: [Vec<[u32; 3]>; 3] = Default::default();
        for (face, weight) in body.faces.iter().zip(weights) {
            let side = [weight, -weight].into_iter().position(|share| share > 0.5);
            parts[side.unwrap_or(2)].push(*face);
        }
        let [left, right, trunk] = &parts;
        let distance = |faces: &[[u32; 3]]| {
            let (positions, faces, radius) = closed(&body.template, faces);
            (DistanceGrid::new(&positions, &faces, FIELD_STEP, FIELD_BAND), radius)
        };
        let arm = |side: usize, faces: &[[u32; 3]]| {
            let shoulder = body.joint_place(LIMB_ROOTS[0][side]).filter(|_| !faces.is_empty())?;
            let (distance, radius) = distance(faces);
            // The deltoid lies within the cut.
            Some(Arm { side: [1.0, -1.0][side], shoulder, radius: 0.9 * radius, distance })
        };
        let (trunk, (left, right)) =
            rayon::join(|| distance(trunk).0, || rayon::join(|| arm(0, left), || arm(1, right)));
        let (low, high) = body.zero_body().bounds();
        let measures = BodyMeasures::new(body).ok();
        let height = |name: &str, share: f64| {
            body.joint_place(name).map_or(low[1] + share * (high[1] - low[1]), |p| p[1])
        };
        let levels = match &measures {
            Some(BodyMeasures { landmarks: l, .. }) => {
                Levels { crotch: l.crotch, hip: l.hip, waist: l.waist, armpit: l.armpit }
            }
            // A body that cannot be measured: by its joints, else by usual proportions.
            None => Levels {
                crotch: height("left_hip", 0.53) - 0.1,
                hip: height("left_hip", 0.53),
                waist: height("spine2", 0.63),
                armpit: height("left_shoulder", 0.82) - 0.07,
            },
        };
        // Taut cloth spans it where its outlines are hollow: from the hips to below the armpits, where no column runs into the
        // shoulders.
        let mut form = trunk.clone();
        if let Some(column) = measures.map(|m| m.column) {
            let (bottom, top) = (levels.hip, levels.armpit - 0.02);
            form.unite(|p| if p[1] > bottom && p[1] < top { column.value(p) } else { f64::MAX });
        }
        let spine = ["pelvis", "spine1", "spine2", "spine3"].map(|name| body.joint_place(name));
        let spine: Vec<f64> = spine.into_iter().flatten().map(|p| p[2]).collect();
        let spine_z = spine.iter().sum::<f64>() / spine.len().max(1) as f64;
        let arms = left.into_iter().chain(right).collect();
        let [left, right] = LIMB_ROOTS[1].map(|name| body.joint_place(name));
        let hips = left.zip(right).map(<[_; 2]>::from);
        let (trunk, form, weights) = (trunk.into(), form.into(), [None, None]);
        Self { trunk, form, arms, hips, weights, levels, low, high, spine_z }
    }

    /// The same for limbs that linear blend skinning turned, in this one pose: cloth is turned back to the T-pose by the weights of
    /// the body next to it, and its distance taken there.
    pub fn posed(&self, posed: &LimbPose, body: &Body) -> Self {
        let weights = std::array::from_fn(|limb| {
            let is_turned = posed.angles[limb] != 0.0;
            is_turned.then(|| {
                let weights = limb_weights(body, LIMB_ROOTS[limb]);
                let grid = DistanceGrid::with_attribute(
                    &posed.positions,
                    &body.faces,
                    FIELD_STEP,
                    FIELD_BAND,
                    |face| weights[face],
                );
                Arc::new(grid.1)
            })
        });
        Self { weights, ..self.clone() }
    }

    /// Whether it has the weights of all limbs that a placement turns.
    pub fn is_posed(&self, placement: &Placement) -> bool {
        let angles = [placement.arm_angle_degrees, placement.leg_angle_degrees];
        self.weights.iter().zip(angles).all(|(weights, angle)| weights.is_some() == (angle != 0.0))
    }

    /// Signed distance of `p` to the body as taut cloth sees it (m), outside positive, at most the band of the grids; and the
    /// part of the body that is next to it, below [`BODY_PARTS`].
    pub fn gap(&self, p: [f64; 3], turn: LimbTurn) -> (f64, usize) {
        let arm = self.weights[0].as_ref().map_or(0.0, |grid| grid.distance(p));
        let p = self.legs_together(p, turn.legs);
        let shoulder = self.arms.iter().find(|limb| limb.side == arm.signum()).map(|limb| limb.shoulder);
        let (p, arms) = match (&self.weights[0], shoulder) {
            (Some(_), Some(shoulder)) => (turned_back(p, arm, turn.arms, shoulder), Turn::new(0.0)),
            _ => (p, turn.arms),
        };
        let mut gap = self.form.distance(p);
        let Levels { crotch, waist, armpit, .. } = self.levels;
        let mut part = [crotch, waist, armpit].iter().filter(|level| **level < p[1]).count();
        for arm in self.arms.iter() {
            let raised = arms.undone(p, arm.shoulder, arm.side);
            let distance = arm.distance.distance(raised).min(norm(sub(p, arm.shoulder)) - arm.radius);
            if distance < gap {
                (gap, part) = (distance, BODY_PARTS - 1);
            }
        }
        (gap, part)
    }

    /// A point next to an arm, raised with it to the T-pose; any other one as it is.
    pub fn level(&self, p: [f64; 3], arms: Turn) -> [f64; 3] {
        let nearest = self.arms.iter().map(|arm| {
            let raised = arms.undone(p, arm.shoulder, arm.side);
            (arm.distance.distance(raised), raised)
        });
        let (distance, raised) = nearest.fold((f64::MAX, p), |a, b| if b.0 < a.0 { b } else { a });
        if distance < self.form.distance(p) { raised } else { p }
    }

    fn legs_together(&self, p: [f64; 3], legs: Turn) -> [f64; 3] {
        let (Some(hips), Some(weights)) = (&self.hips, &self.weights[1]) else { return p };
        let weight = weights.distance(p);
        turned_back(p, weight, legs, hips[usize::from(weight < 0.0)])
    }

    /// Whether `p` is at least this deep (m) inside the body.
    pub fn is_inside(&self, p: [f64; 3], turn: LimbTurn, depth: f64) -> bool {
        let p = self.legs_together(p, turn.legs);
        let in_arm = |arm: &Arm| arm.distance.distance(turn.arms.undone(p, arm.shoulder, arm.side)) < -depth;
        self.trunk.distance(p) < -depth || self.arms.iter().any(in_arm)
    }
}

/// Inverse of linear blend skinning by a weight of the left (positive) or right (negative) limb, which turns about `joint`.
fn turned_back(p: [f64; 3], weight: f64, turn: Turn, joint: [f64; 3]) -> [f64; 3] {
    let w = weight.abs();
    // The blend of rest and rotation in the plane of the limbs is a rotation times a scale.
    let (cosine, sine) = (1.0 - w + w * turn.cosine, w * turn.sine);
    let squared = cosine * cosine + sine * sine;
    if squared < 1e-3 {
        return p;
    }
    let blend = Turn { sine: sine / squared, cosine: cosine / squared };
    let mut back = blend.undone(p, joint, weight.signum());
    back[2] = p[2];
    back
}

/// The signed weight that each face of a body has of the left (positive) and right (negative) of two limbs.
fn limb_weights(body: &Body, from: [&str; 2]) -> Vec<f64> {
    let sides = sides(body, from);
    let of_vertex = |v: &u32| {
        let (joints, weights) = body.skin_weights.row(*v as usize);
        let signed = joints.iter().zip(weights).filter_map(|(joint, weight)| {
            sides[usize::from(*joint)].map(|side| [1.0, -1.0][side] * f64::from(*weight))
        });
        signed.sum::<f64>()
    };
    body.faces.iter().map(|face| face.iter().map(of_vertex).sum::<f64>() / 3.0).collect()
}

/// For every joint whether it belongs to the left (0) or right (1) of two limbs, from these joints on.
fn sides(body: &Body, from: [&str; 2]) -> Vec<Option<usize>> {
    let mut sides: Vec<Option<usize>> = Vec::with_capacity(body.joint_count());
    let from = from.map(|name| body.joint(name));
    for joint in 0..body.joint_count() {
        let own = from.iter().position(|s| *s == Some(joint));
        sides.push(own.or(body.parents[joint].and_then(|parent| sides[parent])));
    }
    sides
}

/// Faces with every border closed by a fan around its centroid, and the mean radius of the longest border (m).
fn closed(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> (Vec<[f64; 3]>, Vec<[u32; 3]>, f64) {
    let (used, mut all) = compact(faces.iter().copied(), positions.len());
    let mut used: Vec<[f64; 3]> = used.iter().map(|v| positions[*v as usize]).collect();
    let (mut longest, mut radius) = (0, 0.0);
    let Ok(mesh) = TriMesh::new(used.clone(), all.clone()) else { return (used, all, radius) };
    for border in Topology::new(&mesh).boundary_loops {
        let count = border.len() as f64;
        let sum = border.iter().fold([0.0; 3], |sum, v| add(sum, used[*v as usize]));
        let centre = scale(sum, 1.0 / count);
        if border.len() > longest {
            longest = border.len();
            radius = border.iter().map(|v| norm(sub(used[*v as usize], centre))).sum::<f64>() / count;
        }
        let tip = used.len() as u32;
        used.push(centre);
        all.extend((0..border.len()).map(|i| [border[(i + 1) % border.len()], border[i], tip]));
    }
    (used, all, radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::query::Distance;

    #[test]
    fn distances_agree_with_the_surface_for_level_and_lowered_arms() {
        let body = mannequin();
        let field = BodyField::new(&body);
        for degrees in [0.0, 45.0] {
            let placement = Placement { arm_angle_degrees: degrees, ..Placement::AS_GIVEN };
            let turn = LimbTurn::of(&placement);
            let surface = LimbPose::of(&body, &placement).surface(&body);
            let mut errors: Vec<f64> = (0..3000)
                .map(|i| {
                    let t = [0.754_877_666, 0.569_840_291, 0.438_579_021].map(|s| (s * f64::from(i)).fract());
                    let p = std::array::from_fn(|k| field.low[k] + t[k] * (field.high[k] - field.low[k]));
                    let exact = surface.gap(p, Distance::ClosestPoint).gap;
                    (field.gap(p, turn).0 - exact.min(FIELD_BAND)).abs()
                })
                .collect();
            errors.sort_by(f64::total_cmp);
            assert!(errors[2700] < 0.004, "{degrees}°: 90 % within {}", errors[2700]);
        }
    }

    #[test]
    fn a_turn_is_undone() {
        let turn = Turn::new(33.0);
        let (p, shoulder) = ([0.4, 0.1, 0.3], [0.2, 0.5, 0.0]);
        let there = turn.applied(p, shoulder, -1.0);
        assert!(norm(sub(turn.undone(there, shoulder, -1.0), p)) < 1e-12);
        let hand = turn.applied([0.8, 0.5, 0.0], shoulder, 1.0);
        assert!(hand[1] < 0.5 && hand[0] > 0.2, "a lowered left hand is below the shoulder: {hand:?}");
    }
}
