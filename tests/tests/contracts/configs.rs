//! The configurations that come with the project say what they mean.

use clothcombo_trainer::config::{Config, load, to_toml};
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
