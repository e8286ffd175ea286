//! Files that appear whole or not at all.

use std::ffi::OsString;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::{fs, mem};

/// Writes `bytes` beside `path` under a temporary name, syncs, and renames it into place, so that nobody sees half a file.
/// Missing parent folders are made.
///
/// # Errors
/// Any error of the file system; what was made is gone then.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut name: OsString = path.file_name().unwrap_or_default().into();
    // Random, not the process number: several threads, processes or machines may be writing the same file.
    name.push(format!(".{:016x}.tmp", RandomState::new().hash_one(0)));
    let temporary = Temporary::new(path.with_file_name(name));
    if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(parent)?;
    }
    let mut file = fs::File::create(temporary.path())?;
    io::Write::write_all(&mut file, bytes)?;
    file.sync_all()?;
    fs::rename(temporary.path(), path)?;
    temporary.keep();
    Ok(())
}

/// The temporary files and folders of this process, each with the outermost folder that is made for it, if any.
static TEMPORARY_PATHS: Mutex<Vec<(PathBuf, Option<PathBuf>)>> = Mutex::new(Vec::new());

/// The name of a file or folder that is not whole yet. What is there, and the folders that were missing above it, is removed when
/// this is dropped, or where the process ends before that ([`remove_temporary`]), unless it is [kept](Self::keep).
#[derive(Debug)]
pub struct Temporary(PathBuf);

impl Temporary {
    /// Nothing needs to be there yet.
    pub fn new(path: PathBuf) -> Self {
        let made = first_missing_folder(&path).map(Path::to_owned);
        TEMPORARY_PATHS.lock().unwrap_or_else(PoisonError::into_inner).push((path.clone(), made));
        Self(path)
    }

    /// The name.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Whatever there is now, under this name or another, stays.
    pub fn keep(self) {
        self.forget();
        mem::forget(self);
    }

    /// Gives this folder the name `target`. A folder that has it is set aside first and removed last, so that one of them is there
    /// whatever happens.
    ///
    /// # Errors
    /// When it cannot be renamed; what was there before is left as it was. When what was there cannot be removed.
    pub fn replace(self, target: &Path) -> io::Result<()> {
        let earlier = self.0.with_extension("old");
        let had_earlier = target.exists();
        if had_earlier {
            if earlier.exists() {
                // Of a process that was killed before it removed it.
                fs::remove_dir_all(&earlier)?;
            }
            fs::rename(target, &earlier)?;
        }
        if let Err(reason) = fs::rename(&self.0, target) {
            if had_earlier {
                // The first error is the one worth telling.
                let _ = fs::rename(&earlier, target);
            }
            return Err(reason);
        }
        self.keep();
        if had_earlier { fs::remove_dir_all(&earlier) } else { Ok(()) }
    }

    fn forget(&self) -> Option<(PathBuf, Option<PathBuf>)> {
        let mut all = TEMPORARY_PATHS.lock().unwrap_or_else(PoisonError::into_inner);
        let own = all.iter().position(|(path, _)| *path == self.0)?;
        Some(all.swap_remove(own))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some((path, made)) = self.forget() {
            remove(&path, made.as_deref());
        }
    }
}

/// Removes what this process has not finished: for its end by a signal, or for want of memory.
pub fn remove_temporary() {
    // Where another thread holds the list, or the end came while it grew, nothing is done: the names say what they are.
    let Ok(mut all) = TEMPORARY_PATHS.try_lock() else { return };
    all.drain(..).for_each(|(path, made)| remove(&path, made.as_deref()));
}

/// Nothing can be done about what cannot be removed; its name says that it is temporary.
fn remove(path: &Path, made: Option<&Path>) {
    let _ = match path.is_dir() {
        true => fs::remove_dir_all(path),
        false => fs::remove_file(path),
    };
    let Some(first) = made else { return };
    for folder in path.ancestors().skip(1).take_while(|folder| folder.starts_with(first)) {
        // One that something else has come into stays.
        let _ = fs::remove_dir(folder);
    }
}

/// The outermost folder that would have to be made for `path` to lie in; none if all are there.
fn first_missing_folder(path: &Path) -> Option<&Path> {
    let folders = path.ancestors().skip(1).filter(|folder| !folder.as_os_str().is_empty());
    folders.take_while(|folder| !folder.exists()).last()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_whole_or_leaves_nothing() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        write(&at("a/b/file"), b"x").unwrap();
        assert_eq!(fs::read(at("a/b/file")).unwrap(), b"x");
        // A folder has the name: the file, and the folder that was made for it, are gone again.
        fs::create_dir_all(at("c/taken")).unwrap();
        assert!(write(&at("c/taken"), b"x").is_err());
        assert_eq!(fs::read_dir(at("c")).unwrap().count(), 1);
        let abandoned = Temporary::new(at("d/e/half"));
        fs::create_dir_all(abandoned.path()).unwrap();
        fs::write(abandoned.path().join("part"), "x").unwrap();
        drop(abandoned);
        assert!(!at("d").exists());
        for part in ["1", "2"] {
            let kept = Temporary::new(at("d/e/half"));
            fs::create_dir_all(kept.path()).unwrap();
            fs::write(kept.path().join(part), part).unwrap();
            kept.replace(&at("d/e/whole")).unwrap();
        }
        assert!(at("d/e/whole/2").exists() && !at("d/e/whole/1").exists());
        assert_eq!(fs::read_dir(at("d/e")).unwrap().count(), 1);
        // What cannot be replaced stays.
        assert!(Temporary::new(at("d/e/none")).replace(&at("d/e/whole")).is_err());
        assert!(at("d/e/whole/2").exists());
    }

    #[test]
    fn missing_folders_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert_eq!(first_missing_folder(&at("a/b/c")), Some(at("a").as_path()));
        assert_eq!((first_missing_folder(&at("a")), first_missing_folder(Path::new("a"))), (None, None));
    }
}
