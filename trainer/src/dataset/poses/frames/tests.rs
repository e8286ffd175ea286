use super::*;
use rand::SeedableRng;

#[test]
fn long_clips_do_not_crowd_out_short_ones() {
    let clip = |frames: usize, rate: f64| TrainedClip {
        poses: vec![Pose { rotations: vec![[frames as f64; 3]] }; frames],
        seconds: frames as f64 / rate,
    };
    // 64 s, 4 s, and 4 s at a high frame rate: 8 to 2 to 2.
    let trained_on = vec![clip(640, 10.0), clip(40, 10.0), clip(480, 120.0)];
    let frames = Frames {
        shares: WeightedIndex::new(trained_on.iter().map(TrainedClip::share)).unwrap(),
        trained_on,
        windows: Vec::new(),
        validation: Vec::new(),
        test: Vec::new(),
        clips: ClipSplit::default(),
        sources: Vec::new(),
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut counts = [0; 3];
    for _ in 0..12_000 {
        let length = frames.sample_training(&mut rng).rotations[0][0] as usize;
        counts[[640, 40, 480].iter().position(|l| *l == length).unwrap()] += 1;
    }
    for (count, expected) in counts.into_iter().zip([8000.0_f64, 2000.0, 2000.0]) {
        assert!((f64::from(count) - expected).abs() < 4.0 * expected.sqrt(), "{counts:?}");
    }
}

#[test]
fn frame_rates_that_are_none_are_refused() {
    let clip = |frame_rate: f64| Motion {
        name: "walk".into(),
        frame_rate,
        poses: vec![Pose::t_pose(2); 400],
        source: Provenance::default(),
    };
    let split = |rates: &[f64]| {
        let clips: Vec<Motion> = rates.iter().map(|rate| clip(*rate)).collect();
        // One frame a block at the absurd rates, and something held out at the good ones.
        let config = PoseConfig { held_out_block: 0.1, held_out_margin: 0.0, ..PoseConfig::default() };
        Frames::split(&clips, &config, Path::new("motions"))
    };
    assert!(split(&[30.0, 60.0]).is_ok());
    for rates in [[30.0, 0.0], [1e-320, 30.0], [30.0, f64::NAN], [30.0, -1.0]] {
        let error = split(&rates).err().unwrap_or_else(|| panic!("{rates:?} passed"));
        assert!(error.to_string().starts_with("motions: at frame rates from"), "{error}");
    }
}

/// A clip whose poses know their clip and frame.
fn numbered(name: &str, number: usize, frames: usize, frame_rate: f64) -> Motion {
    let pose = |frame: usize| Pose { rotations: vec![[number as f64, frame as f64, 0.0]; 2] };
    Motion {
        name: name.into(),
        frame_rate,
        poses: (0..frames).map(pose).collect(),
        source: Provenance::default(),
    }
}

#[test]
fn trained_frames_are_a_second_away_from_validated_ones_of_the_same_clip() {
    let margin = PoseConfig::default().held_out_margin;
    assert!(margin >= 1.0);
    for (frame_rate, held_out_share, held_out_block) in
        [(30.0, 0.1, 2.0), (29.97, 0.1, 2.0), (60.0, 0.2, 1.5), (120.0, 0.05, 0.7), (24.0, 0.5, 3.0)]
    {
        let config = PoseConfig { held_out_share, held_out_block, ..PoseConfig::default() };
        // From a fraction of a second on, in uneven steps, with a long one that always has windows.
        let lengths = (1..60).map(|i| i * i + 7 * i).chain([40_000]);
        let clips: Vec<Motion> =
            lengths.enumerate().map(|(i, frames)| numbered("clip", i, frames, frame_rate)).collect();
        let frames = Frames::split(&clips, &config, Path::new("motions")).unwrap();
        let clip_and_time = |pose: &Pose| (pose.rotations[0][0], pose.rotations[0][1] / frame_rate);
        let validated: Vec<(f64, f64)> = frames.windows.iter().map(clip_and_time).collect();
        let mut clips_with_windows = 0;
        for trained in frames.trained_clips() {
            let number = trained[0].rotations[0][0];
            let own: Vec<f64> = validated.iter().filter(|(c, _)| *c == number).map(|(_, t)| *t).collect();
            clips_with_windows += usize::from(!own.is_empty());
            for (_, time) in trained.iter().map(clip_and_time) {
                // Windows are listed in the order of time.
                let next = own.partition_point(|t| *t < time);
                let near = [next.checked_sub(1), Some(next)].into_iter().flatten();
                for other in near.filter_map(|i| own.get(i)) {
                    assert!((time - other).abs() >= margin - 1e-9, "{frame_rate}: {time} s, {other} s");
                }
            }
        }
        assert!(clips_with_windows > 10, "{frame_rate}: {clips_with_windows}");
        // No more is given up than both sides of every window.
        let given_up: usize = clips.iter().map(|clip| clip.poses.len()).sum::<usize>()
            - frames.trained()
            - frames.windows.len();
        let most = 2.0 * margin * frame_rate * frames.clips.windows.len() as f64;
        assert!(given_up as f64 <= most && given_up > 0, "{given_up} of at most {most}");
    }
}

#[test]
fn a_clip_too_short_for_a_window_is_trained_on_whole() {
    let clips = [numbered("short", 0, 300, 30.0), numbered("long", 1, 330, 30.0)];
    let frames = Frames::split(&clips, &PoseConfig::default(), Path::new("motions")).unwrap();
    let lengths: Vec<usize> = frames.trained_clips().map(<[Pose]>::len).collect();
    // The window of the long one begins after 10 s and ends with it; the second before is left out.
    assert_eq!(lengths, [300, 271]);
    assert_eq!(frames.windows.len(), 30);
    assert_eq!(frames.clips.windows, [Window { clip: "long".into(), seconds: [10.0, 11.0] }]);
}

#[test]
fn clips_are_in_one_set_and_misnamed_ones_are_told() {
    let clips = ["walk", "run", "jump"].iter().enumerate().map(|(i, name)| numbered(name, i, 600, 30.0));
    let clips: Vec<Motion> = clips.collect();
    let split = |validation: &[&str], test: &[&str]| {
        let names = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        let config = PoseConfig {
            validation_clips: names(validation),
            test_clips: names(test),
            ..PoseConfig::default()
        };
        Frames::split(&clips, &config, Path::new("motions"))
    };
    let frames = split(&["run"], &["jump"]).unwrap();
    let numbers = |poses: &[Pose]| {
        let mut all: Vec<usize> = poses.iter().map(|pose| pose.rotations[0][0] as usize).collect();
        all.dedup();
        all
    };
    assert_eq!((numbers(&frames.validation), numbers(&frames.test)), (vec![1], vec![2]));
    assert_eq!((numbers(&frames.windows), frames.trained_clips().count()), (vec![0], 1));
    assert_eq!(frames.clips.training, ["walk"]);
    assert_eq!((frames.clips.validation, frames.clips.test), (vec!["run".into()], vec!["jump".into()]));
    for (validation, test, expected) in [
        (["run"], ["u"], "run is named by data.poses.validation_clips and by data.poses.test_clips"),
        (["fly"], ["run"], "data.poses.validation_clips names \"fly\""),
        (["run"], ["fly"], "data.poses.test_clips names \"fly\""),
    ] {
        let error = split(&validation, &test).err().unwrap().to_string();
        assert!(error.contains(expected), "{error}");
    }
    // A name that is optional may fit no clip; one that fits some holds them out.
    let optional = |name: &str| {
        let names = vec![name.to_owned()];
        let config = PoseConfig { test_clips: names.clone(), optional_clips: names, ..PoseConfig::default() };
        Frames::split(&clips, &config, Path::new("motions")).unwrap().clips.test
    };
    assert_eq!((optional("fly"), optional("jump")), (Vec::new(), vec!["jump".to_owned()]));
}
