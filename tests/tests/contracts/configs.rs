//! The configurations that come with the project say what they mean.

use clothcombo_model::{Graph, ModelConfig, SkinningJoints};
use clothcombo_trainer::config::{ClipScope, Config, DistanceMode, PoseEncoding, Trains, load, to_toml};
use std::path::{Path, PathBuf};

fn configurations(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let below = folders.iter().flat_map(|folder| configurations(folder));
    files.into_iter().filter(|file| file.extension().is_some_and(|e| e == "toml")).chain(below).collect()
}

#[test]
fn every_configuration_in_the_repository_is_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let files = configurations(&folder);
    assert!(files.len() >= 10, "{files:?}");
    for file in files {
        let config: Config = load(&file, &[]).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(!config.stages.is_empty() && to_toml(&config).is_ok(), "{}", file.display());
    }
}

/// Every value of the paper, where the default differs too; `docs/losses.md` says what stays different.
#[test]
fn the_configuration_of_the_paper_has_the_papers_values() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/paper.toml");
    let config = load(&file, &[]).unwrap();

    let data = &config.data;
    assert_eq!(data.shape_range, [-2.0, 2.0]);
    let held_out = 4400.0 * data.split.test;
    assert!((held_out - 100.0).abs() < 1.0 && data.split.validation == 0.0, "{held_out} of 4,400 garments");
    assert!(data.cache.folder.is_some());
    let poses = &data.poses;
    assert!(poses.encoding == PoseEncoding::AxisAngle && !poses.remove_heading && !poses.augmentation);
    assert!(poses.max_self_intersection >= 10.0);
    assert!(!config.start.smooth_weights && !config.start.shape_transfer);

    let paper = ModelConfig {
        zero_sum_skinning: false,
        skinning_joints: SkinningJoints::All,
        graph: Graph::Full,
        vertex_embedding: true,
        ..ModelConfig::default()
    };
    assert_eq!(config.model, paper);
    let sizes =
        (paper.width, paper.embedding, paper.diffusion_blocks, paper.diffusion_width, paper.eigen_count);
    assert_eq!(sizes, (512, 512, 8, 512, 128));
    let layers = (paper.mlp_layers, paper.siren_layers, paper.siren_width);
    assert_eq!(layers, (6, 6, 512));
    assert_eq!((paper.skinning_layers, paper.skinning_width), (4, 128));
    assert_eq!((paper.displacement_scale, paper.untangling_scale, paper.skinning_scale), (0.1, 0.01, 0.01));

    let losses = &config.losses;
    let weights = [
        (&losses.strain.weight, 1.0),
        (&losses.bending.weight, 5.0),
        (&losses.gravity.weight, 1.0),
        (&losses.body_collision.weight, 250.0),
        (&losses.repulsion.weight, 0.001),
        (&losses.holding.weight, 100.0),
        (&losses.layer_collision.weight, 250.0),
        (&losses.layer_distance.weight, 25_000.0),
        (&losses.single_garments, 0.0),
    ];
    for (weight, expected) in weights {
        assert!([0.0, 0.5, 1.0].iter().all(|&progress| weight.at(progress) == expected), "{expected}");
    }
    assert_eq!((losses.reference_vertices, losses.body_collision.epsilon), (0.0, 0.002));
    // The weight of 0.001 belongs to the sum over N: see the comment in the file.
    assert!(losses.repulsion.per_vertex && losses.repulsion.subset == 0 && losses.repulsion.radius == 0.1);
    assert!(
        losses.holding.fraction == 0.1
            && !losses.holding.relative
            && !losses.holding.posed
            && losses.strain.needle_ratio == 0.0
    );
    assert!(losses.layer_collision.epsilon == 0.002 && !losses.layer_collision.gated);
    assert_eq!(losses.layer_distance.radius, 0.1);
    let material = &losses.material;
    assert_eq!((material.lambda, material.mu), (4.44e4, 2.36e4));

    assert!(config.optimizer.clip == ClipScope::Step && config.optimizer.clip_norm == 1.0);
    assert_eq!(losses.body_collision.distance, DistanceMode::NearestVertex);
    assert_eq!(config.total_steps(), 200_000);
    let [single, all] = &config.stages[..] else { panic!("two stages") };
    assert!(single.trains == Trains::Single && single.steps == 100_000);
    assert_eq!([0.0, 0.5, 1.0].map(|progress| single.pose_scale.at(progress)), [0.0, 0.5, 1.0]);
    assert!(all.trains == Trains::All && all.layers == [1, 6]);
    assert!(config.stages.iter().all(|stage| stage.learning_rate.at(0.5) == 1e-4));
    assert_eq!(config.validation.layers, [2, 6]);
}
