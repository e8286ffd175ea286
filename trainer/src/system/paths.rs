//! Paths: where they lead, what blocks them, and their form in JSON.

use serde::Serializer;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

/// Where `path` leads, with `..` and links followed; what is not there yet is taken as it is written.
///
/// # Errors
/// When `path` is empty, or relative and the working folder is gone.
pub fn destination(path: &Path) -> io::Result<PathBuf> {
    let mut found = PathBuf::new();
    for part in std::path::absolute(path)?.components() {
        match part {
            Component::ParentDir => {
                found.pop();
            }
            part => found.push(part),
        }
        // Part by part: what is above a link is above what it leads to.
        found = fs::canonicalize(&found).unwrap_or(found);
    }
    Ok(found)
}

/// `clothcombo` in the user's folder for what programs may compute anew.
pub fn user_cache() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("clothcombo"))
}

/// What blocks `folder`: something that is no folder, in its place or in that of one it lies in.
pub fn obstacle(folder: &Path) -> Option<&Path> {
    folder.ancestors().find(|path| path.exists()).filter(|path| !path.is_dir())
}

/// A path for JSON, which must be UTF-8 where names of files need not.
///
/// # Errors
/// Those of the serialiser.
pub fn lossy<S: Serializer>(path: &impl AsRef<Path>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.as_ref().to_string_lossy())
}

/// As [`lossy`], of a path that may be missing.
///
/// # Errors
/// Those of the serialiser.
pub fn lossy_option<S: Serializer>(
    path: &Option<impl AsRef<Path>>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => lossy(path, serializer),
        None => serializer.serialize_none(),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn a_path_leads_where_the_system_would_go() {
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir_all(root.join("real/inner")).unwrap();
        symlink(root.join("real/inner"), root.join("link")).unwrap();
        for (path, expected) in [
            ("out/cache", "out/cache"),
            ("real/../out/cache", "out/cache"),
            ("link/new", "real/inner/new"),
            ("link/../new", "real/new"),
            ("missing/../new", "new"),
        ] {
            assert_eq!(destination(&folder.path().join(path)).unwrap(), root.join(expected), "{path}");
        }
        assert!(destination(Path::new("")).is_err());
    }

    #[test]
    fn what_blocks_a_folder_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "x").unwrap();
        assert_eq!(obstacle(&at("file")), Some(at("file").as_path()));
        assert_eq!(obstacle(&at("file/a/b")), Some(at("file").as_path()));
        assert_eq!((obstacle(&at("a/b")), obstacle(Path::new("a"))), (None, None));
    }
}
