//! SMPL-family models in their published layouts, written by `scripts/write_import_fixtures.py`, posed as its independent
//! skinning poses them; and wrong or damaged ones.

mod fixture;

use clothcombo_data::asset::{Body, BodyFileSettings, Pose};
use clothcombo_data::format::NpzFile;
use clothcombo_data::import::import_smpl_family;
use fixture::{fixture, no_progress, truncations};
use std::fs;
use std::path::Path;

const ALL: BodyFileSettings = BodyFileSettings { shape_components: usize::MAX };

/// Largest distance between our posed vertices and the expected ones (m).
fn deviation(body: &Body, name: &str) -> f64 {
    let mut expected = NpzFile::open(&fixture("expected_bodies.npz")).unwrap();
    let mut array = |what: &str| expected.numbers(&format!("{name}_{what}"), "").unwrap();
    let (betas, poses, vertices) = (array("betas"), array("poses"), array("vertices"));
    let (k, j, v) = (betas.shape[1], poses.shape[1], vertices.shape[1]);
    assert_eq!((k, j, v), (body.shape_count, body.joint_count(), body.vertex_count()));
    let mut largest: f64 = 0.0;
    for n in 0..betas.shape[0] {
        let rows = poses.data[n * 3 * j..(n + 1) * 3 * j].chunks_exact(3);
        let pose = Pose { rotations: rows.map(|r| [r[0], r[1], r[2]]).collect() };
        let posed = body.posed(&betas.data[n * k..(n + 1) * k], &pose).unwrap();
        let found = posed.positions.as_flattened().iter();
        largest = found.zip(&vertices.data[n * 3 * v..]).fold(largest, |l, (a, b)| l.max((a - b).abs()));
    }
    largest
}

#[test]
fn every_layout_is_read_and_skinned_as_numpy_does() {
    for name in ["smpl_tiny", "smplh_tiny", "smplx_tiny"] {
        let body = Body::load(&fixture(&format!("{name}.npz")), &ALL).unwrap();
        let deviation = deviation(&body, name);
        assert!(deviation < 2e-7, "{name}: {deviation:e} m");
    }
}

#[test]
fn importing_tells_what_was_left_out_and_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    for (name, shape, correctives) in
        [("smpl_tiny", 10, true), ("smplh_tiny", 16, true), ("smplx_tiny", 10, true)]
    {
        let out = folder.path().join(format!("{name}.npz"));
        let summary =
            import_smpl_family(&fixture(&format!("{name}.npz")), &out, &ALL, &mut no_progress()).unwrap();
        let body = Body::load(&out, &ALL).unwrap();
        assert_eq!((body.shape_count, body.pose_directions.is_some()), (shape, correctives), "{name}");
        assert!(deviation(&body, name) < 5e-7, "{name}: {:e}", deviation(&body, name));
        // Importing the result changes nothing at all.
        let again = folder.path().join(format!("{name}_again.npz"));
        import_smpl_family(&out, &again, &ALL, &mut no_progress()).unwrap();
        let mut files = [&out, &again].map(|path| NpzFile::open(path).unwrap());
        for key in [
            "v_template",
            "shapedirs",
            "weights",
            "J_template",
            "J_shapedirs",
            "posedirs",
            "f",
            "kintree_table",
        ] {
            let [a, b] = files.each_mut().map(|file| file.numbers(key, "").unwrap());
            assert_eq!(a, b, "{name}: {key}");
        }
        if name == "smplx_tiny" {
            for key in ["joint2num", "part2num"] {
                assert!(
                    summary.skipped.iter().any(|(k, why)| k == key && why.contains("never executed")),
                    "{summary:?}"
                );
            }
            assert!(
                summary.skipped.iter().any(|(k, why)| k == "lmk_faces_idx" && why.contains("not needed"))
            );
            assert!(
                summary.notes.iter().any(|n| n.contains("shapedirs 10 to 19 are facial expression")),
                "{summary:?}"
            );
        }
    }
    let out = folder.path().join("few.npz");
    let few = BodyFileSettings { shape_components: 3 };
    let summary = import_smpl_family(&fixture("smplh_tiny.npz"), &out, &few, &mut no_progress()).unwrap();
    assert!(summary.notes.iter().any(|n| n.contains("3 of 16 shape components")), "{summary:?}");
    assert_eq!(Body::load(&out, &ALL).unwrap().shape_count, 3);
}

#[test]
fn wrong_models_are_refused_with_file_and_key_and_leave_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("body.npz");
    for (name, parts) in [
        ("without_v_template", ["'v_template' is missing", "keys present"]),
        ("without_f", ["'f' is missing", "keys present"]),
        ("without_J_regressor", ["'J_regressor' is missing", "keys present"]),
        ("without_weights", ["'weights' is missing", "keys present"]),
        ("without_kintree_table", ["'kintree_table' is missing", "keys present"]),
        ("weights_of_23_joints", ["'weights'", "[12, 24]"]),
        ("weights_sum_to_zero", ["vertex 3", "sum to 0"]),
        ("face_beyond_vertices", ["face 7", "vertex 12"]),
        ("negative_face", ["'f'", "vertex -1"]),
        ("nan_vertex", ["template", "non-finite"]),
        ("parent_after_child", ["joint 2", "parents must come first"]),
        ("pickled_weights", ["'weights'", "pickle"]),
        ("text_weights", ["'weights'", "<U1"]),
        ("complex_weights", ["'weights'", "c8"]),
        ("flat_shapedirs", ["'shapedirs'", "[12, 3, components]"]),
    ] {
        let path = fixture(&format!("wrong/{name}.npz"));
        let message = import_smpl_family(&path, &out, &ALL, &mut no_progress()).unwrap_err().to_string();
        assert!(message.contains(&format!("{name}.npz")) || message.contains(name), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{name}: {message}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_model_is_not_written_over_itself() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("b.npz");
    fs::copy(fixture("smplh_tiny.npz"), &model).unwrap();
    let before = fs::read(&model).unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    for out in ["b.npz", "sub/../b.npz"] {
        let out = folder.path().join(out);
        let message = import_smpl_family(&model, &out, &ALL, &mut no_progress()).unwrap_err().to_string();
        assert!(message.contains("would be written over the input") && message.contains("-o"), "{message}");
    }
    assert_eq!(fs::read(&model).unwrap(), before);
}

#[test]
fn pickles_and_folders_get_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("body.npz");
    let pickle = folder.path().join("SMPL_NEUTRAL.pkl");
    fs::write(&pickle, b"\x80\x02}q\x00.").unwrap();
    let message = import_smpl_family(&pickle, &out, &ALL, &mut no_progress()).unwrap_err().to_string();
    assert!(
        message.contains("scripts/smpl_pickle_to_npz.py") && message.contains("SMPL_NEUTRAL.pkl"),
        "{message}"
    );
    fs::create_dir(folder.path().join("female")).unwrap();
    fs::copy(fixture("smplh_tiny.npz"), folder.path().join("female/model.npz")).unwrap();
    let message = import_smpl_family(folder.path(), &out, &ALL, &mut no_progress()).unwrap_err().to_string();
    assert!(message.contains("female/model.npz"), "{message}");
    let missing = import_smpl_family(Path::new("none.npz"), &out, &ALL, &mut no_progress()).unwrap_err();
    assert!(missing.to_string().contains("none.npz"));
}

#[test]
fn truncated_models_are_refused() {
    for cut in truncations(&fixture("smplx_tiny.npz"), 60) {
        assert!(Body::load(&cut.path, &ALL).is_err(), "{} bytes", cut.length);
    }
}
