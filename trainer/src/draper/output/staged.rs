//! A folder that appears whole or not at all.

use super::OutputError;
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};

/// Marks a folder as one that a drape was written to.
const MARK: &str = "report.json";

/// A folder under a temporary name beside its target; removed again unless it is [committed](Self::commit).
#[derive(Debug)]
pub struct Staged {
    target: PathBuf,
    temporary: PathBuf,
    is_committed: bool,
}

impl Staged {
    /// Starts a folder that will become `target`, which must not exist or be empty, or hold an earlier drape if `replace`.
    ///
    /// # Errors
    /// When something else is there, or the folder cannot be made.
    pub fn new(target: &Path, replace: bool) -> Result<Self, OutputError> {
        let name = target.file_name().ok_or_else(|| OutputError::NoName { path: target.into() })?;
        if target.exists() && !is_empty_folder(target) {
            match replace {
                false => return Err(OutputError::Occupied { path: target.into() }),
                true if !target.join(MARK).is_file() => {
                    return Err(OutputError::Foreign { path: target.into() });
                }
                true => {}
            }
        }
        let number = RandomState::new().hash_one(0);
        let temporary = target.with_file_name(format!(".{}.{number:016x}.tmp", name.to_string_lossy()));
        fs::create_dir_all(&temporary)
            .map_err(|reason| OutputError::Io { path: temporary.clone(), reason })?;
        Ok(Self { target: target.into(), temporary, is_committed: false })
    }

    /// Where to write.
    pub fn folder(&self) -> &Path {
        &self.temporary
    }

    /// Gives the folder its name. What was there before is removed only after that.
    ///
    /// # Errors
    /// When it cannot be renamed; what was there before is left as it was.
    pub fn commit(mut self) -> Result<(), OutputError> {
        let failed = |reason: io::Error| OutputError::Io { path: self.target.clone(), reason };
        let earlier = self.temporary.with_extension("old");
        let had_earlier = self.target.exists();
        if had_earlier {
            fs::rename(&self.target, &earlier).map_err(failed)?;
        }
        if let Err(reason) = fs::rename(&self.temporary, &self.target) {
            if had_earlier {
                // The first error is the one worth telling.
                let _ = fs::rename(&earlier, &self.target);
            }
            return Err(failed(reason));
        }
        self.is_committed = true;
        if had_earlier {
            fs::remove_dir_all(&earlier)
                .map_err(|reason| OutputError::Io { path: earlier.clone(), reason })?;
        }
        Ok(())
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if !self.is_committed {
            // Nothing can be done about a folder that cannot be removed; its name says that it is temporary.
            let _ = fs::remove_dir_all(&self.temporary);
        }
    }
}

fn is_empty_folder(path: &Path) -> bool {
    fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_appears_whole_and_an_abandoned_one_not_at_all() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        let staged = Staged::new(&target, false).unwrap();
        fs::write(staged.folder().join("a.obj"), "x").unwrap();
        assert!(!target.exists());
        drop(staged);
        assert!(names(place.path()).is_empty());
        let staged = Staged::new(&target, false).unwrap();
        fs::write(staged.folder().join(MARK), "1").unwrap();
        staged.commit().unwrap();
        assert_eq!(names(place.path()), ["out"]);
        assert_eq!(names(&target), [MARK]);
    }

    #[test]
    fn only_an_earlier_drape_is_replaced_and_only_when_asked() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        fs::create_dir(&target).unwrap();
        drop(Staged::new(&target, false).unwrap());
        fs::write(target.join("thesis.tex"), "x").unwrap();
        assert!(matches!(Staged::new(&target, false), Err(OutputError::Occupied { .. })));
        assert!(matches!(Staged::new(&target, true), Err(OutputError::Foreign { .. })));
        fs::write(target.join(MARK), "1").unwrap();
        assert!(matches!(Staged::new(&target, false), Err(OutputError::Occupied { .. })));
        let staged = Staged::new(&target, true).unwrap();
        fs::write(staged.folder().join(MARK), "2").unwrap();
        assert_eq!(fs::read_to_string(target.join(MARK)).unwrap(), "1");
        staged.commit().unwrap();
        assert_eq!(fs::read_to_string(target.join(MARK)).unwrap(), "2");
        assert_eq!((names(place.path()), names(&target)), (vec!["out".into()], vec![MARK.into()]));
        assert!(matches!(Staged::new(Path::new("/"), false), Err(OutputError::NoName { .. })));
    }
}
