//! Which checkpoints of a run stay.
//!
//! A checkpoint disappears as it appeared, at once: it is renamed first and deleted then, so that a kill in between leaves a
//! folder that no longer has the name of a checkpoint.

use crate::config::OutputConfig;
use clothcombo_data::format::atomic;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Ending of what is not yet, or no longer, a checkpoint.
pub(super) const TEMPORARY_ENDING: &str = ".tmp";

/// Name of the checkpoint folder of `step`.
pub(super) fn name(step: u64) -> String {
    format!("step-{step:08}")
}

/// The step of the checkpoint folder called `name`, if it is one.
pub(super) fn step_of(name: &str) -> Option<u64> {
    name.strip_prefix("step-")?.parse().ok()
}

/// All checkpoint folders in `folder` with their steps, ascending, whole or not.
pub(super) fn list(folder: &Path) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let mut found: Vec<(u64, PathBuf)> = entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            Some((step_of(&name)?, entry.path()))
        })
        .collect();
    found.sort_unstable();
    found
}

/// Removes the checkpoints that `output` does not keep; never the one of step `newest`, nor that of step `best`.
pub(super) fn prune(folder: &Path, output: &OutputConfig, newest: u64, best: Option<u64>) -> io::Result<()> {
    let steps: Vec<u64> = list(folder).into_iter().map(|(step, _)| step).filter(|s| *s <= newest).collect();
    let for_ever = |step: u64| output.keep_every > 0 && step.is_multiple_of(output.keep_every);
    let is_best = |step: u64| output.keep_best && best == Some(step);
    for &step in steps.iter().rev().skip(output.keep_checkpoints.max(1)) {
        if step != newest && !for_ever(step) && !is_best(step) {
            remove(folder, step)?;
        }
    }
    Ok(())
}

/// Writes the name of the checkpoint of step `best` to the file `best`; without one there is no such file.
pub(super) fn name_best(folder: &Path, best: Option<u64>) -> io::Result<()> {
    let file = folder.join("best");
    match best.map(name).filter(|name| folder.join(name).exists()) {
        Some(name) => atomic::write(&file, name.as_bytes()),
        None if file.exists() => fs::remove_file(&file),
        None => Ok(()),
    }
}

fn remove(folder: &Path, step: u64) -> io::Result<()> {
    let leaving = folder.join(format!("{}{TEMPORARY_ENDING}", name(step)));
    let _ = fs::remove_dir_all(&leaving);
    fs::rename(folder.join(name(step)), &leaving)?;
    fs::remove_dir_all(&leaving)
}

/// Removes what interrupted saves and removals left behind.
pub(super) fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok) {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with("step-") && name.ends_with(TEMPORARY_ENDING) {
            // It costs space and nothing else; the next sweep may have more luck.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Renames the checkpoints after `step` to `abandoned-step-…`, so that none of them is taken for the newest of the run.
/// Returns how many.
///
/// # Errors
/// The file system's.
pub(super) fn abandon_after(folder: &Path, step: u64) -> io::Result<usize> {
    let later: Vec<_> = list(folder).into_iter().filter(|(s, _)| *s > step).collect();
    for (step, path) in &later {
        let target = folder.join(format!("abandoned-{}", name(*step)));
        if target.exists() {
            fs::remove_dir_all(&target)?;
        }
        fs::rename(path, target)?;
    }
    // What named one of them names nothing any more.
    let dangles = |file: &str| {
        fs::read_to_string(folder.join(file)).is_ok_and(|name| !folder.join(name.trim()).exists())
    };
    if dangles("best") {
        name_best(folder, None)?;
    }
    if let (true, Some((newest, _))) = (dangles("latest"), list(folder).last()) {
        atomic::write(&folder.join("latest"), name(*newest).as_bytes())?;
    }
    Ok(later.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(folder: &Path) -> Vec<u64> {
        list(folder).into_iter().map(|(step, _)| step).collect()
    }

    fn folder(steps: impl IntoIterator<Item = u64>) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for step in steps {
            fs::create_dir(folder.path().join(name(step))).unwrap();
        }
        folder
    }

    fn output(keep_checkpoints: usize, keep_every: u64, keep_best: bool) -> OutputConfig {
        OutputConfig { keep_checkpoints, keep_every, keep_best, ..OutputConfig::default() }
    }

    #[test]
    fn last_best_and_every_stay() {
        let made = folder((1..=10).map(|i| i * 10));
        prune(made.path(), &output(2, 40, true), 100, Some(30)).unwrap();
        assert_eq!(steps(made.path()), [30, 40, 80, 90, 100]);
        prune(made.path(), &output(1, 0, false), 100, Some(30)).unwrap();
        assert_eq!(steps(made.path()), [100]);
    }

    #[test]
    fn the_file_best_names_what_is_there() {
        let made = folder([10, 20]);
        let best = || fs::read_to_string(made.path().join("best")).ok();
        for (step, expected) in [(Some(10), Some(10)), (Some(20), Some(20)), (Some(30), None), (None, None)] {
            name_best(made.path(), step).unwrap();
            assert_eq!(best(), expected.map(name));
        }
    }

    #[test]
    fn the_newest_stays_even_when_damaged_ones_look_newer() {
        // 60 to 80 were found damaged, the run went on from 40 and saved 50.
        let made = folder([30, 40, 50, 60, 70, 80]);
        prune(made.path(), &output(1, 0, true), 50, None).unwrap();
        assert_eq!(steps(made.path()), [50, 60, 70, 80]);
    }

    #[test]
    fn leftovers_are_swept_and_later_ones_set_aside() {
        let made = folder([10, 20, 30]);
        fs::create_dir(made.path().join("step-00000040.tmp")).unwrap();
        sweep(made.path());
        fs::write(made.path().join("latest"), name(30)).unwrap();
        fs::write(made.path().join("best"), name(30)).unwrap();
        assert_eq!(abandon_after(made.path(), 10).unwrap(), 2);
        assert_eq!(fs::read_to_string(made.path().join("latest")).unwrap(), name(10));
        assert!(!made.path().join("best").exists());
        assert_eq!(steps(made.path()), [10]);
        assert!(made.path().join("abandoned-step-00000030").exists());
        assert!(!made.path().join("step-00000040.tmp").exists());
    }
}
