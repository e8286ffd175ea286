//! A folder of garments: OBJ, PLY, STL or glTF files at rest on the zero body, with an optional manifest `garments.toml`.
//!
//! ```toml
//! [[garment]]
//! file = "Tank_Top_01.obj"   # relative to the folder; the only required key
//! name = "Tank_Top_01"       # default: the file's name
//! category = "top"           # dress | top | t_shirt | open_shirt | skirt | trousers; default: guessed from the shape
//! layer = [1, 3]             # between which layers it is worn
//! holding = true             # default: the collarbone rule
//! source = "…"
//! author = "…"
//! licence = "CC0-1.0"
//! ```
//! Without a manifest every mesh file in the folder is a garment.

mod write;

pub use write::{garment_folder_files, refuse_unlisted, save_garment, save_garment_folder, save_manifest};

use crate::asset::{Body, Category, Garment, Provenance};
use crate::format::{FileError, MeshFileError, is_mesh_path, load_tri_mesh};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Name of the manifest in a garment folder.
pub const MANIFEST: &str = "garments.toml";

/// Why a garment folder cannot be used.
#[derive(Debug, Error)]
pub enum GarmentFolderError {
    /// The folder, its manifest or a mesh cannot be read or written.
    #[error(transparent)]
    Io(#[from] FileError),
    /// The manifest is not as it should be; the message shows line and column.
    #[error("{}: {message}", path.display())]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What the TOML reader said.
        message: String,
    },
    /// A manifest entry is wrong.
    #[error("{}: garment {entry} ('{file}'): {message}", path.display())]
    Entry {
        /// The manifest, or the folder without one.
        path: PathBuf,
        /// Number of the entry, from 1.
        entry: usize,
        /// Its file.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// No garment in it.
    #[error("{}: no garments; put OBJ, PLY, STL or glTF files there, or list them in {MANIFEST}", path.display())]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// A folder without a list holds another garment.
    #[error(
        "{} is there already and would no longer be found: {MANIFEST}, which is written, lists only what is made; hint: choose another folder",
        path.display()
    )]
    Unlisted {
        /// The other garment's mesh.
        path: PathBuf,
    },
    /// A mesh is unusable.
    #[error(transparent)]
    Mesh(#[from] MeshFileError),
}

/// A garment of a folder with its layer hint.
#[derive(Clone, Debug)]
pub struct FolderGarment {
    /// The garment.
    pub garment: Garment,
    /// Lowest and highest layer it is worn in, if the manifest says so.
    pub layer: Option<[u32; 2]>,
    /// Its mesh file.
    pub path: PathBuf,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default)]
    garment: Vec<ManifestEntry>,
}

/// One garment as the manifest lists it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestEntry {
    file: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) category: Option<Category>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) layer: Option<[u32; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) holding: Option<bool>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    source: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    author: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    licence: String,
}

/// A garment of a folder, listed but not yet read.
#[derive(Clone, Debug)]
pub struct ListedGarment {
    /// Its mesh file.
    pub path: PathBuf,
    /// Its name, unique within the folder.
    pub name: String,
    /// Its category, if the manifest says so.
    pub category: Option<Category>,
    /// Whether it is held, if the manifest says so.
    pub holding: Option<bool>,
    /// Lowest and highest layer it is worn in, if the manifest says so.
    pub layer: Option<[u32; 2]>,
    /// Where it comes from.
    pub source: Provenance,
}

impl ListedGarment {
    /// Reads the mesh and tells its number of vertices.
    ///
    /// # Errors
    /// [`MeshFileError`] naming file and line or element.
    pub fn vertex_count(&self) -> Result<usize, MeshFileError> {
        Ok(load_tri_mesh(&self.path)?.vertex_count())
    }

    /// Reads the mesh. `body` is needed for the guesses: category and the collarbone rule.
    ///
    /// # Errors
    /// [`MeshFileError`] naming file and line or element.
    pub fn load(&self, body: &Body) -> Result<FolderGarment, MeshFileError> {
        let rest = load_tri_mesh(&self.path)?;
        let category = self.category.unwrap_or_else(|| Category::guess(&rest, body));
        let holding = self.holding.unwrap_or_else(|| Garment::needs_holding(&rest, body));
        let garment =
            Garment { name: self.name.clone(), category, rest, holding, source: self.source.clone() };
        Ok(FolderGarment { garment, layer: self.layer, path: self.path.clone() })
    }
}

/// Reads all garments of a folder, in manifest order or, without a manifest, sorted by file name. `body` is needed for the
/// guesses: category and the collarbone rule.
///
/// # Errors
/// [`GarmentFolderError`] naming folder, manifest entry, or mesh file and line or element.
pub fn load_garment_folder(folder: &Path, body: &Body) -> Result<Vec<FolderGarment>, GarmentFolderError> {
    let listed = list_garment_folder(folder)?;
    Ok(listed.par_iter().map(|garment| garment.load(body)).collect::<Result<_, _>>()?)
}

/// Lists the garments of a folder without reading their meshes.
///
/// # Errors
/// [`GarmentFolderError`] naming folder or manifest entry.
pub fn list_garment_folder(folder: &Path) -> Result<Vec<ListedGarment>, GarmentFolderError> {
    let manifest_path = folder.join(MANIFEST);
    let entries = read_entries(folder)?;
    let place = if manifest_path.is_file() { manifest_path } else { folder.to_owned() };
    let mut names: HashMap<String, String> = HashMap::new();
    let mut garments = Vec::with_capacity(entries.len());
    for (number, entry) in entries.into_iter().enumerate() {
        let wrong = |message: String| GarmentFolderError::Entry {
            path: place.clone(),
            entry: number + 1,
            file: entry.file.clone(),
            message,
        };
        let path = folder.join(&entry.file);
        if !path.is_file() {
            return Err(wrong("there is no such file in the folder".into()));
        }
        if let Some([low, high]) = entry.layer
            && low > high
        {
            return Err(wrong(format!("layer = [{low}, {high}] should be [lowest, highest]")));
        }
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let name = entry.name.clone().unwrap_or(stem);
        if let Some(other) = names.insert(name.clone(), entry.file.clone()) {
            return Err(wrong(format!(
                "it has the name '{name}' of '{other}'; rename one, or give it another `name` in {MANIFEST}"
            )));
        }
        garments.push(ListedGarment {
            path,
            name,
            category: entry.category,
            holding: entry.holding,
            layer: entry.layer,
            source: Provenance { source: entry.source, author: entry.author, licence: entry.licence },
        });
    }
    Ok(garments)
}

/// What the manifest lists or, without one, every mesh file of the folder; at least one.
pub(crate) fn read_entries(folder: &Path) -> Result<Vec<ManifestEntry>, GarmentFolderError> {
    let path = folder.join(MANIFEST);
    let entries = match fs::read_to_string(&path) {
        Ok(text) => manifest_from(&path, &text)?.garment,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => list_mesh_files(folder)?
            .into_iter()
            .map(|file| ManifestEntry { file, ..ManifestEntry::default() })
            .collect(),
        Err(reason) => return Err(FileError { path, reason }.into()),
    };
    if entries.is_empty() {
        return Err(GarmentFolderError::Empty { path: folder.into() });
    }
    Ok(entries)
}

fn list_mesh_files(folder: &Path) -> Result<Vec<String>, GarmentFolderError> {
    let failed = FileError::at(folder);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(&failed)? {
        let path = entry.map_err(&failed)?.path();
        if let Some(name) = path.file_name().and_then(|n| n.to_str()).filter(|_| is_mesh_path(&path)) {
            files.push(name.to_string());
        }
    }
    files.sort();
    Ok(files)
}

impl ManifestEntry {
    /// The entry of a garment whose file is `<name>.obj`.
    pub fn of(FolderGarment { garment, layer, .. }: &FolderGarment) -> Self {
        let Provenance { source, author, licence } = garment.source.clone();
        Self {
            file: format!("{}.obj", garment.name),
            name: Some(garment.name.clone()),
            category: Some(garment.category),
            layer: *layer,
            holding: Some(garment.holding),
            source,
            author,
            licence,
        }
    }

    /// The garment's file, relative to the folder.
    pub fn file(&self) -> &str {
        &self.file
    }
}

/// The entries of a folder's manifest; none where it has no manifest.
///
/// # Errors
/// [`GarmentFolderError`] if there is one that cannot be read.
pub fn read_manifest(folder: &Path) -> Result<Vec<ManifestEntry>, GarmentFolderError> {
    let path = folder.join(MANIFEST);
    match fs::read_to_string(&path) {
        Ok(text) => Ok(manifest_from(&path, &text)?.garment),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(reason) => Err(FileError { path, reason }.into()),
    }
}

fn manifest_from(path: &Path, text: &str) -> Result<Manifest, GarmentFolderError> {
    toml::from_str(text).map_err(|e| GarmentFolderError::Manifest {
        path: path.into(),
        message: e.to_string().trim_end().to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::mesh::shapes::tube;

    fn folder_with(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1 0 0 0 1 0 3 0 1 2\n";
    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn saved_garments_load_again_with_everything() {
        let body = mannequin();
        let source = Provenance { source: "s".into(), author: "a \"b\"".into(), licence: "CC0-1.0".into() };
        let garment = Garment {
            name: "ring".into(),
            category: Category::Skirt,
            rest: tube(0.2, 0.3, 16, 4),
            holding: true,
            source,
        };
        let folder = tempfile::tempdir().unwrap();
        let saved = FolderGarment { garment, layer: Some([1, 3]), path: PathBuf::new() };
        let written = save_garment_folder(folder.path(), std::slice::from_ref(&saved)).unwrap();
        assert_eq!(written.len(), 2);
        let loaded = load_garment_folder(folder.path(), &body).unwrap();
        let [one] = &loaded[..] else { panic!() };
        assert_eq!((one.layer, &one.garment.source), (saved.layer, &saved.garment.source));
        assert_eq!((one.garment.category, one.garment.holding), (Category::Skirt, true));
        assert_eq!(one.garment.rest.faces(), saved.garment.rest.faces());
        for (a, b) in
            one.garment.rest.positions().iter().flatten().zip(saved.garment.rest.positions().iter().flatten())
        {
            assert!((a - b).abs() < 1e-7);
        }
    }

    #[test]
    fn what_a_folder_lists_stays_listed_and_what_it_does_not_list_is_not_hidden() {
        let named = |name: &str, height: f64| {
            let rest = tube(0.1, height, 8, 4);
            let source = Provenance::default();
            let garment =
                Garment { name: name.into(), category: Category::Top, rest, holding: false, source };
            FolderGarment { garment, layer: None, path: PathBuf::new() }
        };
        let folder = folder_with(&[]);
        save_garment_folder(folder.path(), &[named("a", 0.2), named("b", 0.2)]).unwrap();
        save_garment_folder(folder.path(), &[named("b", 0.3), named("c", 0.2)]).unwrap();
        let listed: Vec<String> =
            list_garment_folder(folder.path()).unwrap().into_iter().map(|g| g.name).collect();
        assert_eq!(listed, ["a", "b", "c"]);

        let own = folder_with(&[("shirt.obj", TRIANGLE)]);
        let refused = save_garment_folder(own.path(), &[named("a", 0.2)]).unwrap_err();
        assert!(matches!(&refused, GarmentFolderError::Unlisted { path } if path.ends_with("shirt.obj")));
        assert!(!own.path().join("a.obj").exists());
    }

    #[test]
    fn without_a_manifest_every_mesh_is_a_garment() {
        let folder =
            folder_with(&[("b.obj", TRIANGLE), ("a.OBJ", TRIANGLE), ("c.ply", PLY), ("notes.txt", "x")]);
        let names: Vec<String> = load_garment_folder(folder.path(), &mannequin())
            .unwrap()
            .into_iter()
            .map(|g| g.garment.name)
            .collect();
        assert_eq!(names, ["a", "b", "c"]);
    }

    #[test]
    fn each_mistake_is_named_with_its_place() {
        let body = mannequin();
        let entry = "[[garment]]\nfile = \"a.obj\"\n";
        for (manifest, parts) in [
            (format!("{entry}colour = \"red\"\n"), ["garments.toml", "line 3", "`colour`"]),
            (format!("{entry}category = \"socks\"\n"), ["garments.toml", "line 3", "open_shirt"]),
            ("[[garment]]\nfile = \"none.obj\"\n".into(), ["garments.toml", "none.obj", "garment 1"]),
            (format!("{entry}{entry}"), ["garment 2", "'a'", "of 'a.obj'"]),
            (format!("{entry}layer = [3, 1]\n"), ["garment 1", "[3, 1]", "lowest"]),
            (String::new(), ["no garments", "OBJ", "garments.toml"]),
        ] {
            let folder = folder_with(&[("a.obj", TRIANGLE), (MANIFEST, &manifest)]);
            let message = load_garment_folder(folder.path(), &body).unwrap_err().to_string();
            assert!(parts.iter().all(|p| message.contains(p)), "{message}");
        }
        let folder = folder_with(&[("a.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")]);
        let message = load_garment_folder(folder.path(), &body).unwrap_err().to_string();
        assert!(message.contains("a.obj:3:"), "{message}");
        let folder = folder_with(&[("tee.obj", TRIANGLE), ("tee.ply", PLY)]);
        let message = load_garment_folder(folder.path(), &body).unwrap_err().to_string();
        assert!(["'tee.obj'", "'tee.ply'"].iter().all(|file| message.contains(file)), "{message}");
        let empty = folder_with(&[]);
        assert!(matches!(load_garment_folder(empty.path(), &body), Err(GarmentFolderError::Empty { .. })));
        let missing = load_garment_folder(&empty.path().join("x"), &body).unwrap_err();
        assert!(matches!(missing, GarmentFolderError::Io(_)));
    }
}
