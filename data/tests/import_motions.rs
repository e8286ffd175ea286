//! AMASS, DeepMimic and Acclaim motions written by `scripts/write_import_fixtures.py`, and what it expects of them.

mod fixture;

use clothcombo_data::asset::rotation::matrix_from_axis_angle;
use clothcombo_data::asset::{Body, Motion, Pose};
use clothcombo_data::folders::load_motion_folder;
use clothcombo_data::format::NpzFile;
use clothcombo_data::generate::mannequin;
use clothcombo_data::import::{
    AmassSettings, AmcSettings, RetargetSettings, Summary, Thinning, WorldUp, import_amass, import_amc,
    import_deepmimic,
};
use fixture::{files_in, fixture, no_progress, truncations};
use std::fs;
use std::path::Path;

fn every_frame() -> Thinning {
    Thinning { frame_rate: 1e4, static_threshold: 0.0 }
}

fn amass(out: &Path, thinning: Thinning) -> Summary {
    let settings = AmassSettings { thinning, up: Some(WorldUp::Z), rate: None };
    import_amass(&[fixture("amass")], out, &settings, &mut no_progress()).unwrap()
}

/// Body joints to the precision of the file (f32), the root as a rotation.
fn assert_expected(motion: &Motion, name: &str) {
    let mut expected = NpzFile::open(&fixture("expected_amass.npz")).unwrap();
    let body = expected.numbers(&format!("{name}_body"), "").unwrap();
    let root = expected.numbers(&format!("{name}_root"), "").unwrap();
    assert_eq!(motion.poses.len(), body.shape[0], "{name}");
    for (frame, Pose { rotations }) in motion.poses.iter().enumerate() {
        let row = &body.data[63 * frame..63 * (frame + 1)];
        let joints = rotations[1..].as_flattened();
        assert!(joints.iter().zip(row).all(|(a, b)| *a == f64::from(*b as f32)), "{name}, frame {frame}");
        let matrix = matrix_from_axis_angle(rotations[0]);
        let expected = &root.data[9 * frame..9 * (frame + 1)];
        let close = matrix.as_flattened().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(close, "{name}, frame {frame}: {matrix:?} {expected:?}");
        // Every clip stands.
        assert!(matrix[1][1] > 0.8, "{name}, frame {frame}");
    }
}

#[test]
fn both_layouts_are_found_in_nested_folders_and_stand_up() {
    let folder = tempfile::tempdir().unwrap();
    let summary = amass(folder.path(), every_frame());
    let clips = ["ACCAD_s1_walk", "CMU_01_jump", "CMU_02_jump"];
    assert_eq!(summary.taken.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), clips);
    assert_eq!(files_in(folder.path()), clips.map(|clip| format!("{clip}.npz")));
    let motions = load_motion_folder(folder.path()).unwrap();
    for (motion, (name, rate)) in
        motions.iter().zip([("walk_all", 120.00004577636719), ("", 60.0), ("second", 30.0)])
    {
        assert_eq!(motion.frame_rate, rate);
        assert!(motion.source.licence.contains("non-commercial"), "{:?}", motion.source);
        if !name.is_empty() {
            assert_expected(motion, name);
        }
    }
    // Gender as text, as bytes, and as Python prints bytes.
    let about: Vec<&str> = summary.taken.iter().map(|(_, about)| about.as_str()).collect();
    assert_eq!(
        about,
        [
            "SMPL-H (poses, 52 joints), 14 frames at 120 frames/s, female",
            "SMPL-X (poses, 55 joints), 9 frames at 60 frames/s, male; not read, Python pickles: markers_latent_vids",
            "SMPL-H (poses, 52 joints), 4 frames at 30 frames/s, female",
        ]
    );

    // Everything else is skipped with its reason.
    for (file, reason) in [
        ("shape.npz", "no key 'poses', only betas, gender"),
        ("male_stagei.npz", "no key 'poses'"),
        ("pickled_poses.npz", "pickle"),
        ("narrow_poses.npz", "[2, 63]"),
        ("rateless_poses.npz", "mocap_framerate"),
        ("stopped_poses.npz", "expected 0.01 to 10000"),
        ("nan_poses.npz", "frame 1, joint 3"),
        ("empty_poses.npz", "no frames"),
        ("junk_poses.npz", "not an npz archive"),
    ] {
        assert!(
            summary.skipped.iter().any(|(f, r)| f.ends_with(file) && r.contains(reason)),
            "{file}: {summary:?}"
        );
    }
    assert_eq!(summary.skipped.len(), 9);
}

#[test]
fn the_up_axis_is_that_along_which_usable_motions_stand() {
    let folder = tempfile::tempdir().unwrap();
    let settings = AmassSettings { thinning: every_frame(), ..AmassSettings::default() };
    let summary = import_amass(&[fixture("amass")], folder.path(), &settings, &mut no_progress()).unwrap();
    assert_eq!(summary.taken.len(), 3, "{summary:?}");
    assert!(summary.notes.iter().any(|note| note.contains("z is up, as the bodies stand")), "{summary:?}");
    assert_expected(&Motion::load(&folder.path().join("ACCAD_s1_walk.npz")).unwrap(), "walk_all");
}

#[test]
fn the_rate_is_reduced_and_standing_still_dropped() {
    let folder = tempfile::tempdir().unwrap();
    // At 30 frames/s, frames 0, 4, 8 and 12 remain; 8 is the same as 4.
    let summary = amass(folder.path(), AmassSettings::default().thinning);
    let walk = Motion::load(&folder.path().join("ACCAD_s1_walk.npz")).unwrap();
    assert_expected(&walk, "walk_every_4");
    assert!((walk.frame_rate - 30.0).abs() < 1e-4);
    assert!(
        summary.taken[0].1.contains("3 of 14 frames") && summary.taken[0].1.contains("1 static"),
        "{summary:?}"
    );
    assert_expected(&Motion::load(&folder.path().join("CMU_01_jump.npz")).unwrap(), "jump_every_2");
}

#[test]
fn a_wrong_up_axis_is_noticed_and_the_right_one_believed() {
    let folder = tempfile::tempdir().unwrap();
    let settings = AmassSettings { thinning: every_frame(), up: Some(WorldUp::Y), rate: None };
    let files = [fixture("amass/CMU/02/jump_poses.npz")];
    let summary = import_amass(&files, folder.path(), &settings, &mut no_progress()).unwrap();
    assert!(summary.taken[0].1.contains("check the up axis"), "{summary:?}");
    // Importing our own y-up motions as if they were z up is reported.
    let y_up = folder.path().join("y_up.npz");
    let mut standing = Motion::load(&folder.path().join("jump.npz")).unwrap();
    standing.poses.iter_mut().for_each(|p| p.rotations[0] = [0.0, 0.3, 0.0]);
    standing.save(&y_up).unwrap();
    let settings = AmassSettings { thinning: every_frame(), up: Some(WorldUp::Z), rate: None };
    let summary = import_amass(&[y_up], &folder.path().join("out"), &settings, &mut no_progress()).unwrap();
    assert!(summary.taken[0].1.contains("check the up axis"), "{summary:?}");
}

#[test]
fn motions_are_not_written_over_themselves() {
    let folder = tempfile::tempdir().unwrap();
    let clip = folder.path().join("jump.npz");
    fs::copy(fixture("amass/CMU/02/jump_poses.npz"), &clip).unwrap();
    let before = fs::read(&clip).unwrap();
    let again = folder.path().join("out/..");
    fs::create_dir(folder.path().join("out")).unwrap();
    for out in [folder.path(), &again] {
        let inputs = [folder.path().to_path_buf()];
        let result = import_amass(&inputs, out, &AmassSettings::default(), &mut no_progress());
        let message = result.unwrap_err().to_string();
        assert!(message.contains("jump.npz would be written over the input"), "{message}");
    }
    assert_eq!(fs::read(&clip).unwrap(), before);
    assert_eq!(files_in(folder.path()), ["jump.npz", "out"]);
}

#[test]
fn what_was_imported_before_is_no_input() {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(fixture("amass/CMU/02/jump_poses.npz"), folder.path().join("jump.npz")).unwrap();
    let out = folder.path().join("converted");
    for _ in 0..2 {
        let settings = AmassSettings { thinning: every_frame(), ..AmassSettings::default() };
        let inputs = [folder.path().to_path_buf()];
        let summary = import_amass(&inputs, &out, &settings, &mut no_progress()).unwrap();
        assert_eq!(summary.taken.len(), 1, "{summary:?}");
    }
    assert_eq!(files_in(&out), ["jump.npz"]);
}

#[test]
fn no_motion_takes_the_place_of_the_body() {
    let folder = tempfile::tempdir().unwrap();
    let body_file = folder.path().join("humanoid3d_random.npz");
    fs::write(&body_file, "the only copy").unwrap();
    let settings = RetargetSettings { body_file: Some(body_file.clone()), ..RetargetSettings::default() };
    let clip = [fixture("deepmimic/humanoid3d_random.txt")];
    let result = import_deepmimic(&clip, &mannequin(), folder.path(), &settings, &mut no_progress());
    let message = result.unwrap_err().to_string();
    assert!(message.contains("humanoid3d_random.npz would be written over the input"), "{message}");
    assert_eq!(fs::read(&body_file).unwrap(), b"the only copy");
}

#[test]
fn rates_that_no_motion_may_have_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    // 60 frames/s, of which every millionth frame is asked for.
    let slow = AmassSettings {
        thinning: Thinning { frame_rate: 1e-9, static_threshold: 0.0 },
        ..AmassSettings::default()
    };
    let files = [fixture("amass/CMU/02/jump_poses.npz")];
    let message = import_amass(&files, folder.path(), &slow, &mut no_progress()).unwrap_err().to_string();
    assert!(message.contains("expected 0.01 to 10000"), "{message}");
    assert!(files_in(folder.path()).is_empty());
}

#[test]
fn truncated_and_absent_motions_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for cut in truncations(&fixture("amass/CMU/01/jump_stageii.npz"), 40) {
        let result = import_amass(&[cut.path], folder.path(), &AmassSettings::default(), &mut no_progress());
        let message = result.unwrap_err().to_string();
        assert!(message.contains("jump_stageii.npz"), "{} bytes: {message}", cut.length);
    }
    assert!(files_in(folder.path()).is_empty());
    let empty = tempfile::tempdir().unwrap();
    for input in [empty.path().to_path_buf(), empty.path().join("nowhere")] {
        let result = import_amass(
            std::slice::from_ref(&input),
            folder.path(),
            &AmassSettings::default(),
            &mut no_progress(),
        );
        assert!(result.unwrap_err().to_string().contains(&input.display().to_string()));
    }
}

#[test]
fn deepmimic_limbs_point_where_the_character_points_them() {
    let folder = tempfile::tempdir().unwrap();
    let body = mannequin();
    let files = ["humanoid3d_random.txt", "dog.txt", "cut.txt"].map(|f| fixture("deepmimic").join(f));
    let settings = RetargetSettings { thinning: every_frame(), ..RetargetSettings::default() };
    let summary = import_deepmimic(&files, &body, folder.path(), &settings, &mut no_progress()).unwrap();
    let skipped: Vec<&str> = summary.skipped.iter().map(|(_, reason)| reason.as_str()).collect();
    assert!(skipped[0].contains("frame 0 has 8 numbers") && skipped[1].contains("EOF"), "{skipped:?}");
    let motion = Motion::load(&folder.path().join("humanoid3d_random.npz")).unwrap();
    assert!((motion.frame_rate - 30.0).abs() < 0.01);
    assert_limbs_point(&motion, &body, "expected_deepmimic.npz");
}

#[test]
fn acclaim_limbs_point_where_the_actor_points_them() {
    let folder = tempfile::tempdir().unwrap();
    let body = mannequin();
    let settings = AmcSettings {
        retarget: RetargetSettings { thinning: every_frame(), ..RetargetSettings::default() },
        rate: 120.0,
        skeleton: None,
    };
    let subjects = [fixture("acclaim")];
    let summary = import_amc(&subjects, &body, folder.path(), &settings, None, &mut no_progress()).unwrap();
    assert!(summary.taken[0].1.contains("22 of 22 body joints in a rig of 27"), "{summary:?}");
    let motion = Motion::load(&folder.path().join("07_01.npz")).unwrap();
    assert_eq!((motion.frame_rate, motion.poses.len()), (120.0, 5));
    assert_limbs_point(&motion, &body, "expected_acclaim.npz");
}

/// Left thigh, shank, upper arm and forearm, then the right ones, have the expected directions in every frame.
fn assert_limbs_point(motion: &Motion, body: &Body, expected: &str) {
    let expected = NpzFile::open(&fixture(expected)).unwrap().numbers("bones", "").unwrap();
    const BONES: [(usize, usize); 8] =
        [(1, 4), (4, 7), (16, 18), (18, 20), (2, 5), (5, 8), (17, 19), (19, 21)];
    assert_eq!(expected.shape, [motion.poses.len(), BONES.len(), 3]);
    for (frame, pose) in motion.poses.iter().enumerate() {
        let joints = body.posed(&[], pose).unwrap().joints;
        for (n, (from, to)) in BONES.into_iter().enumerate() {
            let bone: [f64; 3] = std::array::from_fn(|a| joints[to][a] - joints[from][a]);
            let length = bone.iter().map(|x| x * x).sum::<f64>().sqrt();
            let wanted = &expected.data[3 * (BONES.len() * frame + n)..][..3];
            let close = bone.iter().zip(wanted).all(|(a, b)| (a / length - b).abs() < 1e-5);
            assert!(close, "frame {frame}, bone {n}: {bone:?} {wanted:?}");
        }
    }
}
