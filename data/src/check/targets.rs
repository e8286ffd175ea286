//! Which files a list of paths means.

use crate::asset::Category;
use crate::folders::garment_folder::{MANIFEST, list_garment_folder, read_entries};
use crate::format::{NpzFile, folder, is_mesh_path, way_out};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders are followed this deep.
const MAX_DEPTH: usize = 12;

/// What a manifest says about a garment; nothing without one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ManifestHints {
    /// Category.
    pub category: Option<Category>,
    /// Lowest and highest layer.
    pub layer: Option<[u32; 2]>,
    /// Whether it is held.
    pub holding: Option<bool>,
}

/// A file to check.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// A mesh, and what its manifest says.
    Garment {
        /// The file.
        path: PathBuf,
        /// From `garments.toml`.
        entry: ManifestHints,
    },
    /// A body or a motion.
    Npz {
        /// The file.
        path: PathBuf,
    },
    /// A mesh that the `garments.toml` beside it leaves out.
    Unlisted {
        /// The file.
        path: PathBuf,
    },
    /// Something that is known to be wrong before it is opened.
    Unusable {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl Target {
    /// The file.
    pub fn path(&self) -> &Path {
        match self {
            Self::Garment { path, .. }
            | Self::Npz { path }
            | Self::Unlisted { path }
            | Self::Unusable { path, .. } => path,
        }
    }
}

/// All meshes and npz files of `paths`: files as they are, folders with everything below them, sorted by name. In a folder with a
/// `garments.toml` the garments are the meshes it lists.
pub fn find_targets(paths: &[PathBuf]) -> Vec<Target> {
    let mut targets = Vec::new();
    for path in paths {
        match fs::metadata(path) {
            Ok(m) if m.is_dir() => {
                let before = targets.len();
                visit(path, 0, &mut HashSet::new(), &mut targets);
                if targets.len() == before {
                    let reason = format!("{}: no garments, bodies or motions in it", path.display());
                    targets.push(Target::Unusable { path: path.clone(), reason });
                }
            }
            Ok(_) => targets.push(file_target(path).unwrap_or_else(|| Target::Unusable {
                path: path.clone(),
                reason: format!(
                    "{}: {}",
                    path.display(),
                    way_out(path).unwrap_or_else(|| {
                        "no known kind of file; garments are .obj, .ply, .stl, .gltf or .glb, bodies and motions .npz".into()
                    })
                ),
            })),
            Err(e) => {
                targets.push(Target::Unusable { path: path.clone(), reason: format!("{}: {e}", path.display()) });
            }
        }
    }
    targets
}

/// Whether a file is a body npz, by its keys.
fn is_body_file(path: &Path) -> bool {
    NpzFile::open(path).is_ok_and(|file| file.contains("v_template"))
}

/// The one body among `targets`; none where there are several.
pub fn only_body(targets: &[Target]) -> Option<&Path> {
    let mut bodies = targets.iter().filter_map(|target| match target {
        Target::Npz { path } if is_body_file(path) => Some(path.as_path()),
        _ => None,
    });
    bodies.next().filter(|_| bodies.next().is_none())
}

fn file_target(path: &Path) -> Option<Target> {
    if is_mesh_path(path) {
        return Some(Target::Garment { path: path.into(), entry: ManifestHints::default() });
    }
    folder::has_extension(path, "npz").then(|| Target::Npz { path: path.into() })
}

/// `seen`: the folders that were visited, by their real paths; links may lead back.
fn visit(path: &Path, depth: usize, seen: &mut HashSet<PathBuf>, targets: &mut Vec<Target>) {
    if !seen.insert(fs::canonicalize(path).unwrap_or_else(|_| path.into())) {
        return;
    }
    let wrong = |reason: String| Target::Unusable { path: path.into(), reason };
    let children = match folder::entries(path) {
        Ok(children) => children,
        Err(e) => return targets.push(wrong(e.to_string())),
    };
    let manifest = path.join(MANIFEST);
    let has_manifest = manifest.exists();
    // None where a manifest cannot be read, too: it is among the targets, and leaves nothing out.
    let mut listed: Option<HashSet<PathBuf>> = None;
    if has_manifest {
        match read_entries(path) {
            Ok(entries) => {
                let before = targets.len();
                listed = Some(entries.iter().map(|entry| path.join(entry.file())).collect());
                targets.extend(entries.into_iter().map(|entry| {
                    let path = path.join(entry.file());
                    if path.is_file() {
                        let (category, layer, holding) = (entry.category, entry.layer, entry.holding);
                        Target::Garment { path, entry: ManifestHints { category, layer, holding } }
                    } else {
                        let reason =
                            format!("{}: {MANIFEST} lists it, but there is no such file", path.display());
                        Target::Unusable { path, reason }
                    }
                }));
                // What it lists is there, but training may refuse the list.
                if targets[before..].iter().all(|target| matches!(target, Target::Garment { .. }))
                    && let Err(e) = list_garment_folder(path)
                {
                    targets.push(Target::Unusable { path: manifest, reason: e.to_string() });
                }
            }
            Err(e) => targets.push(Target::Unusable { path: manifest, reason: e.to_string() }),
        }
    }
    for child in children {
        if child.is_dir() {
            if depth < MAX_DEPTH {
                visit(&child, depth + 1, seen, targets);
            }
        } else if !(has_manifest && is_mesh_path(&child)) {
            targets.extend(file_target(&child));
        } else if listed.as_ref().is_some_and(|listed| !listed.contains(&child)) {
            targets.push(Target::Unlisted { path: child });
        }
    }
}
