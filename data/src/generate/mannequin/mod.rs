//! A procedural human body: no download, no licence, the same one everywhere.
//!
//! The surface is the zero level of a smooth solid, polygonised and remeshed; the skin
//! weights are diffused over it from the nearest bones; the shape components are smooth displacement fields
//! that move vertices and joints alike. Everything is deterministic.

mod anatomy;
mod shape;
mod skinning;

use super::field;
use crate::asset::{BODY_JOINT_COUNT, BODY_JOINT_NAMES, BODY_JOINT_PARENTS, Body, BodyParts};
use crate::mesh::{EditableMesh, LabelledTriangles, Lattice, Quality, RemeshTarget, extract, remesh};

pub use shape::SHAPE_COMPONENT_NAMES;

/// Edge length of the mannequin's triangles (m).
const EDGE_LENGTH: f64 = 0.0183;

struct MannequinSkin;

impl RemeshTarget for MannequinSkin {
    fn project(&self, point: [f64; 3], _label: u32) -> [f64; 3] {
        field::project(anatomy::field, point, 2, 0.02)
    }

    fn edge_length(&self, point: [f64; 3]) -> f64 {
        // Hands, feet and face have smaller features than the trunk.
        let hand = field::smooth_step(0.62, 0.70, point[0].abs());
        let foot = field::smooth_step(-0.80, -0.86, point[1]);
        let head = field::smooth_step(0.52, 0.60, point[1]);
        EDGE_LENGTH * (1.0 - 0.35 * hand.max(foot).max(0.6 * head))
    }
}

/// The neutral mannequin: about 1.70 m tall, T-pose, pelvis joint at the origin, y up, facing +z; 22 SMPL joints, a closed
/// genus-0 surface of 5,000–7,000 vertices, and the shape components of [`SHAPE_COMPONENT_NAMES`] made for coefficients
/// in `[−2, 2]`.
pub fn mannequin() -> Body {
    let (positions, faces) = surface();
    let skin_weights = skinning::skin_weights(&positions, &faces);
    let shape_directions = shape::vertex_directions(&positions, &faces, &skin_weights);
    let parts = BodyParts {
        name: "mannequin".to_string(),
        faces: faces.into(),
        template: positions,
        shape_directions,
        shape_count: SHAPE_COMPONENT_NAMES.len(),
        joint_template: anatomy::REST_JOINTS.to_vec(),
        joint_shape_directions: shape::joint_directions(),
        pose_directions: None,
        skin_weights,
        parents: BODY_JOINT_PARENTS.to_vec(),
        joint_names: BODY_JOINT_NAMES.iter().map(|name| name.to_string()).collect(),
    };
    debug_assert_eq!(parts.joint_template.len(), BODY_JOINT_COUNT);
    // Nothing here depends on input: the parts are constants and their consistency is tested.
    Body::new(parts).expect("the built-in mannequin is consistent")
}

fn surface() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let lattice = Lattice::covering([-0.905, -0.965, -0.20], [0.905, 0.815, 0.23], EDGE_LENGTH);
    let values = lattice.sample(anatomy::field);
    let (positions, faces) = extract(&lattice, &values);
    let labels = vec![0; positions.len()];
    let mut sheet = EditableMesh::new(LabelledTriangles { positions, labels, faces });
    let quality = Quality { angle: 22.0, edge_ratio: [0.4, 2.5] };
    remesh(&mut sheet, &MannequinSkin, 5, quality);
    sheet.compact()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::vec3::{cross, dot, norm, sub};
    use clothcombo_physics::{Surface, Topology, TriMesh};

    fn volume(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
        faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|v| positions[v as usize]);
                dot(a, cross(b, c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn is_a_closed_human_sized_surface_of_genus_zero() {
        let body = mannequin();
        let mesh = body.zero_body();
        let topology = Topology::new(&mesh);
        assert!((5000..7000).contains(&mesh.vertex_count()), "{}", mesh.vertex_count());
        assert!(topology.boundary_loops.is_empty() && topology.non_manifold_edges.is_empty());
        assert_eq!((topology.component_count, topology.unreferenced.len()), (1, 0));
        assert_eq!(mesh.vertex_count() + mesh.face_count() - topology.edges.len(), 2);
        let (low, high) = mesh.bounds();
        assert!((1.65..1.75).contains(&(high[1] - low[1])));
        assert!((1.6..1.8).contains(&(high[0] - low[0])));
        // Outward faces and a plausible volume of about 60 litres.
        let litres = 1e3 * volume(mesh.positions(), mesh.faces());
        assert!((50.0..75.0).contains(&litres), "{litres}");
        assert_eq!(body.joint_template[0], [0.0; 3]);
    }

    #[test]
    fn joints_lie_inside_and_legs_and_arms_are_separate() {
        let body = mannequin();
        for joint in &body.joint_template {
            assert!(anatomy::field(*joint) < -0.01, "{joint:?}");
        }
        // Air between the legs, and between arm and trunk.
        for p in [
            [0.0, -0.25, 0.0],
            [0.0, -0.6, 0.0],
            [0.0, -0.92, 0.0],
            [0.30, 0.30, -0.03],
            [-0.30, 0.30, -0.03],
        ] {
            assert!(anatomy::field(p) > 0.004, "{p:?}");
        }
    }

    #[test]
    fn weights_are_few_sum_to_one_and_change_gradually() {
        let body = mannequin();
        let dense = body.skin_weights.to_dense(22);
        let owner =
            |v: usize| (0..22).max_by(|a, b| dense[v * 22 + a].total_cmp(&dense[v * 22 + b])).unwrap();
        let mut owned = [0; 22];
        for v in 0..body.vertex_count() {
            assert!(body.skin_weights.row(v).0.len() <= 4);
            assert!((dense[v * 22..(v + 1) * 22].iter().sum::<f32>() - 1.0).abs() < 1e-5);
            owned[owner(v)] += 1;
        }
        assert!(owned.iter().all(|n| *n > 10), "{owned:?}");
        for [a, b] in Topology::new(&body.zero_body()).edges {
            let row = |v: u32| &dense[v as usize * 22..(v as usize + 1) * 22];
            let jump = row(a).iter().zip(row(b)).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
            assert!(jump < 0.35, "weights jump by {jump} across an edge");
        }
    }

    #[test]
    fn shape_is_linear_keeps_joints_inside_and_does_not_fold() {
        let body = mannequin();
        assert_eq!(body.shape_count, 8);
        let at = |beta: &[f64]| body.shaped(beta).unwrap();
        for k in 0..body.shape_count {
            let unit = |x: f64| {
                let mut beta = vec![0.0; body.shape_count];
                beta[k] = x;
                beta
            };
            let (zero, one, two) = (at(&[]), at(&unit(1.0)), at(&unit(2.0)));
            let all = |s: &crate::asset::ShapedBody| [s.positions.clone(), s.joints.clone()].concat();
            let moved = all(&zero).iter().zip(all(&one)).map(|(a, b)| norm(sub(b, *a))).fold(0.0, f64::max);
            assert!(moved > 0.005, "component {k} moves at most {moved} m");
            for ((a, b), c) in all(&zero).iter().zip(all(&one)).zip(all(&two)) {
                assert!((0..3).all(|i| (a[i] - 2.0 * b[i] + c[i]).abs() < 1e-6));
            }
            for sign in [-2.0, 2.0] {
                assert_sound(&body, &at(&unit(sign)), k);
            }
        }
        // Corners of the cube of coefficients.
        for corner in [0b1010_1010u32, 0b0101_0101, 0b1111_1111, 0, 0b1100_1100] {
            let beta: Vec<f64> = (0..8).map(|k| if corner >> k & 1 == 1 { 2.0 } else { -2.0 }).collect();
            assert_sound(&body, &at(&beta), 99);
        }
    }

    /// Joints inside, limbs apart, and no face turned over.
    fn assert_sound(body: &Body, shaped: &crate::asset::ShapedBody, component: usize) {
        let mesh = TriMesh::new(shaped.positions.clone(), body.faces.to_vec()).unwrap();
        let surface = Surface::<f64>::from_mesh(&mesh);
        for joint in &shaped.joints {
            let gap = surface.gap(*joint, clothcombo_physics::Distance::ClosestPoint).gap;
            assert!(gap < -0.004, "component {component}: joint at {joint:?} has gap {gap}");
        }
        for face in body.faces.iter() {
            let normal = |p: &[[f64; 3]]| {
                let [a, b, c] = face.map(|v| p[v as usize]);
                cross(sub(b, a), sub(c, a))
            };
            let (before, after) = (normal(&body.template), normal(&shaped.positions));
            assert!(
                dot(before, after) > 0.2 * norm(before) * norm(after),
                "component {component} folds a face"
            );
        }
        // Left leg vertices stay left.
        for (p, q) in body.template.iter().zip(&shaped.positions) {
            if p[1] < -0.2 {
                assert!(p[0] * q[0] > 0.0, "component {component}: legs meet at {q:?}");
            }
        }
    }

    #[test]
    fn is_the_same_every_time() {
        let (a, b) = (mannequin(), mannequin());
        assert_eq!(a.template, b.template);
        assert_eq!(a.faces, b.faces);
        assert_eq!(a.skin_weights, b.skin_weights);
    }
}
