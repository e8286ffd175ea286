//! Short clips and a rigged body without shape space, as a user may bring them, trained on for a few steps.

use crate::common::{assert_fails, start, tiny};
use clothcombo_data::asset::{Motion, Pose, Provenance};
use clothcombo_data::generate::mannequin;
use std::path::Path;

/// Clips of these lengths (s) at 30 frames per second: clip0.npz, clip1.npz, …
fn write_clips(folder: &Path, seconds: &[f64]) {
    for (number, seconds) in seconds.iter().enumerate() {
        let pose = |frame: usize| {
            let mut pose = Pose::t_pose(22);
            pose.rotations[16] = [0.0, 0.0, -0.005 * frame as f64];
            pose
        };
        let poses = (0..(30.0 * seconds) as usize).map(pose).collect();
        let motion = Motion { name: String::new(), frame_rate: 30.0, poses, source: Provenance::default() };
        motion.save(&folder.join(format!("clip{number}.npz"))).unwrap();
    }
}

#[test]
fn short_clips_train_and_validate_by_themselves_also_on_a_body_without_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let clips = folder.path().join("motions");
    write_clips(&clips, &[2.0, 4.0, 6.0]);
    let body = folder.path().join("rigged.npz");
    mannequin().with_shape_components(0).save(&body, &Provenance::default()).unwrap();
    let config = tiny(folder.path(), "");
    let settings = [
        format!("data.poses.motions={:?}", clips.display().to_string()),
        format!("data.body={:?}", body.display().to_string()),
        "stages.0.steps=2".into(),
        "stages.1.steps=1".into(),
        "stages.2.steps=1".into(),
    ];
    let run = folder.path().join("run");
    let with = |settings: &[String]| {
        let mut command = start(&config, &run, 2);
        command.args(settings.iter().flat_map(|s| ["--set", s.as_str()])).output().unwrap()
    };
    let output = with(&settings);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let split: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(run.join("split.json")).unwrap()).unwrap();
    assert_eq!(split["validation_windows"][0]["clip"], "clip0");
    assert_eq!(split["training_clips"], serde_json::json!(["clip1", "clip2"]));

    // A single clip too short for any window is refused with a value that works, and leaves nothing behind.
    std::fs::remove_dir_all(&run).unwrap();
    std::fs::remove_dir_all(&clips).unwrap();
    write_clips(&clips, &[0.5]);
    let output = with(&settings);
    assert_fails(
        &output,
        1,
        &["15 frames to train on and 0 held out", "held_out_block = 0.0667 and held_out_margin = 0"],
    );
    assert!(!run.exists());
    let mended = ["data.poses.held_out_block=0.0667".to_owned(), "data.poses.held_out_margin=0".to_owned()];
    let output = with(&[&settings[..], &mended].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
