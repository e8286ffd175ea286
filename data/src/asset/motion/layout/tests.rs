use super::*;
use crate::asset::Motion;
use crate::asset::rotation::matrix_from_axis_angle;
use crate::format::NpzWriter;

const FRAMES: usize = 3;

/// Joint j of frame f.
fn turn(f: usize, j: usize) -> [f64; 3] {
    [0.01 * j as f64 + 0.1, 0.2 * f as f64, -0.3]
}

/// Numbers of the joints of all frames.
fn flat(joints: std::ops::Range<usize>) -> Vec<f64> {
    (0..FRAMES).flat_map(|f| joints.clone().flat_map(move |j| turn(f, j))).collect()
}

fn matrices(joints: std::ops::Range<usize>) -> Vec<f64> {
    let all = (0..FRAMES).flat_map(|f| joints.clone().map(move |j| turn(f, j)));
    all.flat_map(|r| matrix_from_axis_angle(r).into_iter().flatten()).collect()
}

/// What is read of a file with these arrays.
fn read(arrays: &[(&str, &[usize], &[f64])]) -> Result<MotionFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.npz");
    let mut npz = NpzWriter::new();
    for (key, shape, data) in arrays {
        npz.f64(key, shape, data);
    }
    npz.save(&path).unwrap();
    MotionFile::read(&path).map_err(|e| e.to_string())
}

#[test]
fn every_layout_of_public_tools_gives_the_same_poses() {
    let zero_root: Vec<f64> =
        flat(0..24).into_iter().enumerate().map(|(i, x)| if i % 72 < 3 { 0.0 } else { x }).collect();
    let layouts: [&[(&str, &[usize], &[f64])]; 13] = [
        &[("poses", &[FRAMES, 66], &flat(0..22))],
        &[("poses", &[FRAMES, 22, 3], &flat(0..22))],
        &[("poses", &[FRAMES, 24, 3], &flat(0..24))],
        &[("poses", &[FRAMES, 52, 3], &flat(0..52))],
        &[("poses", &[FRAMES, 165], &flat(0..55))],
        &[("smpl_poses", &[FRAMES, 72], &flat(0..24)), ("smpl_trans", &[FRAMES, 3], &[0.0; 9])],
        &[("full_pose", &[FRAMES, 55, 3], &flat(0..55))],
        &[("global_orient", &[FRAMES, 3], &flat(0..1)), ("body_pose", &[FRAMES, 63], &flat(1..22))],
        &[("global_orient", &[FRAMES, 1, 3], &flat(0..1)), ("body_pose", &[FRAMES, 23, 3], &flat(1..24))],
        &[("root_orient", &[FRAMES, 3], &flat(0..1)), ("pose_body", &[FRAMES, 21, 3], &flat(1..22))],
        &[("Rh", &[FRAMES, 3], &flat(0..1)), ("poses", &[FRAMES, 72], &zero_root)],
        &[
            ("global_orient", &[FRAMES, 1, 3, 3], &matrices(0..1)),
            ("body_pose", &[FRAMES, 23, 3, 3], &matrices(1..24)),
        ],
        &[("global_orient", &[FRAMES, 3, 3], &matrices(0..1)), ("poses", &[FRAMES, 69], &flat(1..24))],
    ];
    for layout in layouts {
        let file = read(layout).unwrap_or_else(|e| panic!("{:?}: {e}", layout[0].0));
        assert_eq!(file.poses.len(), FRAMES);
        for (f, pose) in file.poses.iter().enumerate() {
            for (j, rotation) in pose.rotations.iter().enumerate() {
                let close = rotation.iter().zip(turn(f, j)).all(|(a, b)| (a - b).abs() < 1e-12);
                assert!(close, "{}, frame {f}, joint {j}: {rotation:?}", file.keys);
            }
        }
    }
}

#[test]
fn rates_are_found_under_every_name_and_contradictions_are_told() {
    let poses = flat(0..22);
    let with = |rates: &[(&'static str, &'static [usize], &'static [f64])]| {
        let mut arrays: Vec<(&str, &[usize], &[f64])> = vec![("poses", &[FRAMES, 66], &poses)];
        arrays.extend_from_slice(rates);
        read(&arrays)
    };
    for key in RATE_KEYS {
        assert_eq!(with(&[(key, &[], &[30.0])]).unwrap().rate, Some((key, 30.0)));
        assert_eq!(with(&[(key, &[1], &[59.94])]).unwrap().rate, Some((key, 59.94)));
    }
    assert!(with(&[("fps", &[2], &[30.0, 30.0]), ("rate", &[], &[30.000001])]).is_ok());
    let message = with(&[("fps", &[], &[30.0]), ("rate", &[], &[60.0])]).unwrap_err();
    assert!(message.contains("clip.npz: key 'fps' says 30") && message.contains("'rate' 60"), "{message}");
    assert!(with(&[("fps", &[2], &[30.0, 60.0])]).unwrap_err().contains("several frame rates"));
    assert!(with(&[("fps", &[0], &[])]).unwrap_err().contains("empty"));

    let without = with(&[]).unwrap();
    assert_eq!(without.frame_rate(Some(25.0)), Ok(25.0));
    assert!(without.frame_rate(None).unwrap_err().contains("import amass FILE --rate HZ"));
    let own = with(&[("fps", &[], &[30.0])]).unwrap();
    assert_eq!((own.frame_rate(None), own.frame_rate(Some(30.0))), (Ok(30.0), Ok(30.0)));
    let message = own.frame_rate(Some(60.0)).unwrap_err();
    assert!(message.contains("'fps' says 30") && message.contains("--rate 60"), "{message}");
}

#[test]
fn incomplete_layouts_name_the_key_and_what_is_missing() {
    for (arrays, part) in [
        (&[("poses", &[FRAMES, 63][..], &flat(0..21)[..])][..], "[3, 63]"),
        (
            &[("body_pose", &[FRAMES, 63], &flat(0..21))],
            "without the root, and none of the keys global_orient",
        ),
        (&[("body_pose", &[FRAMES, 60], &flat(0..20)), ("Rh", &[FRAMES, 3], &flat(0..1))], "63 or 69"),
        (&[("body_pose", &[FRAMES, 63], &flat(0..21)), ("Rh", &[1, 3], &[0.0; 3])], "'Rh' has 1 frames"),
        (&[("poses", &[FRAMES * 66], &flat(0..22))], "expected [frames, 66 or more"),
        (&[("betas", &[1], &[0.0])], "'poses'"),
        (&[("poses", &[1, 22, 3, 3], &[0.5; 198])], "frame 0, joint 0 is no rotation matrix"),
    ] {
        let message = read(arrays).unwrap_err();
        assert!(message.contains("clip.npz") && message.contains(part), "{message}");
    }
}

#[test]
fn a_motion_without_a_rate_is_refused_with_the_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("clip.npz");
    let mut npz = NpzWriter::new();
    npz.f64("poses", &[FRAMES, 66], &flat(0..22));
    npz.save(&path).unwrap();
    let message = Motion::load(&path).unwrap_err().to_string();
    assert!(message.contains("mocap_framerate") && message.contains("--rate"), "{message}");
}
