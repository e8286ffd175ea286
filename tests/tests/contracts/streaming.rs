//! A dataset streamed from the cache trains to the same bits as one kept in memory, whatever happens to the cache.

use clothcombo_tests::tiny_config;
use clothcombo_trainer::config::Config;
use clothcombo_trainer::dataset::tensor_bytes;
use clothcombo_trainer::dataset::{Dataset, GarmentStore, load_body};
use clothcombo_trainer::inference::tensor_store::TensorStore;
use clothcombo_trainer::run::folder::RunDir;
use clothcombo_trainer::system::device::default_device;
use clothcombo_trainer::system::lru_cache::KeptBytes;
use clothcombo_trainer::system::stop::StopFlag;
use clothcombo_trainer::training::session::Session;
use clothcombo_trainer::training::train_loop::train;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Trains and returns the final parameters.
fn trained(config: &Config, dataset: Dataset, folder: &Path) -> Vec<u8> {
    let device = default_device();
    let run = RunDir::create(folder, config).unwrap();
    let mut session = Session::new(run, config.clone(), Arc::new(dataset), &device).unwrap();
    train(&mut session, &mut [], &StopFlag::default()).unwrap();
    fs::read(folder.join("checkpoints/step-00000060/model.safetensors")).unwrap()
}

fn records(cache: &Path) -> Vec<PathBuf> {
    let shelves = fs::read_dir(cache).unwrap().map(|s| s.unwrap().path());
    let mut files: Vec<_> =
        shelves.flat_map(|s| fs::read_dir(s).unwrap().map(|f| f.unwrap().path())).collect();
    files.sort();
    files
}

fn streamed(folder: &Path) -> Config {
    let cache = format!("data.cache.folder={:?}", folder.join("cache"));
    let mut config = tiny_config(folder, &[&cache]);
    config.data.memory_mib = 0; // only the last garment stays: the others are read again whenever they are drawn
    config
}

fn load(config: &Config) -> Dataset {
    Dataset::load(config, &|_, _, _| {}).unwrap()
}

#[test]
fn streaming_changes_no_bit() {
    let folder = tempfile::tempdir().unwrap();
    let kept = tiny_config(folder.path(), &[]);
    let config = streamed(folder.path());
    let expected = trained(&kept, load(&kept), &folder.path().join("kept"));

    assert!(trained(&config, load(&config), &folder.path().join("streamed")) == expected);
    assert_eq!(
        records(&folder.path().join("cache")).len(),
        6,
        "operators and binding of each of three garments"
    );

    // A second run finds everything, although two of three records are damaged or gone.
    for (i, record) in records(&folder.path().join("cache")).iter().enumerate() {
        match i % 3 {
            0 => fs::remove_file(record).unwrap(),
            1 => {
                let mut bytes = fs::read(record).unwrap();
                let middle = bytes.len() / 2;
                bytes[middle] ^= 0xff;
                fs::write(record, bytes).unwrap();
            }
            _ => {}
        }
    }
    assert!(trained(&config, load(&config), &folder.path().join("again")) == expected);
}

#[test]
fn records_that_vanish_during_a_run_are_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let kept = tiny_config(folder.path(), &[]);
    let config = streamed(folder.path());
    let expected = trained(&kept, load(&kept), &folder.path().join("kept"));
    let dataset = load(&config);
    fs::remove_dir_all(folder.path().join("cache")).unwrap();
    assert!(trained(&config, dataset, &folder.path().join("streamed")) == expected);
}

#[test]
fn shards_prepare_everything_once() {
    let folder = tempfile::tempdir().unwrap();
    let config = streamed(folder.path());
    let body = Arc::new(load_body("mannequin", 0).unwrap());
    let prepare = |shard| GarmentStore::prepare(&config, body.clone(), shard, &|_, _, _| {}).unwrap();
    assert_eq!((prepare([0, 2]).0, prepare([1, 2]).0), (2, 1));
    let first: Vec<_> = records(&folder.path().join("cache"))
        .iter()
        .map(|r| fs::metadata(r).unwrap().modified().unwrap())
        .collect();
    assert_eq!(first.len(), 6);
    assert_eq!(prepare([0, 1]).0, 3);
    let second: Vec<_> = records(&folder.path().join("cache"))
        .iter()
        .map(|r| fs::metadata(r).unwrap().modified().unwrap())
        .collect();
    assert_eq!(first, second, "what is there is left alone");
}

#[test]
fn a_cache_that_cannot_be_used_changes_no_bit() {
    let folder = tempfile::tempdir().unwrap();
    let kept = tiny_config(folder.path(), &[]);
    let expected = trained(&kept, load(&kept), &folder.path().join("kept"));
    // Full from the start, full after a few records, and no folder at all.
    let mut config = streamed(folder.path());
    for (name, limit) in [("full", 1e-9), ("nearly", 2e-4)] {
        config.data.cache.limit_gib = limit;
        assert!(trained(&config, load(&config), &folder.path().join(name)) == expected, "{name}");
    }
    fs::write(folder.path().join("file"), "").unwrap();
    config.data.cache.folder = Some(folder.path().join("file/cache"));
    assert!(trained(&config, load(&config), &folder.path().join("none")) == expected);
    let body = Arc::new(load_body("mannequin", 0).unwrap());
    let error = GarmentStore::prepare(&config, body, [0, 1], &|_, _, _| {}).unwrap_err().to_string();
    assert!(error.contains("file/cache"), "filling it is what `prepare` is for: {error}");
}

#[test]
fn garments_and_their_tensors_stay_within_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streamed(folder.path());
    (config.data.memory_mib, config.data.device_memory_mib) = (4, 1);
    let generate = config.data.garments[0].generate.as_mut().unwrap();
    (generate.count, generate.vertices) = (12, 1000);
    let dataset = Arc::new(load(&config));
    let tensors = TensorStore::new(dataset.clone(), dataset.dimensions(), &default_device());
    let mut whole = KeptBytes::default();
    for index in (0..12).chain(0..12) {
        let garment = dataset.garments.garment(index).unwrap();
        tensors.garment(index, &garment).unwrap();
        let bytes = tensor_bytes(garment.vertex_count(), config.model.eigen_count, dataset.joints().len());
        whole.total += garment.bytes() + bytes;
        whole.device += bytes;
    }
    let most = tensors.memory().most();
    assert!(most.total <= 4 << 20 && most.device <= 1 << 20, "{most:?}");
    // Both limits were of use: all twelve garments take several times as much.
    assert!(whole.total / 2 > 4 * most.total && whole.device / 2 > 3 * most.device, "{whole:?} {most:?}");
    assert!(most.total > 3 << 20 && most.device > 500 << 10, "{most:?}");
}

#[test]
fn nothing_is_stored_of_shapes_without_shape_transfer() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = streamed(folder.path());
    let with = load(&config).garments.garment(0).unwrap();
    assert_eq!(with.shape_directions.len(), with.vertex_count() * 3 * 8, "all components of the mannequin");
    config.data.shape_components = 2;
    let few = load(&config).garments.garment(0).unwrap();
    assert_eq!(few.shape_directions.len(), few.vertex_count() * 3 * 2);
    assert_eq!(few.start_positions(&[0.5, -1.0]), with.start_positions(&[0.5, -1.0]));
    config.start.shape_transfer = false;
    let without = load(&config).garments.garment(0).unwrap();
    assert!(without.shape_directions.is_empty());
    let rest = without.garment.rest.positions().iter().map(|p| p.map(|x| x as f32));
    assert_eq!(without.start_positions(&[0.5, -1.0]), rest.collect::<Vec<_>>());
}
