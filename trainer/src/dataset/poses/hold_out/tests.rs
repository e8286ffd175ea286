use super::*;
use crate::dataset::DatasetError;
use crate::dataset::poses::frames::Frames;
use clothcombo_data::asset::{Pose, Provenance};
use miette::Diagnostic;
use std::path::Path;

fn clip(name: &str, seconds: f64, frame_rate: f64) -> Motion {
    let poses = vec![Pose::t_pose(2); (seconds * frame_rate).round() as usize];
    Motion { name: name.into(), frame_rate, poses, source: Provenance::default() }
}

/// Clips of these lengths (s) at 30 frames per second, called clip0, clip1, …
fn clips(seconds: &[f64]) -> Vec<Motion> {
    seconds.iter().enumerate().map(|(i, s)| clip(&format!("clip{i}"), *s, 30.0)).collect()
}

fn split(clips: &[Motion], config: &PoseConfig) -> Result<Frames, DatasetError> {
    Frames::split(clips, config, Path::new("motions"))
}

#[test]
fn of_short_clips_whole_ones_are_held_out() {
    let config = PoseConfig::default();
    let three = clips(&[2.0, 4.0, 6.0]);
    let frames = split(&three, &config).unwrap();
    assert_eq!((frames.trained(), frames.windows.len()), (300, 60));
    assert_eq!(frames.clips.training, ["clip1", "clip2"]);
    assert_eq!(
        (frames.clips.windows[0].clip.as_str(), frames.clips.windows[0].seconds),
        ("clip0", [0.0, 2.0])
    );

    // Hundreds of clips of 2 to 10 s, as in AMASS: a tenth of the time, the same clips in any order of the list.
    let many: Vec<Motion> =
        (0..200).map(|i| clip(&format!("subject_{i}"), 2.0 + (i % 9) as f64, 60.0)).collect();
    let frames = split(&many, &config).unwrap();
    let share = frames.windows.len() as f64 / (frames.windows.len() + frames.trained()) as f64;
    assert!((0.09..=0.1).contains(&share), "{share}");
    let held_out = |frames: &Frames| {
        let mut names: Vec<String> = frames.clips.windows.iter().map(|w| w.clip.clone()).collect();
        names.sort();
        names
    };
    let backwards: Vec<Motion> = many.iter().rev().cloned().collect();
    assert_eq!(held_out(&frames), held_out(&split(&backwards, &config).unwrap()));
}

#[test]
fn one_long_clip_among_short_ones_is_not_all_that_validates() {
    let lengths: Vec<f64> = std::iter::once(11.0).chain((0..50).map(|i| 3.0 + (i % 5) as f64)).collect();
    let frames = split(&clips(&lengths), &PoseConfig::default()).unwrap();
    assert!(frames.clips.windows.len() > 3, "{:?}", frames.clips.windows);
    let total: f64 = lengths.iter().sum();
    let seconds = frames.windows.len() as f64 / 30.0;
    assert!((0.08 * total..=0.1 * total).contains(&seconds), "{seconds} of {total}");
}

#[test]
fn too_few_clips_have_windows_scaled_to_their_length() {
    for (lengths, held_out) in [(&[6.0][..], 18), (&[3.0, 3.0], 18), (&[1.0], 3)] {
        let clips = clips(lengths);
        let frames = split(&clips, &PoseConfig::default()).unwrap();
        assert_eq!(frames.windows.len(), held_out, "{lengths:?}");
        // The margin shrinks with the block: 1 s beside 2 s.
        let given_up = clips.iter().map(|c| c.poses.len()).sum::<usize>() - frames.trained() - held_out;
        assert!(given_up <= held_out && frames.trained() > 2 * held_out, "{given_up}");
    }
}

fn remedy_of(split: Result<Frames, DatasetError>) -> String {
    let error = split.err().expect("it is refused");
    assert!(error.to_string().contains("held out to validate on"), "{error}");
    error.help().expect("a remedy").to_string()
}

#[test]
fn what_cannot_be_split_is_refused_with_a_value_that_works() {
    for (clips, share) in [
        (clips(&[0.5]), 0.1),
        (clips(&[0.9]), 0.1),
        (clips(&[0.1]), 0.1),
        (vec![clip("slow", 4.0, 0.5)], 0.1),
        (vec![clip("slow", 20.0, 0.1)], 0.05),
        (vec![clip("fast", 0.004, 3000.0), clip("other", 0.003, 3000.0)], 0.1),
    ] {
        let config = PoseConfig { held_out_share: share, ..PoseConfig::default() };
        let remedy = remedy_of(split(&clips, &config));
        let value = |key: &str| -> Option<f64> {
            let after = &remedy[remedy.find(key)? + key.len() + 3..];
            after.split([' ', ',']).next()?.parse().ok()
        };
        let mended = PoseConfig {
            held_out_share: value("held_out_share").unwrap_or(share),
            held_out_block: value("held_out_block").unwrap_or_else(|| panic!("{remedy}")),
            held_out_margin: value("held_out_margin").unwrap(),
            ..config
        };
        let frames = split(&clips, &mended).unwrap_or_else(|e| panic!("{remedy}: {e}"));
        assert!(frames.trained() > 0 && !frames.windows.is_empty(), "{remedy}");
    }
    let remedy = remedy_of(split(&[clip("one", 1.0, 1.0)], &PoseConfig::default()));
    assert!(remedy.starts_with("add clips"), "{remedy}");
    let named = PoseConfig { validation_clips: vec!["clip".into()], ..PoseConfig::default() };
    let error = split(&clips(&[20.0, 20.0]), &named).err().unwrap().to_string();
    assert!(error.contains("no clip to train on: 2 are named by data.poses.validation_clips"), "{error}");
}
