//! Files that appear whole or not at all.

use std::ffi::OsString;
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::Path;

/// Writes `bytes` beside `path` under a temporary name, syncs, and renames it into place, so that nobody sees half a file.
/// Missing parent folders are made.
///
/// # Errors
/// Any error of the file system.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(parent) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(parent)?;
    }
    let mut name: OsString = path.file_name().unwrap_or_default().into();
    // Random, not the process number: several threads, processes or machines may be writing the same file.
    name.push(format!(".{:016x}.tmp", RandomState::new().hash_one(0)));
    let temporary = path.with_file_name(name);
    let written = (|| {
        let mut file = fs::File::create(&temporary)?;
        io::Write::write_all(&mut file, bytes)?;
        file.sync_all()?;
        fs::rename(&temporary, path)
    })();
    if written.is_err() {
        // The first error is the one worth telling; a leftover temporary file is harmless.
        let _ = fs::remove_file(&temporary);
    }
    written
}
