use super::*;
use rand::{RngExt, SeedableRng};

/// A random body of `joints` joints in a chain with two branches, off the origin, with all features.
pub(crate) fn random_parts(joints: usize, seed: u64) -> BodyParts {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let (vertices, k) = (40, 3);
    let template = (0..vertices).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
    let rows: Vec<Vec<(u16, f32)>> = (0..vertices)
        .map(|_| (0..3).map(|_| (rng.random_range(0..joints as u16), rng.random_range(0.1..1.0))).collect())
        .collect();
    BodyParts {
        name: "test".into(),
        faces: (0..vertices as u32 - 2).map(|i| [i, i + 1, i + 2]).collect(),
        template,
        shape_directions: (0..vertices * 3 * k).map(|_| rng.random_range(-0.1..0.1)).collect(),
        shape_count: k,
        joint_template: (0..joints).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect(),
        joint_shape_directions: (0..joints * 3 * k).map(|_| rng.random_range(-0.1..0.1)).collect(),
        pose_directions: Some(
            (0..vertices * 27 * (joints - 1)).map(|_| rng.random_range(-0.01..0.01)).collect(),
        ),
        skin_weights: SparseSkinWeights::from_rows(rows),
        parents: (0..joints).map(|j| if j == 0 { None } else { Some((j - 1) / 2) }).collect(),
        joint_names: crate::asset::skeleton::joint_names(joints),
    }
}

fn random_pose(joints: usize, seed: u64) -> Pose {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    Pose { rotations: (0..joints).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect() }
}

fn largest_distance(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.as_flattened().iter().zip(b.as_flattened()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

#[test]
fn the_pelvis_is_at_the_origin_for_every_shape() {
    let body = Body::new(random_parts(7, 1)).unwrap();
    for beta in [&[][..], &[1.0], &[0.5, -2.0, 1.5]] {
        let shaped = body.shaped(beta).unwrap();
        assert!(shaped.joints[0].iter().all(|x| x.abs() < 1e-7));
    }
}

#[test]
fn the_t_pose_is_the_shaped_body_and_the_zero_body_the_template() {
    let body = Body::new(random_parts(7, 2)).unwrap();
    let beta = [0.3, -0.7];
    let posed = body.posed(&beta, &Pose::t_pose(7)).unwrap();
    assert!(largest_distance(&posed.positions, &body.shaped(&beta).unwrap().positions) < 1e-6);
    let zero = body.posed(&[], &Pose::t_pose(3)).unwrap();
    assert!(largest_distance(&zero.positions, &body.template) < 1e-6);
    assert_eq!(body.zero_body().positions(), body.template);
}

#[test]
fn fewer_shape_components_make_the_same_body_without_the_others() {
    let body = Body::new(random_parts(7, 4)).unwrap();
    let first = body.clone().with_shape_components(2);
    assert_eq!((first.shape_count, first.shape_directions.len()), (2, 40 * 3 * 2));
    let pose = random_pose(7, 4);
    let (a, b) = (body.posed(&[0.4, -1.2], &pose).unwrap(), first.posed(&[0.4, -1.2], &pose).unwrap());
    assert_eq!((a.positions, a.joints), (b.positions, b.joints));
    assert_eq!(body.clone().with_shape_components(9).shape_directions, body.shape_directions);
}

#[test]
fn turning_the_root_turns_the_body_rigidly_about_the_pelvis() {
    let body = Body::new(random_parts(7, 3)).unwrap();
    let mut pose = random_pose(7, 4);
    pose.rotations[0] = [0.0; 3];
    let still = body.posed(&[0.5], &pose).unwrap();
    pose.rotations[0] = [0.4, -1.1, 0.7];
    let turned = body.posed(&[0.5], &pose).unwrap();
    let r = matrix_from_axis_angle(pose.rotations[0]);
    let expected: Vec<[f64; 3]> = still.positions.iter().map(|p| rotation::apply(&r, *p)).collect();
    assert!(largest_distance(&turned.positions, &expected) < 1e-6);
    let joints: Vec<[f64; 3]> = still.joints.iter().map(|p| rotation::apply(&r, *p)).collect();
    assert!(largest_distance(&turned.joints, &joints) < 1e-6);
}

/// The textbook formulas with dense matrices, one vertex at a time.
#[test]
fn posing_agrees_with_a_plain_evaluation() {
    let parts = random_parts(7, 5);
    let body = Body::new(parts.clone()).unwrap();
    let (beta, pose) = ([0.2, -0.4, 1.1], random_pose(7, 6));
    let posed = body.posed(&beta, &pose).unwrap();
    let k = parts.shape_count;
    let shaped = |p: &[f64; 3], row: &dyn Fn(usize, usize) -> f64| -> [f64; 3] {
        std::array::from_fn(|a| p[a] + (0..k).map(|c| row(a, c) * beta[c]).sum::<f64>())
    };
    let joints: Vec<[f64; 3]> = (0..7)
        .map(|j| shaped(&parts.joint_template[j], &|a, c| parts.joint_shape_directions[(3 * j + a) * k + c]))
        .collect();
    // World transforms as products of 4×4 matrices down the tree.
    type M4 = [[f64; 4]; 4];
    let product = |a: &M4, b: &M4| -> M4 {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|l| a[i][l] * b[l][j]).sum()))
    };
    let mut world: Vec<M4> = Vec::new();
    for j in 0..7 {
        let r = matrix_from_axis_angle(pose.rotations[j]);
        let parent = parts.parents[j];
        let offset: [f64; 3] = std::array::from_fn(|a| joints[j][a] - parent.map_or(0.0, |p| joints[p][a]));
        let local: M4 = std::array::from_fn(|i| {
            std::array::from_fn(|c| match (i, c) {
                (3, 3) => 1.0,
                (3, _) => 0.0,
                (_, 3) => offset[i],
                _ => r[i][c],
            })
        });
        world.push(parent.map_or(local, |p| product(&world[p], &local)));
    }
    let pose_directions = parts.pose_directions.unwrap();
    for v in 0..parts.template.len() {
        let mut p =
            shaped(&parts.template[v], &|a, c| f64::from(parts.shape_directions[(3 * v + a) * k + c]));
        for j in 1..7 {
            let r = matrix_from_axis_angle(pose.rotations[j]);
            for e in 0..9 {
                let feature = r[e / 3][e % 3] - f64::from(u8::from(e % 4 == 0));
                for a in 0..3 {
                    p[a] += feature * f64::from(pose_directions[(3 * v + a) * 54 + 9 * (j - 1) + e]);
                }
            }
        }
        let (row_joints, weights) = parts.skin_weights.row(v);
        let mut sum = [0.0; 3];
        for (j, w) in row_joints.iter().zip(weights) {
            let j = usize::from(*j);
            for a in 0..3 {
                let moved =
                    (0..3).map(|b| world[j][a][b] * (p[b] - joints[j][b])).sum::<f64>() + world[j][a][3];
                // The pelvis of the shaped body stays where it is; this body has it at the origin.
                sum[a] += f64::from(*w) * (moved - joints[0][a]);
            }
        }
        for a in 0..3 {
            assert!((posed.positions[v][a] - sum[a]).abs() < 2e-6, "vertex {v}");
        }
    }
}

#[test]
fn wrong_parts_are_named() {
    let wrong = |change: &dyn Fn(&mut BodyParts)| {
        let mut parts = random_parts(7, 7);
        change(&mut parts);
        Body::new(parts).unwrap_err().to_string()
    };
    assert!(wrong(&|p| p.shape_count = 4).contains("shape directions"));
    assert!(wrong(&|p| p.template[3][1] = f64::NAN).contains("position 10"));
    assert!(wrong(&|p| p.parents[2] = Some(5)).contains("joint 2"));
    assert!(wrong(&|p| p.parents[2] = None).contains("joint 2"));
    assert!(wrong(&|p| p.skin_weights = SparseSkinWeights::from_dense(&[0.0; 280], 7)).contains("vertex 0"));
    assert!(wrong(&|p| p.faces = vec![[0, 1, 40]].into()).contains("'test'"));
    let body = Body::new(random_parts(7, 8)).unwrap();
    assert!(body.shaped(&[0.0; 4]).unwrap_err().to_string().contains("3 shape components"));
    assert!(body.posed(&[], &Pose::t_pose(8)).unwrap_err().to_string().contains("7 joints"));
}
