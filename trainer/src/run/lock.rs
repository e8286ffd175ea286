//! One process per run folder.
//!
//! The system drops the lock when the process ends, however it ends: nothing has to be cleaned up after a `kill -9`.

use super::error::RunDirError;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::time::Duration;

/// Its name in the run's folder.
pub(super) const LOCK_FILE: &str = "lock";

/// Looks at a held lock before it counts as held: a program that only asks whether a run is alive holds it for an instant.
const LOCK_ATTEMPTS: u32 = 5;

/// The right to write into a run folder.
#[derive(Debug)]
pub struct RunLock {
    _file: File,
}

impl RunLock {
    /// Locks `root`, which must exist.
    ///
    /// # Errors
    /// When another process holds it, or the file cannot be written.
    pub fn acquire(root: &Path) -> Result<Self, RunDirError> {
        let path = root.join(LOCK_FILE);
        let failed = |reason| RunDirError::Io { path: path.clone(), reason };
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)?;
        for attempt in 1..=LOCK_ATTEMPTS {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if attempt == LOCK_ATTEMPTS => {
                    let mut owner = String::new();
                    let _ = file.read_to_string(&mut owner);
                    let owner =
                        if owner.trim().is_empty() { "another process".into() } else { owner.trim().into() };
                    return Err(RunDirError::InUse { path: root.to_owned(), owner });
                }
                Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(50)),
                Err(TryLockError::Error(e)) => {
                    // Some network file systems know no locks; training there is better than none.
                    tracing::warn!(
                        "{} cannot be locked ({e}): start only one run in the folder",
                        path.display()
                    );
                    break;
                }
            }
        }
        let mut write = || {
            file.set_len(0)?;
            file.seek(SeekFrom::Start(0))?;
            writeln!(file, "process {}", std::process::id())
        };
        write().map_err(failed)?;
        Ok(Self { _file: file })
    }

    /// Whether some process holds the lock of `root`.
    pub fn is_held(root: &Path) -> bool {
        let Ok(file) = File::open(root.join(LOCK_FILE)) else { return false };
        matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_until_dropped() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!RunLock::is_held(folder.path()));
        let lock = RunLock::acquire(folder.path()).unwrap();
        assert!(RunLock::is_held(folder.path()));
        assert!(matches!(RunLock::acquire(folder.path()), Err(RunDirError::InUse { .. })));
        drop(lock);
        assert!(!RunLock::is_held(folder.path()));
        RunLock::acquire(folder.path()).unwrap();
    }
}
