//! How far the parts of a posed body run through each other.
//!
//! Retargeted motion and mixed limbs put hands into thighs and forearms into the belly; no garment can be draped there.
//! Linear blend skinning also folds the skin at every elbow and armpit, which says nothing about the pose, so only
//! parts at least three joints apart are looked at: a forearm and the trunk, a hand and a thigh, a knee and the other
//! knee.

use crate::asset::{BODY_JOINT_COUNT, Body, BodyError, Pose};
use crate::generate::parts::dominant_joints;
use crate::mesh::{bounds, compact};
use clothcombo_physics::contact::{TriangleTree, intersection_segment};
use clothcombo_physics::vec3::{norm, sub};

/// Joints between two parts, from which on they should not touch: upper arm and chest, or the thighs, always may.
const JOINTS_APART: usize = 3;

/// Measures self-intersections of one body in any pose.
#[derive(Debug, Clone)]
pub struct SelfContact {
    /// Faces by body joint.
    parts: Vec<JointFaces>,
    /// Pairs of parts that are far enough apart on the skeleton.
    pairs: Vec<[usize; 2]>,
    /// What the body crosses itself at rest (m).
    rest: f64,
}

/// The faces that follow one joint.
#[derive(Debug, Clone, Default)]
struct JointFaces {
    /// Vertices of the body.
    vertices: Vec<u32>,
    /// Faces over `vertices`.
    faces: Vec<[u32; 3]>,
}

impl SelfContact {
    /// Cuts the body into the parts that follow its joints; fingers, jaw and eyes belong to hand and head.
    pub fn new(body: &Body) -> Self {
        let owner = dominant_joints(body);
        let count = body.joint_count().min(BODY_JOINT_COUNT);
        let parts: Vec<JointFaces> = (0..count)
            .map(|joint| {
                let faces = body.faces.iter().copied().filter(|face| owner[face[0] as usize] == joint);
                let (vertices, faces) = compact(faces, body.vertex_count());
                JointFaces { vertices, faces }
            })
            .collect();
        let distance = joint_distances(&body.parents, count);
        let pairs = (0..count)
            .flat_map(|a| (a + 1..count).map(move |b| [a, b]))
            .filter(|[a, b]| distance[*a][*b] >= JOINTS_APART)
            .filter(|pair| pair.iter().all(|p| !parts[*p].faces.is_empty()))
            .collect();
        let mut contact = Self { parts, pairs, rest: 0.0 };
        contact.rest = contact.contour_length(&body.template);
        contact
    }

    /// Length (m) of the curves in which far-apart parts of the body run through each other at `positions` (its vertices),
    /// beyond what they do at rest. Triangles are tested exactly; 0 if nothing touches. Does not depend on how fine the
    /// body's mesh is: a hand through a thigh is about 0.3 m, a forearm through the trunk 0.5 m.
    pub fn contour_length(&self, positions: &[[f64; 3]]) -> f64 {
        let bounds: Vec<[[f64; 3]; 2]> = (self.parts.iter())
            .map(|part| bounds(part.vertices.iter().map(|v| &positions[*v as usize])))
            .collect();
        let close: Vec<[usize; 2]> = (self.pairs.iter().copied())
            .filter(|[a, b]| {
                (0..3).all(|x| bounds[*a][0][x] <= bounds[*b][1][x] && bounds[*b][0][x] <= bounds[*a][1][x])
            })
            .collect();
        let mut wanted = vec![false; self.parts.len()];
        close.iter().flatten().for_each(|p| wanted[*p] = true);
        let corners: Vec<Vec<[f64; 3]>> = (self.parts.iter().zip(&wanted))
            .map(|(part, wanted)| {
                let used: &[u32] = if *wanted { &part.vertices } else { &[] };
                used.iter().map(|v| positions[*v as usize]).collect()
            })
            .collect();
        let trees: Vec<Option<TriangleTree>> = (self.parts.iter().zip(&corners).zip(&wanted))
            .map(|((part, corners), wanted)| wanted.then(|| TriangleTree::new(corners, &part.faces)))
            .collect();
        let triangle =
            |part: usize, f: u32| self.parts[part].faces[f as usize].map(|v| corners[part][v as usize]);
        let mut length = 0.0;
        for [a, b] in close {
            let (Some(one), Some(other)) = (&trees[a], &trees[b]) else { continue };
            for (f, g) in one.pairs_with(other) {
                if let Some([p, q]) = intersection_segment(&triangle(a, f), &triangle(b, g)) {
                    length += norm(sub(p, q));
                }
            }
        }
        (length - self.rest).max(0.0)
    }

    /// [`Self::contour_length`] of `body` (the one given to [`Self::new`]) of mean shape in `pose`; joints past the body's
    /// are left out.
    ///
    /// # Errors
    /// As [`Body::posed`].
    pub fn of_pose(&self, body: &Body, pose: &Pose) -> Result<f64, BodyError> {
        let known = pose.rotations.len().min(body.joint_count());
        let pose = Pose { rotations: pose.rotations[..known].to_vec() };
        Ok(self.contour_length(&body.posed(&[], &pose)?.positions))
    }
}

/// Number of bones between every two of the first `count` joints.
fn joint_distances(parents: &[Option<usize>], count: usize) -> Vec<Vec<usize>> {
    let path = |mut joint: usize| {
        let mut path = vec![joint];
        while let Some(parent) = parents[joint] {
            joint = parent;
            path.push(joint);
        }
        path
    };
    let paths: Vec<Vec<usize>> = (0..count).map(path).collect();
    let between = |a: &Vec<usize>, b: &Vec<usize>| {
        // The first common ancestor; parents come first, so one exists.
        let up = a.iter().position(|joint| b.contains(joint)).unwrap_or(a.len() - 1);
        let down = b.iter().position(|joint| *joint == a[up]).unwrap_or(0);
        up + down
    };
    paths.iter().map(|a| paths.iter().map(|b| between(a, b)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::contact::self_triangle_pairs;

    fn with(rotations: &[(usize, [f64; 3])]) -> Pose {
        let mut pose = Pose::t_pose(BODY_JOINT_COUNT);
        for (joint, degrees) in rotations {
            pose.rotations[*joint] = degrees.map(f64::to_radians);
        }
        pose
    }

    #[test]
    fn bones_are_counted_along_the_skeleton() {
        let body = mannequin();
        let distance = joint_distances(&body.parents, BODY_JOINT_COUNT);
        assert_eq!((distance[1][2], distance[16][9], distance[18][0], distance[20][21]), (2, 2, 6, 8));
        for a in 0..BODY_JOINT_COUNT {
            assert_eq!(distance[a][a], 0);
            assert!((0..BODY_JOINT_COUNT).all(|b| distance[a][b] == distance[b][a]));
        }
    }

    #[test]
    fn arms_in_the_air_are_clear_and_arms_through_the_trunk_are_not() {
        let body = mannequin();
        let contact = SelfContact::new(&body);
        let measure = |pose: &Pose| contact.of_pose(&body, pose).unwrap();
        assert_eq!(measure(&Pose::t_pose(BODY_JOINT_COUNT)), 0.0);
        assert_eq!(measure(&with(&[(16, [0.0, 0.0, 60.0]), (4, [60.0, 0.0, 0.0])])), 0.0);
        // A bent elbow folds its skin, which is no matter of the pose.
        assert_eq!(measure(&with(&[(18, [0.0, -130.0, 0.0])])), 0.0);
        // The left arm down and turned across the body: forearm and hand run through the trunk.
        let through = with(&[(16, [0.0, 0.0, -100.0])]);
        let length = measure(&through);
        assert!(length > 0.2, "{length}");
        // The same for the mirror image, and the exact test of the whole body sees it as well.
        assert!((measure(&through.mirrored()) - length).abs() < 0.2 * length);
        let posed = body.posed(&[], &through).unwrap().positions;
        let pairs = self_triangle_pairs(&posed, &body.faces).len();
        assert!(pairs > self_triangle_pairs(&body.template, &body.faces).len() + 20, "{pairs}");
    }

    #[test]
    fn deeper_crossing_knees_make_longer_curves() {
        let body = mannequin();
        let contact = SelfContact::new(&body);
        let crossing = |angle: f64| {
            let pose = with(&[(1, [0.0, 0.0, -angle]), (2, [0.0, 0.0, angle])]);
            contact.of_pose(&body, &pose).unwrap()
        };
        assert_eq!(crossing(-10.0), 0.0);
        assert!(crossing(14.0) > 0.1, "{}", crossing(14.0));
    }
}
