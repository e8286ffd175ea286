//! The shipped model dresses bodies with other joints than its own: joints are known by name, what it lacks follows the nearest
//! ancestor.

use clothcombo_data::asset::skeleton::joint_names;
use clothcombo_data::asset::{
    Body, BodyFileSettings, Category, Garment, Pose, Provenance, SparseSkinWeights,
};
use clothcombo_data::generate::GarmentGenerator;
use clothcombo_trainer::inference::{BodyState, Draper, DraperSettings, GivenGarment};
use std::path::{Path, PathBuf};

fn model() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default")
}

/// `body` with the joints of `names`, in their order: weights of the others go to the joint that `heir` names.
fn refolded(body: &Body, names: &[String], heir: impl Fn(&str) -> &'static str) -> Body {
    let old = |name: &str| body.joint_names.iter().position(|n| n == name).unwrap();
    let new = |name: &str| names.iter().position(|n| n == name).unwrap();
    let place = |name: &String| if body.joint_names.contains(name) { old(name) } else { old(heir(name)) };
    let k = body.shape_count;
    let dense = body.skin_weights.to_dense(body.joint_count());
    let mut weights = vec![0.0; body.vertex_count() * names.len()];
    for (row, out) in dense.chunks_exact(body.joint_count()).zip(weights.chunks_exact_mut(names.len())) {
        for (joint, weight) in row.iter().enumerate() {
            let name = &body.joint_names[joint];
            out[new(if names.contains(name) { name } else { heir(name) })] += weight;
        }
    }
    let mut other = body.clone();
    other.joint_template = names.iter().map(|n| body.joint_template[place(n)]).collect();
    other.joint_shape_directions = names
        .iter()
        .flat_map(|n| body.joint_shape_directions[3 * k * place(n)..3 * k * (place(n) + 1)].to_vec())
        .collect();
    other.parents = names
        .iter()
        .map(|n| match body.joint_names.contains(n) {
            true => body.parents[old(n)].map(|p| new(&body.joint_names[p])),
            false => Some(new(if n.starts_with("left") { "left_wrist" } else { "right_wrist" })),
        })
        .collect();
    other.skin_weights = SparseSkinWeights::from_dense(&weights, names.len());
    other.joint_names = names.to_vec();
    other
}

fn hand_or_head(name: &str) -> &'static str {
    match name {
        "left_hand" => "left_middle1",
        "right_hand" => "right_middle1",
        _ if name == "jaw" || name.contains("eye") => "head",
        _ if name.starts_with("left") => "left_hand",
        _ => "right_hand",
    }
}

fn shirt(body: &Body) -> Garment {
    GarmentGenerator::new(body).unwrap().generate(Category::TShirt, 3, 500).unwrap()
}

/// The shirt on a body that bends everywhere, before the post-process.
fn drape(body: Option<&Body>, garment: &Garment) -> Vec<[f64; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("body.npz");
    if let Some(body) = body {
        body.save(&file, &Provenance::default()).unwrap();
    }
    let named = body.map(|_| file.display().to_string());
    let settings = DraperSettings { body: named, resolve: false, ..DraperSettings::default() };
    let draper = Draper::load(Some(&model()), &settings).unwrap();
    let outfit = draper.outfit(vec![GivenGarment::new(garment.clone())]).unwrap();
    let mut pose = Pose::t_pose(22);
    for (joint, rotation) in [
        (3, [0.2, 0.1, 0.0]),
        (16, [0.0, -0.3, -0.9]),
        (17, [0.0, 0.4, 0.7]),
        (18, [0.0, -1.0, 0.0]),
        (1, [-0.5, 0.0, 0.0]),
    ] {
        pose.rotations[joint] = rotation;
    }
    let shape = if draper.body().shape_count > 0 { vec![1.0, -0.5] } else { Vec::new() };
    draper.drape(&outfit, &BodyState::new(shape, pose)).unwrap().garments[0].positions.clone()
}

fn farthest(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    let distance = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
    a.iter().zip(b).map(distance).fold(0.0, f64::max)
}

#[test]
fn bodies_with_fewer_and_with_more_joints_are_dressed_alike() {
    let own = Body::load(&model().join("body.npz"), &BodyFileSettings::default()).unwrap();
    let garment = shirt(&own);
    let expected = drape(None, &garment);
    assert!(farthest(&expected, garment.rest.positions()) > 0.2, "the arms hang");
    // SMPL's joints: all fingers in one joint, no face; and only those of the body, whose hands hang on the wrists.
    let smpl = refolded(&own, &joint_names(24), hand_or_head);
    let body_only = refolded(&own, &joint_names(22), |name| match name {
        _ if name == "jaw" || name.contains("eye") => "head",
        _ if name.starts_with("left") => "left_wrist",
        _ => "right_wrist",
    });
    for (body, joints) in [(&smpl, 24), (&body_only, 22)] {
        assert_eq!(body.joint_count(), joints);
        assert!(farthest(&drape(Some(body), &garment), &expected) < 0.01, "{joints} joints");
    }
    // Joints without weight change nothing.
    let mut names = own.joint_names.clone();
    names.extend(["left_hand", "right_hand"].map(String::from));
    let more = refolded(&own, &names, hand_or_head);
    assert_eq!(more.joint_count(), own.joint_count() + 2);
    assert_eq!(drape(Some(&more), &garment), expected);
}

#[test]
fn a_body_without_shapes_and_one_with_other_shapes_are_dressed() {
    let own = Body::load(&model().join("body.npz"), &BodyFileSettings::default()).unwrap();
    let garment = shirt(&own);
    // The one shape of a body is the mean.
    let rigid = own.clone().with_shape_components(0);
    assert!(drape(Some(&rigid), &garment).iter().flatten().all(|x| x.is_finite()));
    // Shapes of the other sign make other bodies of equal parameters: the networks see those that look alike.
    let mut turned = own.clone();
    turned.shape_directions.iter_mut().for_each(|d| *d = -*d);
    turned.joint_shape_directions.iter_mut().for_each(|d| *d = -*d);
    let on_turned = drape(Some(&turned), &garment);
    assert!(farthest(&on_turned, &drape(None, &garment)) > 0.005);
    assert!(on_turned.iter().flatten().all(|x| x.is_finite()));
}
