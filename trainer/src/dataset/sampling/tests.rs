use super::*;
use crate::config::Config;
use clothcombo_data::asset::{Motion, Provenance};
use std::collections::BTreeSet;
use std::path::Path;

const CLIPS: [&str; 4] = ["walk", "reach", "dance", "jump"];

/// Clips of twelve seconds; the first joint after the pelvis tells clip and frame. No garment and no pose of them is augmented
/// or scaled, so that a drawn pose tells where it comes from.
fn motions(folder: &Path) {
    for (number, name) in CLIPS.into_iter().enumerate() {
        let pose = |frame: usize| {
            let mut rotations = vec![[0.0; 3]; 22];
            rotations[1] = [0.1 * number as f64, 1e-4 * frame as f64, 0.0];
            Pose { rotations }
        };
        let motion = Motion {
            name: name.into(),
            frame_rate: 30.0,
            poses: (0..360).map(pose).collect(),
            source: Provenance::default(),
        };
        motion.save(&folder.join(format!("{name}.npz"))).unwrap();
    }
}

fn clip_of(body: &BodySample) -> &'static str {
    CLIPS[(body.pose.rotations[1][0] / 0.1).round() as usize]
}

fn dataset(folder: &Path) -> (Config, Dataset) {
    motions(folder);
    let text = format!(
        "seed = 1\n[data]\nbody = \"mannequin\"\nsplit = {{ validation = 0.3, test = 0.3 }}\n\
         [[data.garments]]\ngenerate = {{ count = 12, seed = 5, vertices = 200, categories = [\"t_shirt\", \"skirt\"] }}\n\
         [data.poses]\nmotions = {folder:?}\nvalidation_clips = [\"dance\"]\ntest_clips = [\"jump\"]\naugmentation = false\n\
         max_self_intersection = 10.0\nremove_heading = false\n[model]\neigen_count = 8\n\
         [[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 10\nlayers = [1, 1]\n"
    );
    let config: Config = toml::from_str(&text).unwrap();
    let dataset = Dataset::load(&config, &|_, _, _| {}).unwrap();
    (config, dataset)
}

#[test]
fn no_run_draws_a_test_garment_or_a_test_clip_and_the_evaluation_does() {
    let folder = tempfile::tempdir().unwrap();
    let (config, dataset) = dataset(folder.path());
    let split = &dataset.split;
    assert!(split.training.len() > 1 && !split.validation.is_empty() && !split.test.is_empty(), "{split:?}");
    let names = dataset.split_names();
    assert_eq!((names.validation_clips, names.test_clips), (vec!["dance".to_owned()], vec!["jump".into()]));
    assert_eq!(names.training_clips, ["reach", "walk"]);
    assert_eq!(names.validation_windows.len(), 2);

    let scenes = ValidationConfig {
        single_scenes: 40,
        unseen_scenes: 40,
        unseen_garment_scenes: 40,
        layered_scenes: 40,
        ..ValidationConfig::default()
    };
    for group in ValidationGroup::ALL {
        let (mut clips, mut garments) = (BTreeSet::new(), BTreeSet::new());
        for seed in 0..50 {
            for sample in sample_validation(&dataset, seed, &scenes, group) {
                clips.extend(sample.bodies.iter().map(clip_of));
                garments.extend(sample.garments);
            }
        }
        let of = |part: &[usize]| part.iter().copied().collect::<BTreeSet<usize>>();
        let (expected_clips, expected_garments) = match group {
            ValidationGroup::UnseenMotion => (vec!["dance"], of(&split.training)),
            ValidationGroup::UnseenGarment => (vec!["reach", "walk"], of(&split.validation)),
            ValidationGroup::Single | ValidationGroup::Layered => {
                (vec!["reach", "walk"], of(&split.training))
            }
        };
        assert_eq!(clips.into_iter().collect::<Vec<_>>(), expected_clips, "{group:?}");
        assert_eq!(garments, expected_garments, "{group:?}");
    }
    let plan = Plan { stage: &config.stages[0], progress: 1.0 };
    for step in 0..500 {
        let sample = sample_training(&dataset, 1, step, 0, plan);
        assert!(["walk", "reach"].contains(&clip_of(&sample.bodies[0])));
        assert!(sample.garments.iter().all(|g| split.training.contains(g)));
    }
    for index in 0..50 {
        let sample = sample_evaluation(&dataset, 1, [0, index], &split.test, 1, HeldOut::TestClips);
        assert_eq!(clip_of(&sample.bodies[0]), "jump");
        let sample = sample_evaluation(&dataset, 1, [0, index], &split.test, 1, HeldOut::ValidationClips);
        assert_eq!(clip_of(&sample.bodies[0]), "dance");
    }
}

#[test]
fn without_a_validation_set_its_groups_are_empty() {
    let folder = tempfile::tempdir().unwrap();
    let (_, mut dataset) = dataset(folder.path());
    dataset.split.validation.clear();
    let count = |group| sample_validation(&dataset, 1, &ValidationConfig::default(), group).len();
    assert_eq!(count(ValidationGroup::UnseenGarment), 0);
    assert_eq!(count(ValidationGroup::UnseenMotion), ValidationConfig::default().unseen_scenes);
}

#[test]
fn another_margin_is_other_data_with_the_same_windows() {
    let folder = tempfile::tempdir().unwrap();
    let (mut config, dataset) = dataset(folder.path());
    let same = |config: &Config| {
        let other = Dataset::load(config, &|_, _, _| {}).unwrap();
        let windows = dataset.fingerprint_of_windows() == other.fingerprint_of_windows();
        (dataset.fingerprint() == other.fingerprint(), windows)
    };
    assert_eq!(same(&config), (true, true));
    config.data.poses.held_out_margin = 0.0;
    assert_eq!(same(&config), (false, true));
    config.data.poses.held_out_block = 1.0;
    assert_eq!(same(&config), (false, false));
}
