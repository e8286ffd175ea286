use super::super::body::tests::random_parts;
use super::*;

#[test]
fn a_body_without_vertices_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.npz");
    let mut npz = NpzWriter::new();
    npz.f32("v_template", &[0, 3], &[]).u32("f", &[0, 3], &[]).f32("shapedirs", &[0, 3, 1], &[]);
    npz.f32("weights", &[0, 2], &[]).u32("kintree_table", &[2, 2], &[u32::MAX, 0, 0, 1]);
    npz.f64("J_regressor", &[2, 0], &[]);
    npz.save(&path).unwrap();
    let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
    assert!(message.contains("none.npz") && message.contains("v_template"), "{message}");
}

#[test]
fn what_is_saved_loads_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.npz");
    let body = Body::new(random_parts(7, 1)).unwrap();
    body.save(&path, &Provenance::default()).unwrap();
    let loaded = Body::load(&path, &BodyFileSettings::default()).unwrap();
    assert_eq!(loaded.faces, body.faces);
    assert_eq!(loaded.shape_directions, body.shape_directions);
    assert_eq!(loaded.joint_template, body.joint_template);
    assert_eq!(loaded.joint_shape_directions, body.joint_shape_directions);
    assert_eq!(loaded.pose_directions, body.pose_directions);
    assert_eq!((&loaded.parents, &loaded.joint_names), (&body.parents, &body.joint_names));
    for (a, b) in loaded.template.iter().flatten().zip(body.template.iter().flatten()) {
        assert!((a - b).abs() < 1e-7);
    }
    let few = Body::load(&path, &BodyFileSettings { shape_components: 2 }).unwrap();
    assert_eq!(few.shape_count, 2);
    assert_eq!(few.shape_directions[2..4], [body.shape_directions[3], body.shape_directions[4]]);
}

#[test]
fn joints_in_another_order_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.npz");
    let mut body = crate::generate::mannequin();
    body.joint_names.swap(4, 5);
    body.save(&path, &Provenance::default()).unwrap();
    let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
    assert!(message.contains("body.npz") && message.contains("joint 5 is 'left_knee'"), "{message}");
}

/// The layout the SMPL family ships: unsigned tree with 2³² − 1 at the root, dense weights, a joint regressor.
#[test]
fn joints_come_from_the_regressor_and_a_missing_key_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("smpl.npz");
    let template = [0.0f32, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0];
    let directions = [1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let write = |leave_out: &str| {
        let mut npz = NpzWriter::new();
        if leave_out != "v_template" {
            npz.f32("v_template", &[3, 3], &template);
        }
        npz.u32("f", &[1, 3], &[0, 1, 2]).f32("shapedirs", &[3, 3, 1], &directions);
        if leave_out != "weights" {
            npz.f32("weights", &[3, 2], &[1.0, 0.0, 0.5, 0.5, 0.0, 1.0]);
        }
        npz.u32("kintree_table", &[2, 2], &[u32::MAX, 0, 0, 1]);
        if leave_out != "J_regressor" {
            npz.f64("J_regressor", &[2, 3], &[0.5, 0.5, 0.0, 0.0, 0.5, 0.5]);
        }
        npz.save(&path).unwrap();
    };
    write("");
    let body = Body::load(&path, &BodyFileSettings::default()).unwrap();
    // Regressed joints are (1, 0, 0) and (1, 1, 0); then the pelvis goes to the origin.
    assert_eq!(body.joint_template, [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(body.template[0], [-1.0, 0.0, 0.0]);
    // The second joint's direction (0, .5, .5) less the pelvis' (.5, .5, 0).
    assert_eq!(body.joint_shape_directions[3..], [-0.5, 0.0, 0.5]);
    assert_eq!(body.parents, [None, Some(0)]);
    for key in ["v_template", "weights", "J_regressor"] {
        write(key);
        let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
        assert!(message.contains("smpl.npz") && message.contains(&format!("'{key}'")), "{message}");
        assert!(message.contains("SMPL") && message.contains("shapedirs"), "{message}");
    }
}

#[test]
fn a_rigged_body_without_shape_space_is_read_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rigged.npz");
    let own = crate::generate::mannequin();
    own.save(&path, &Provenance::default()).unwrap();
    let with_shapes = std::fs::read(&path).unwrap();
    let without = own.with_shape_components(0);
    without.save(&path, &Provenance::default()).unwrap();
    assert_ne!(std::fs::read(&path).unwrap(), with_shapes);
    let empty = Body::load(&path, &BodyFileSettings::default()).unwrap();
    // The same without the arrays: a template with joints, or a regressor.
    let (v, j) = (empty.vertex_count(), empty.joint_count());
    let parents = empty.parents.iter().map(|p| p.map_or(-1, |p| p as i64)).chain(0..j as i64);
    let template: Vec<f32> = empty.template.as_flattened().iter().map(|x| *x as f32).collect();
    for has_regressor in [false, true] {
        let mut npz = NpzWriter::new();
        npz.f32("v_template", &[v, 3], &template)
            .u32("f", &[empty.faces.len(), 3], empty.faces.as_flattened())
            .f32("weights", &[v, j], &empty.skin_weights.to_dense(j))
            .i64("kintree_table", &[2, j], &parents.clone().collect::<Vec<_>>());
        match has_regressor {
            true => npz.f64("J_regressor", &[j, v], &vec![1.0 / v as f64; j * v]),
            false => npz.f64("J_template", &[j, 3], empty.joint_template.as_flattened()),
        };
        npz.save(&path).unwrap();
        let body = Body::load(&path, &BodyFileSettings::default()).unwrap();
        assert_eq!((body.shape_count, body.joint_count(), body.vertex_count()), (0, j, v));
        assert!(body.posed(&[], &crate::asset::Pose::t_pose(22)).is_ok());
        let message = body.shaped(&[1.0]).unwrap_err().to_string();
        assert!(message.contains("0 shape components"), "{message}");
        if !has_regressor {
            assert_eq!(body.joint_template, empty.joint_template);
        }
    }
}

#[test]
fn a_pickle_is_not_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("SMPL_NEUTRAL.pkl");
    std::fs::write(&path, b"\x80\x02}q\x00.").unwrap();
    let message = Body::load(&path, &BodyFileSettings::default()).unwrap_err().to_string();
    assert!(message.contains("SMPL_NEUTRAL.pkl") && message.contains("Python pickle"), "{message}");
    let missing = Body::load(&folder.path().join("none.npz"), &BodyFileSettings::default()).unwrap_err();
    assert!(missing.to_string().contains("none.npz"));
}

/// Writes a closed tetrahedron of two joints, with these faces and parents.
fn write_tetrahedron(path: &Path, faces: [[f64; 3]; 4], parents: [f64; 2]) {
    let mut npz = NpzWriter::new();
    npz.f32("v_template", &[4, 3], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        .f64("f", &[4, 3], faces.as_flattened())
        .f32("shapedirs", &[4, 3, 0], &[])
        .f32("weights", &[4, 2], &[1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0])
        .f64("kintree_table", &[2, 2], &[parents[0], parents[1], 0.0, 1.0])
        .f64("J_regressor", &[2, 4], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    npz.save(path).unwrap();
}

const OUTWARDS: [[f64; 3]; 4] = [[0.0, 2.0, 1.0], [0.0, 1.0, 3.0], [0.0, 3.0, 2.0], [1.0, 2.0, 3.0]];

#[test]
fn fractions_name_no_vertex_and_no_joint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.npz");
    let load = |faces, parents| {
        write_tetrahedron(&path, faces, parents);
        Body::load(&path, &BodyFileSettings::default()).map_err(|e| e.to_string())
    };
    let body = load(OUTWARDS, [-1.0, 0.0]).unwrap();
    assert_eq!(body.parents, [None, Some(0)]);
    let mut faces = OUTWARDS;
    faces[2][1] = 2.5;
    let message = load(faces, [-1.0, 0.0]).unwrap_err();
    assert!(message.contains("half.npz: key 'f', corner 1 of face 2 is 2.5"), "{message}");
    for parent in [0.7, f64::NAN] {
        let message = load(OUTWARDS, [-1.0, parent]).unwrap_err();
        assert!(
            message.contains(&format!("'kintree_table', the parent of joint 1 is {parent}")),
            "{message}"
        );
    }
}

#[test]
fn a_body_that_is_inside_out_is_turned() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.npz");
    let load = |faces| {
        write_tetrahedron(&path, faces, [-1.0, 0.0]);
        Body::read_turned(NpzFile::open(&path).unwrap(), &BodyFileSettings::default()).unwrap()
    };
    let (body, was_inside_out) = load(OUTWARDS);
    assert!(!was_inside_out && !is_inside_out(&body.zero_body()));
    let (turned, was_inside_out) = load(OUTWARDS.map(|[a, b, c]| [a, c, b]));
    assert!(was_inside_out && turned.faces == body.faces);
    assert_eq!(turned.zero_body().faces(), &*body.faces);
    assert_eq!(turned.template, body.template);
}
