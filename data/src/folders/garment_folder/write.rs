//! Writes a folder of garments.

use super::{MANIFEST, Manifest, ManifestEntry, read_manifest};
use crate::asset::Garment;
use crate::format::{FileError, is_mesh_path, obj, toml_file};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Writes one garment as `<name>.obj` and returns its manifest entry, for [`save_manifest`]: for more garments than fit in
/// memory. The file appears whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn save_garment(folder: &Path, garment: &Garment) -> Result<ManifestEntry, FileError> {
    let entry = ManifestEntry::of(garment);
    let Garment { name, category, rest, .. } = garment;
    let comments = [
        format!("{name} ({category}), metres, y up, on the zero body in T-pose"),
        format!("source: {}", entry.source),
        format!("author: {}", entry.author),
        format!("licence: {}", entry.licence),
    ];
    obj::save(&folder.join(&entry.file), rest.positions(), rest.faces(), &comments)?;
    Ok(entry)
}

/// Writes the manifest of a folder and returns its path.
///
/// # Errors
/// If it cannot be written.
pub fn save_manifest(folder: &Path, entries: Vec<ManifestEntry>) -> Result<PathBuf, FileError> {
    let path = folder.join(MANIFEST);
    toml_file::save(&path, &Manifest { garment: entries })?;
    Ok(path)
}

/// The files that [`save_garment_folder`] writes.
pub fn garment_folder_files(folder: &Path, garments: &[Garment]) -> Vec<PathBuf> {
    let files = garments.iter().map(|g| format!("{}.obj", g.name));
    files.chain([MANIFEST.into()]).map(|file| folder.join(file)).collect()
}

/// Refuses a `folder` without a list in which a mesh lies that is none of `files`: the list that is to be written would hide it.
///
/// # Errors
/// [`FileError`] naming the mesh.
pub fn refuse_unlisted(folder: &Path, files: &HashSet<PathBuf>) -> Result<(), FileError> {
    if folder.join(MANIFEST).exists() {
        return Ok(());
    }
    let there = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    match there.filter(|path| is_mesh_path(path)).find(|path| !files.contains(path)) {
        Some(path) => Err(FileError::content(&path)(format!(
            "it is there already and would no longer be found: {MANIFEST}, which is written, lists only what is made; hint: \
             choose another folder"
        ))),
        None => Ok(()),
    }
}

/// Writes garments as `<name>.obj` and lists them in the manifest, beside what it lists already; the manifest comes last, so that
/// a folder with one is complete. Returns the files written.
///
/// # Errors
/// If the folder holds garments that it does not list, its manifest cannot be read, or a file cannot be written.
pub fn save_garment_folder(folder: &Path, garments: &[Garment]) -> Result<Vec<PathBuf>, FileError> {
    let files = garment_folder_files(folder, garments);
    refuse_unlisted(folder, &files.iter().cloned().collect())?;
    let mut entries = read_manifest(folder)?;
    for garment in garments {
        let entry = save_garment(folder, garment)?;
        entries.retain(|listed| listed.file != entry.file);
        entries.push(entry);
    }
    save_manifest(folder, entries)?;
    Ok(files)
}
