//! A folder of records.

use super::record::{Record, StoredArray, encode};
use crate::format::{FileError, atomic};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use thiserror::Error;

/// Why the cache cannot be used.
#[derive(Debug, Error)]
pub enum CacheError {
    /// The folder cannot be made, listed or written to.
    #[error("cache {}: {reason}; hint: check that the folder can be written to and the disk is not full", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        reason: io::Error,
    },
    /// Another record would make the folder larger than allowed.
    #[error(
        "cache {}: {needed} MiB more would exceed its limit of {limit} MiB; hint: raise the limit, or delete the folder \
         (everything in it can be computed anew)",
        path.display()
    )]
    Full {
        /// The folder.
        path: PathBuf,
        /// Size of the record (MiB).
        needed: u64,
        /// The limit (MiB).
        limit: u64,
    },
}

/// Version of the computations behind the records; part of every key.
const VERSION: u64 = 1;

/// Name of a record: the hash of what it was computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key(blake3::Hash);

impl std::fmt::Display for Key {
    /// In hexadecimal digits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Collects what a record depends on.
pub struct KeyBuilder(blake3::Hasher);

impl KeyBuilder {
    /// Starts a key for one kind of record.
    pub fn new(kind: &str) -> Self {
        Self(blake3::Hasher::new()).text(kind).number(VERSION)
    }

    /// A text.
    pub fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    /// A number or a switch.
    pub fn number(self, value: u64) -> Self {
        self.bytes(&value.to_le_bytes())
    }

    /// Numbers in memory order.
    pub fn array<T: bytemuck::NoUninit>(self, values: &[T]) -> Self {
        self.bytes(bytemuck::cast_slice(values))
    }

    /// Another key: what that record depends on, this one does as well.
    pub fn key(self, key: Key) -> Self {
        self.bytes(key.0.as_bytes())
    }

    /// The length goes first, so that no two lists of parts give the same bytes.
    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// The key.
    pub fn finish(self) -> Key {
        Key(self.0.finalize())
    }
}

/// Extension of a record.
const EXTENSION: &str = "safetensors";

/// The store. Cheap to share by reference; all methods may be called from many threads.
#[derive(Debug)]
pub struct ArrayCache {
    root: PathBuf,
    limit: u64,
    /// Bytes in the folder, as far as this process knows.
    used: AtomicU64,
    /// Whether a record that cannot be read was told of: where one is damaged others are, and one warning is enough.
    has_warned: AtomicBool,
}

impl ArrayCache {
    /// Opens the store in `root`, making the folder if needed, with at most `limit_bytes` in it.
    ///
    /// # Errors
    /// [`CacheError::Io`].
    pub fn open(root: &Path, limit_bytes: u64) -> Result<Self, CacheError> {
        let failed = |reason| CacheError::Io { path: root.into(), reason };
        if root.is_file() {
            return Err(failed(io::Error::new(io::ErrorKind::NotADirectory, "it is a file, not a folder")));
        }
        fs::create_dir_all(root).map_err(failed)?;
        let mut used = 0;
        for shelf in fs::read_dir(root).map_err(failed)? {
            let shelf = shelf.map_err(failed)?.path();
            let Ok(files) = fs::read_dir(&shelf) else { continue };
            // Files of earlier forms of the cache are never read again. One that another process removes meanwhile
            // counts nothing.
            let records = files.flatten().filter(|f| f.path().extension().is_some_and(|e| e == EXTENSION));
            used += records.filter_map(|f| f.metadata().ok()).map(|m| m.len()).sum::<u64>();
        }
        Ok(Self {
            root: root.into(),
            limit: limit_bytes,
            used: AtomicU64::new(used),
            has_warned: AtomicBool::new(false),
        })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Bytes in the folder, as far as this process knows.
    pub fn used(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    fn path(&self, key: Key) -> PathBuf {
        let hex = key.0.to_hex();
        self.root.join(&hex[..2]).join(&hex[2..]).with_extension(EXTENSION)
    }

    /// What `read` takes from the record of `key`; `None` if there is none, or it cannot be read. A damaged record is
    /// removed, the first with a warning.
    pub fn get<T>(&self, key: Key, read: impl FnOnce(&Record) -> Result<T, FileError>) -> Option<T> {
        let path = self.path(key);
        match Record::open(&path).and_then(|record| read(&record)) {
            Ok(value) => Some(value),
            Err(error) if error.is_not_found() => None,
            // It may be a good one that cannot be read just now.
            Err(error @ FileError::Io { .. }) => {
                self.warn(&format!("{error}; computed anew"));
                None
            }
            Err(error) => {
                let size = fs::metadata(&path).map_or(0, |m| m.len());
                match fs::remove_file(&path) {
                    Ok(()) => {
                        self.used.fetch_sub(size.min(self.used()), Ordering::Relaxed);
                        self.warn(&format!("{error}; removed, computed anew"));
                    }
                    // It is computed anew each time: slow, not wrong.
                    Err(reason) => {
                        self.warn(&format!("{error}; computed anew, it cannot be removed: {reason}"))
                    }
                }
                None
            }
        }
    }

    fn warn(&self, message: &str) {
        match self.has_warned.swap(true, Ordering::Relaxed) {
            false => tracing::warn!("{message}; so are others that cannot be read"),
            true => tracing::debug!("{message}"),
        }
    }

    /// Whether there is a record of `key` whose table can be read; its arrays are checked when they are.
    pub fn contains(&self, key: Key) -> bool {
        self.get(key, |_| Ok(())).is_some()
    }

    /// Stores a record; one that is there already is left alone.
    ///
    /// # Errors
    /// [`CacheError`] when the folder is full or cannot be written to; nothing half-written is left.
    pub fn put(&self, key: Key, arrays: &[(&str, StoredArray<'_>)]) -> Result<(), CacheError> {
        let path = self.path(key);
        if path.exists() {
            return Ok(());
        }
        let failed = |reason| CacheError::Io { path: path.clone(), reason };
        let bytes = encode(arrays).map_err(|e| failed(io::Error::other(e.to_string())))?;
        let size = bytes.len() as u64;
        if self.used() + size > self.limit {
            let mib = |bytes: u64| bytes.div_ceil(1 << 20);
            return Err(CacheError::Full {
                path: self.root.clone(),
                needed: mib(size),
                limit: mib(self.limit),
            });
        }
        atomic::write(&path, &bytes).map_err(failed)?;
        self.used.fetch_add(size, Ordering::Relaxed);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u64) -> Key {
        KeyBuilder::new("test").number(number).finish()
    }

    #[test]
    fn keys_tell_the_parts_apart() {
        let of = |parts: &[&str]| parts.iter().fold(KeyBuilder::new("t"), |k, p| k.text(p)).finish();
        assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
        assert_ne!(of(&["ab"]), of(&["ab", ""]));
        assert_ne!(KeyBuilder::new("a").finish(), KeyBuilder::new("b").finish());
        assert_eq!(key(4), key(4));
    }

    #[test]
    fn records_survive_the_process_and_damaged_ones_are_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 20).unwrap();
        assert!(!cache.contains(key(1)));
        cache.put(key(1), &[("a", [1u32, 2, 3][..].into())]).unwrap();
        let again = ArrayCache::open(folder.path(), 1 << 20).unwrap();
        assert_eq!(again.used(), cache.used());
        assert_eq!(again.get(key(1), |r| Ok(r.array("a")?.to_vec())), Some(vec![1, 2, 3]));

        let path = again.path(key(1));
        let mut bytes = fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(&path, bytes).unwrap();
        assert_eq!(again.get(key(1), |r| Ok(r.array::<u32>("a")?.to_vec())), None);
        assert!(!path.exists(), "the damaged record is gone");
        again.put(key(1), &[("a", [1u32, 2, 3][..].into())]).unwrap();
        assert!(again.contains(key(1)));
    }

    #[test]
    fn the_limit_is_kept_and_named() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 20).unwrap();
        let large = vec![0.0f32; 150_000];
        cache.put(key(1), &[("a", large.as_slice().into())]).unwrap();
        let error = cache.put(key(2), &[("a", large.as_slice().into())]).unwrap_err();
        assert!(matches!(error, CacheError::Full { .. }) && error.to_string().contains("limit of 1 MiB"));
        assert!(cache.contains(key(1)) && !cache.contains(key(2)));
    }

    #[test]
    fn threads_that_write_the_same_record_agree() {
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 24).unwrap();
        let values: Vec<f32> = (0..20_000).map(|i| i as f32).collect();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for i in 0..20 {
                        cache.put(key(i), &[("a", values.as_slice().into())]).unwrap();
                        assert_eq!(cache.get(key(i), |r| Ok(r.array("a")?.to_vec())).as_ref(), Some(&values));
                    }
                });
            }
        });
        let left: Vec<_> =
            walk(folder.path()).into_iter().filter(|p| p.extension().is_some_and(|e| e == "tmp")).collect();
        assert!(left.is_empty(), "{left:?}");
    }

    fn walk(folder: &Path) -> Vec<PathBuf> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => found.extend(walk(&path)),
                false => found.push(path),
            }
        }
        found
    }
}
