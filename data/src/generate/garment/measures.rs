//! What is measured on a body: tubes around trunk, legs and arms, and landmarks.

use super::error::GarmentError;
use super::tube::Tube;
use crate::asset::{BODY_JOINT_COUNT, Body};
use crate::generate::parts::dominant_joints;

/// Heights and widths of the zero body (m).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Landmarks {
    pub ankle: f64,
    pub knee: f64,
    pub crotch: f64,
    pub hip: f64,
    pub waist: f64,
    /// Lowest point of the arm where it leaves the trunk.
    pub armpit: f64,
    pub shoulder: [f64; 3],
    /// Distance from the middle to the wrist joint.
    pub wrist: f64,
    /// Neck joint.
    pub neck: [f64; 3],
    /// Half width of the neck.
    pub neck_width: f64,
}

/// The measures of a body.
#[derive(Debug)]
pub(crate) struct BodyMeasures {
    pub landmarks: Landmarks,
    /// Trunk and both legs together, vertical.
    pub column: Tube,
    /// Left (+x) and right leg, vertical.
    pub legs: [Tube; 2],
    /// Left and right arm, along x.
    pub arms: [Tube; 2],
    /// Height of the shoulders over |x|, in steps of 1 cm.
    shoulder_line: Vec<f64>,
}

/// No vertex of a body is farther from the pelvis (m).
const FARTHEST_VERTEX: f64 = 5.0;

impl BodyMeasures {
    /// Measures the zero body.
    ///
    /// # Errors
    /// [`GarmentError`] if it has no T-pose with the SMPL body joints.
    pub fn new(body: &Body) -> Result<Self, GarmentError> {
        let unsuitable =
            |reason: String| GarmentError(format!("cannot cut garments for body '{}': {reason}", body.name));
        if body.joint_count() < BODY_JOINT_COUNT {
            return Err(unsuitable(format!(
                "it has {} joints; garments are cut by the {BODY_JOINT_COUNT} SMPL body joints",
                body.joint_count()
            )));
        }
        if let Some(vertex) = body.template.iter().position(|p| p.iter().any(|x| x.abs() > FARTHEST_VERTEX)) {
            return Err(unsuitable(format!(
                "vertex {vertex} is more than {FARTHEST_VERTEX} m from its pelvis; is it in metres?"
            )));
        }
        if let Some(reason) = body.implausibility() {
            return Err(unsuitable(reason));
        }
        let joint = &body.joint_template;
        let owner = dominant_joints(body);
        let points = |joints: &[usize]| -> Vec<[f64; 3]> {
            body.template.iter().zip(&owner).filter(|(_, j)| joints.contains(j)).map(|(p, _)| *p).collect()
        };
        let trunk = points(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 13, 14]);
        let range = |joints: [f64; 2], margin: f64| {
            let (low, high) = (joints[0].min(joints[1]), joints[0].max(joints[1]));
            [low - margin, high + margin]
        };
        let ankle = 0.5 * (joint[7][1] + joint[8][1]);
        let neck = joint[12];
        let missing = |part: &str| unsuitable(format!("no vertices follow its {part}"));
        let column = Tube::measure(&trunk, 1, 1.0, [ankle - 0.02, neck[1] - 0.02], true)
            .ok_or_else(|| missing("trunk"))?;
        let leg = |joints: [usize; 3]| {
            Tube::measure(
                &points(&joints),
                1,
                1.0,
                range([joint[joints[2]][1], joint[joints[0]][1]], 0.0),
                false,
            )
            .ok_or_else(|| missing("legs"))
        };
        let arm = |side: f64, joints: [usize; 3]| {
            let ends = [side * joint[joints[0]][0], side * joint[joints[2]][0]];
            Tube::measure(&points(&joints), 0, side, range(ends, 0.02), false).ok_or_else(|| missing("arms"))
        };
        let legs = [leg([1, 4, 7])?, leg([2, 5, 8])?];
        let arms = [arm(1.0, [16, 18, 20])?, arm(-1.0, [17, 19, 21])?];

        let hip = 0.5 * (joint[1][1] + joint[2][1]);
        let knee = 0.5 * (joint[4][1] + joint[5][1]);
        let crotch = body
            .template
            .iter()
            .filter(|p| p[0].abs() < 0.015 && p[1] > knee && p[1] < joint[0][1])
            .map(|p| p[1])
            .fold(hip, f64::min);
        // The waist is the narrowest place between pelvis and chest.
        let [low, high] = [joint[0][1] + 0.06, joint[9][1].min(joint[0][1] + 0.24)];
        let width = |y: f64| column.radius(y, 0.0, 1.0) + column.radius(y, 0.0, -1.0);
        let waist = (0..=20)
            .map(|i| low + (high - low) * f64::from(i) / 20.0)
            .min_by(|a, b| width(*a).total_cmp(&width(*b)))
            .unwrap_or(low);
        let shoulder = [
            0.5 * (joint[16][0] - joint[17][0]),
            0.5 * (joint[16][1] + joint[17][1]),
            0.5 * (joint[16][2] + joint[17][2]),
        ];
        let at = shoulder[0] + 0.04;
        let armpit = arms.iter().map(|a| a.centre(at)[0] - a.radius(at, -1.0, 0.0)).fold(f64::MAX, f64::min);
        let neck_points = points(&[12, 15]);
        let neck_width = neck_points
            .iter()
            .filter(|p| p[1] > neck[1] + 0.02 && p[1] < neck[1] + 0.055)
            .map(|p| p[0].abs())
            .fold(0.03, f64::max)
            .min(0.6 * shoulder[0]);
        let mut shoulder_line: Vec<f64> = vec![f64::MIN; 26];
        for (p, owner) in body.template.iter().zip(&owner) {
            // Not above the base of the neck, where the line would climb to the ears.
            if [9, 12, 13, 14, 16, 17].contains(owner) && p[1] < neck[1] + 0.04 {
                let x = p[0].abs() / 0.01;
                for bin in (x - 1.3).ceil().max(0.0) as usize..=((x + 1.3).floor() as usize).min(25) {
                    shoulder_line[bin] = shoulder_line[bin].max(p[1]);
                }
            }
        }
        for line in &mut shoulder_line {
            *line = line.max(shoulder[1]);
        }
        let landmarks = Landmarks {
            ankle,
            knee,
            crotch,
            hip,
            waist,
            armpit,
            shoulder,
            wrist: 0.5 * (joint[20][0] - joint[21][0]),
            neck,
            neck_width,
        };
        Ok(Self { landmarks, column, legs, arms, shoulder_line })
    }

    /// Height of the top of the shoulders at `|x|`.
    pub fn shoulder_height(&self, x: f64) -> f64 {
        let at = (x.abs() / 0.01).min(24.999);
        let bin = at as usize;
        self.shoulder_line[bin] + at.fract() * (self.shoulder_line[bin + 1] - self.shoulder_line[bin])
    }
}
