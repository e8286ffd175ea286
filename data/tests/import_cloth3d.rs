//! CLOTH3D samples written by `scripts/write_import_fixtures.py` with scipy, on tiny SMPL bodies.

mod fixture;

use clothcombo_data::asset::{BindingSettings, Body, BodyFileSettings, Category, Motion};
use clothcombo_data::folders::load_garment_folder;
use clothcombo_data::format::{MatFile, MatValue, NpzFile};
use clothcombo_data::import::{
    Cloth3dBodies, Cloth3dSettings, ImportError, Summary, Thinning, import_cloth3d,
};
use fixture::{files_in, fixture, no_progress, truncations};
use std::fs;
use std::path::{Path, PathBuf};

fn body(name: &str) -> Body {
    Body::load(&fixture(&format!("cloth3d_bodies/{name}.npz")), &BodyFileSettings::default()).unwrap()
}

fn import(inputs: &[PathBuf], female: &Body, out: &Path, smooth: bool) -> Result<Summary, ImportError> {
    let neutral = body("body_neutral");
    let bodies = Cloth3dBodies { target: &neutral, female: Some(female), male: None };
    let settings = Cloth3dSettings {
        binding: BindingSettings { smooth, ..BindingSettings::default() },
        thinning: Thinning { frame_rate: 30.0, static_threshold: 0.0 },
        ..Cloth3dSettings::default()
    };
    import_cloth3d(inputs, &bodies, out, &settings, &mut no_progress())
}

/// Largest distance of a garment's vertices to where they lie on the zero body (m).
fn deviation(positions: &[[f64; 3]], garment: &str) -> f64 {
    let mut expected = NpzFile::open(&fixture("expected_cloth3d.npz")).unwrap();
    let expected = expected.numbers(garment, "").unwrap();
    assert_eq!(expected.shape, [positions.len(), 3]);
    positions.as_flattened().iter().zip(&expected.data).fold(0.0, |l, (a, b)| f64::max(l, (a - b).abs()))
}

#[test]
fn garments_come_to_the_zero_body_and_poses_become_motions() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path();
    let summary = import(&[fixture("cloth3d")], &body("body_female"), out, false).unwrap();
    let garments = load_garment_folder(&out.join("garments"), &body("body_neutral")).unwrap();
    let names: Vec<&str> = garments.iter().map(|g| g.name.as_str()).collect();
    assert_eq!(names, ["00001_Top", "00001_Trousers", "00002_Trousers"]);
    for g in &garments {
        let name = g.name.split('_').nth(1).unwrap();
        // A vertex lies on a body vertex, so that what remains is the text's 0.1 µm and single precision.
        let deviation = deviation(g.rest.positions(), name);
        assert!(deviation < 2e-6, "{}: {deviation:e}", g.name);
        assert!(g.source.licence.contains("non-commercial"));
        assert_eq!(g.category == Category::Trousers, name == "Trousers");
    }
    // Quads and triangles of the file give the same surface.
    assert_eq!(garments[1].rest.face_count(), 2 * 4 * 6 * 3);

    for (file, reason) in [
        ("Dress.obj", "No such file"),
        ("00002/Top.obj", "Top.obj:2: 'zero' is not a number"),
        ("00003_truncated", "info.mat"),
        ("00004_text", "not a MAT-5 file"),
        ("00005_gender", "gender is 7"),
        ("00006_no_zrot", "no variable 'zrot'"),
        ("00007_poses", "poses has shape [2, 71]"),
        ("00008_outfit", "outfit is numbers of shape [1, 3]"),
        ("00009_nan", "shape holds a non-finite number"),
    ] {
        assert!(
            summary.skipped.iter().any(|(f, r)| f.ends_with(file) && r.contains(reason)),
            "{file}: {summary:#?}"
        );
    }
    assert_eq!(summary.skipped.len(), 9, "{summary:#?}");
    assert!(summary.taken.iter().any(|(name, about)| name == "00001_Top" && about.contains("silk")));
    assert!(
        summary.taken.iter().any(|(name, about)| name == "motion 00001" && about.starts_with("female, "))
    );
    assert!(
        summary.notes.iter().any(|n| n.contains("male samples were unposed with the target body itself"))
    );

    // The poses, y up: the first three numbers are the root's, which only carried the turn to z up.
    assert_eq!(files_in(&out.join("motions")), ["00001.npz", "00002.npz"]);
    let motion = Motion::load(&out.join("motions/00001.npz")).unwrap();
    let poses = NpzFile::open(&fixture("expected_cloth3d.npz")).unwrap().numbers("poses_z_up", "").unwrap();
    assert_eq!((motion.poses.len(), poses.shape[0], motion.frame_rate), (6, 6, 30.0));
    for (pose, row) in motion.poses.iter().zip(poses.data.chunks_exact(72)) {
        assert!(pose.rotations[0].iter().all(|x| x.abs() < 1e-7));
        assert!(
            pose.rotations[1..]
                .as_flattened()
                .iter()
                .zip(&row[3..66])
                .all(|(a, b)| *a == f64::from(*b as f32))
        );
    }
    assert_eq!(Motion::load(&out.join("motions/00002.npz")).unwrap().poses.len(), 1);
}

#[test]
fn smoothed_weights_stay_near_and_the_wrong_body_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let sample = [fixture("cloth3d/00001")];
    let worst = |female: &Body, smooth: bool| -> f64 {
        let out = tempfile::tempdir_in(folder.path()).unwrap();
        import(&sample, female, out.path(), smooth).unwrap();
        let garments = load_garment_folder(&out.path().join("garments"), female).unwrap();
        let each = garments.iter().map(|g| deviation(g.rest.positions(), g.name.split('_').nth(1).unwrap()));
        each.fold(0.0, f64::max)
    };
    assert!(worst(&body("body_female"), true) < 0.03);
    // With the other body the test must see the difference, or it tests nothing.
    assert!(worst(&body("body_neutral"), false) > 1e-3);
}

#[test]
fn bodies_of_two_models_and_folders_without_samples_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let other = Body::load(&fixture("smpl_tiny.npz"), &BodyFileSettings::default()).unwrap();
    let message = import(&[fixture("cloth3d")], &other, folder.path(), true).unwrap_err().to_string();
    assert!(message.contains("'smpl_tiny' is not the same mesh as body 'body_neutral'"), "{message}");
    let female = body("body_female");
    let message = import(&[fixture("amass")], &female, folder.path(), true).unwrap_err().to_string();
    assert!(message.contains("no CLOTH3D sample"), "{message}");
    let message =
        import(&[fixture("cloth3d/00005_gender")], &female, folder.path(), true).unwrap_err().to_string();
    assert!(message.contains("no garment of 1 samples") && message.contains("gender is 7"), "{message}");
    assert!(files_in(folder.path()).is_empty());
}

fn numbers(value: Option<&MatValue>) -> (&[usize], &[f64]) {
    match value {
        Some(MatValue::Numbers(array)) => (&array.shape, &array.data),
        other => panic!("{other:?}"),
    }
}

#[test]
fn nothing_is_written_beside_a_body() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("motions")).unwrap();
    let file = folder.path().join("motions/00001.npz");
    fs::copy(fixture("cloth3d_bodies/body_neutral.npz"), &file).unwrap();
    let neutral = Body::load(&file, &BodyFileSettings::default()).unwrap();
    let bodies = Cloth3dBodies { target: &neutral, female: None, male: None };
    let settings = Cloth3dSettings { body_files: vec![file.clone()], ..Cloth3dSettings::default() };
    let result = import_cloth3d(&[fixture("cloth3d")], &bodies, folder.path(), &settings, &mut no_progress());
    let message = result.unwrap_err().to_string();
    assert!(message.contains("motions would be written over the input"), "{message}");
    assert_eq!(fs::read(&file).unwrap(), fs::read(fixture("cloth3d_bodies/body_neutral.npz")).unwrap());
}

#[test]
fn mat_files_give_every_kind_of_value_scipy_writes() {
    let plain = MatFile::load(&fixture("mat/kinds.mat")).unwrap();
    let compressed = MatFile::load(&fixture("mat/kinds_compressed.mat")).unwrap();
    for file in [&plain, &compressed] {
        assert_eq!(numbers(file.get("matrix")), (&[2, 3][..], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0][..]));
        let (shape, cube) = numbers(file.get("cube"));
        assert_eq!(shape, [2, 3, 4]);
        assert!(cube.iter().enumerate().all(|(i, x)| *x == i as f64));
        assert_eq!(numbers(file.get("scalar")), (&[1, 1][..], &[7.5][..]));
        assert_eq!(numbers(file.get("empty")).0, [0, 3]);
        assert_eq!(numbers(file.get("flag")).1, [1.0]);
        assert_eq!(numbers(file.get("after")).1, [0.5]);
        assert_eq!(numbers(file.get("complex")).1, [1.0]);
        assert_eq!(file.get("text"), Some(&MatValue::Text("Größe".into())));
        assert_eq!(file.get("lines"), Some(&MatValue::Text("one\nthree".into())));
        assert_eq!(file.get("no_text"), Some(&MatValue::Text(String::new())));
        assert_eq!(file.get("sparse"), Some(&MatValue::Other("a sparse matrix")));
        let Some(MatValue::Cell(cells)) = file.get("cells") else { panic!() };
        assert_eq!(numbers(cells.first()).1, [1.0]);
        assert_eq!(cells[1], MatValue::Text("two".into()));
        assert_eq!(numbers(cells.get(2)).0, [2, 0]);
        let nested = file.get("nested").unwrap();
        let deep = nested
            .field("a")
            .and_then(|a| a.field("b"))
            .and_then(|b| b.field("c_with_a_rather_long_field_name"));
        assert_eq!(numbers(deep).1, [-3.0]);
        assert_eq!(numbers(nested.field("list")).1, [1.0, 2.0]);
        let Some(MatValue::Struct(people)) = file.get("people") else { panic!() };
        assert_eq!(people.len(), 2);
        assert_eq!(people[1][0], ("name".into(), MatValue::Text("Alan".into())));
        assert_eq!(numbers(Some(&people[1][1].1)).1, [41.0]);
        for kind in ["int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32"] {
            assert_eq!(numbers(file.get(kind)).1, [1.0, 2.0, 100.0], "{kind}");
        }
    }
    assert_eq!(plain, compressed);
    let message = MatFile::load(&fixture("mat/level4.mat")).unwrap_err().to_string();
    assert!(message.contains("level4.mat") && message.contains("-v7"), "{message}");
}

#[test]
fn damaged_mat_files_are_refused_or_read_but_never_crash() {
    for name in ["mat/kinds.mat", "cloth3d/00001/info.mat"] {
        let path = fixture(name);
        let whole = fs::read(&path).unwrap();
        let variables = MatFile::parse(&whole, &path).unwrap().variables.len();
        for cut in truncations(&path, 200) {
            // A cut between two variables leaves a shorter file that is whole.
            if let Ok(file) = MatFile::load(&cut.path) {
                assert!(file.variables.len() < variables, "{} bytes", cut.length);
            }
        }
        // Every bit of every 7th byte once.
        for at in (0..whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[at] ^= 1 << (at % 8);
            if let Err(e) = MatFile::parse(&bytes, &path) {
                assert!(e.to_string().contains(path.file_name().unwrap().to_str().unwrap()));
            }
        }
    }
}
