//! A folder of garments: OBJ, PLY, STL or glTF files at rest on the zero body, with an optional manifest `garments.toml`.
//!
//! ```toml
//! [[garment]]
//! file = "Tank_Top_01.obj"   # relative to the folder; the only required key
//! name = "Tank_Top_01"       # default: the file's name
//! category = "top"           # dress | top | t_shirt | open_shirt | skirt | trousers; default: guessed from the shape
//! layer = [1, 3]             # lowest and highest layer it may be in
//! holding = true             # default: the collarbone rule
//! material = { thickness = 0.003 }   # what it is made of, where that is not the configuration's (GarmentMaterial)
//! source = "…"
//! author = "…"
//! licence = "CC0-1.0"
//! ```
//! Without a manifest every mesh file in the folder is a garment.

mod write;

pub use write::{garment_folder_files, refuse_unlisted, save_garment, save_garment_folder, save_manifest};

use crate::asset::{Body, Category, Garment, GarmentMaterial, Provenance};
use crate::format::{FileError, folder, is_mesh_path, load_tri_mesh, toml_file};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Name of the manifest in a garment folder.
pub const MANIFEST: &str = "garments.toml";

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
    #[serde(default, skip_serializing_if = "GarmentMaterial::is_empty")]
    material: GarmentMaterial,
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
    /// Lowest and highest layer it may be in, if the manifest says so.
    pub layer: Option<[u32; 2]>,
    /// What it is made of, where the manifest says so.
    pub material: GarmentMaterial,
    /// Where it comes from.
    pub source: Provenance,
}

impl ListedGarment {
    /// Reads the mesh and tells its number of vertices.
    ///
    /// # Errors
    /// [`FileError`] naming file and line or element.
    pub fn vertex_count(&self) -> Result<usize, FileError> {
        Ok(load_tri_mesh(&self.path)?.vertex_count())
    }

    /// Reads the mesh. `body` is needed for the guesses: category and the collarbone rule.
    ///
    /// # Errors
    /// [`FileError`] naming file and line or element.
    pub fn load(&self, body: &Body) -> Result<Garment, FileError> {
        let rest = load_tri_mesh(&self.path)?;
        let category = self.category.unwrap_or_else(|| Category::guess(&rest, body));
        let holding = self.holding.unwrap_or_else(|| Garment::needs_holding(&rest, body));
        let (name, source) = (self.name.clone(), self.source.clone());
        Ok(Garment { name, category, rest, holding, material: self.material, source })
    }
}

/// Reads all garments of a folder, in manifest order or, without a manifest, sorted by file name. `body` is needed for the
/// guesses: category and the collarbone rule.
///
/// # Errors
/// [`FileError`] naming folder, manifest entry, or mesh file and line or element.
pub fn load_garment_folder(folder: &Path, body: &Body) -> Result<Vec<Garment>, FileError> {
    let listed = list_garment_folder(folder)?;
    listed.par_iter().map(|garment| garment.load(body)).collect()
}

/// Lists the garments of a folder without reading their meshes.
///
/// # Errors
/// [`FileError`] naming folder or manifest entry.
pub fn list_garment_folder(folder: &Path) -> Result<Vec<ListedGarment>, FileError> {
    let manifest_path = folder.join(MANIFEST);
    let entries = read_entries(folder)?;
    let place = if manifest_path.is_file() { manifest_path } else { folder.to_owned() };
    let mut names: HashMap<String, String> = HashMap::new();
    let mut garments = Vec::with_capacity(entries.len());
    for (number, entry) in entries.into_iter().enumerate() {
        let wrong = |message: String| {
            let (number, file) = (number + 1, &entry.file);
            FileError::content(&place)(format!("garment {number} ('{file}'): {message}"))
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
        entry.material.check().map_err(wrong)?;
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
            material: entry.material,
            source: Provenance { source: entry.source, author: entry.author, licence: entry.licence },
        });
    }
    Ok(garments)
}

/// What the manifest lists or, without one, every mesh file of the folder; at least one.
pub(crate) fn read_entries(folder: &Path) -> Result<Vec<ManifestEntry>, FileError> {
    let path = folder.join(MANIFEST);
    let entries = match toml_file::load::<Manifest>(&path)? {
        Some(manifest) => manifest.garment,
        None => list_mesh_files(folder)?
            .into_iter()
            .map(|file| ManifestEntry { file, ..ManifestEntry::default() })
            .collect(),
    };
    if entries.is_empty() {
        return Err(FileError::content(folder)(format!(
            "no garments; put OBJ, PLY, STL or glTF files there, or list them in {MANIFEST}"
        )));
    }
    Ok(entries)
}

fn list_mesh_files(path: &Path) -> Result<Vec<String>, FileError> {
    let meshes = folder::entries(path)?.into_iter().filter(|file| is_mesh_path(file));
    Ok(meshes.filter_map(|file| Some(file.file_name()?.to_str()?.to_string())).collect())
}

impl ManifestEntry {
    /// The entry of a garment whose file is `<name>.obj`.
    pub fn of(garment: &Garment) -> Self {
        let Provenance { source, author, licence } = garment.source.clone();
        Self {
            file: format!("{}.obj", garment.name),
            name: Some(garment.name.clone()),
            category: Some(garment.category),
            layer: None,
            holding: Some(garment.holding),
            material: garment.material,
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
/// [`FileError`] if there is one that cannot be read.
pub fn read_manifest(folder: &Path) -> Result<Vec<ManifestEntry>, FileError> {
    Ok(toml_file::load::<Manifest>(&folder.join(MANIFEST))?
        .map_or_else(Vec::new, |manifest| manifest.garment))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::mesh::shapes::tube;
    use std::fs;

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
        let ring = Garment::new(Category::Skirt, tube(0.2, 0.3, 16, 4));
        let material = "thickness=0.003".parse().unwrap();
        let garment = Garment { name: "ring".into(), holding: true, material, source, ..ring };
        let folder = tempfile::tempdir().unwrap();
        let written = save_garment_folder(folder.path(), std::slice::from_ref(&garment)).unwrap();
        assert_eq!(written.len(), 2);
        let loaded = load_garment_folder(folder.path(), &body).unwrap();
        let [one] = &loaded[..] else { panic!() };
        assert_eq!(one.source, garment.source);
        assert_eq!((one.category, one.holding), (Category::Skirt, true));
        assert_eq!(one.material, material);
        assert_eq!(one.rest.faces(), garment.rest.faces());
        for (a, b) in one.rest.positions().iter().flatten().zip(garment.rest.positions().iter().flatten()) {
            assert!((a - b).abs() < 1e-7);
        }
        let manifest = fs::read_to_string(folder.path().join(MANIFEST)).unwrap();
        fs::write(folder.path().join(MANIFEST), manifest.replace("name =", "layer = [1, 3]\nname ="))
            .unwrap();
        assert_eq!(list_garment_folder(folder.path()).unwrap()[0].layer, Some([1, 3]));
    }

    #[test]
    fn what_a_folder_lists_stays_listed_and_what_it_does_not_list_is_not_hidden() {
        let named = |name: &str, height: f64| {
            let rest = tube(0.1, height, 8, 4);
            Garment { name: name.into(), ..Garment::new(Category::Top, rest) }
        };
        let folder = folder_with(&[]);
        save_garment_folder(folder.path(), &[named("a", 0.2), named("b", 0.2)]).unwrap();
        save_garment_folder(folder.path(), &[named("b", 0.3), named("c", 0.2)]).unwrap();
        let listed: Vec<String> =
            list_garment_folder(folder.path()).unwrap().into_iter().map(|g| g.name).collect();
        assert_eq!(listed, ["a", "b", "c"]);

        let own = folder_with(&[("shirt.obj", TRIANGLE)]);
        let refused = save_garment_folder(own.path(), &[named("a", 0.2)]).unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("shirt.obj") && refused.contains("would no longer be found"), "{refused}");
        assert!(!own.path().join("a.obj").exists());
    }

    #[test]
    fn without_a_manifest_every_mesh_is_a_garment() {
        let folder =
            folder_with(&[("b.obj", TRIANGLE), ("a.OBJ", TRIANGLE), ("c.ply", PLY), ("notes.txt", "x")]);
        let names: Vec<String> =
            load_garment_folder(folder.path(), &mannequin()).unwrap().into_iter().map(|g| g.name).collect();
        assert_eq!(names, ["a", "b", "c"]);
    }

    #[test]
    fn each_mistake_is_named_with_its_place() {
        let body = mannequin();
        let entry = "[[garment]]\nfile = \"a.obj\"\n";
        for (manifest, parts) in [
            (format!("{entry}colour = \"red\"\n"), ["garments.toml", "line 3", "`colour`"]),
            (format!("{entry}category = \"socks\"\n"), ["garments.toml", "line 3", "open_shirt"]),
            (format!("{entry}material = {{ weight = 1.0 }}\n"), ["garments.toml", "line 3", "`weight`"]),
            (
                format!("{entry}material = {{ thickness = 3.0 }}\n"),
                ["garments.toml", "garment 1", "more than any cloth's"],
            ),
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
        let message = load_garment_folder(empty.path(), &body).unwrap_err().to_string();
        assert!(message.contains("no garments"), "{message}");
        let missing = load_garment_folder(&empty.path().join("x"), &body).unwrap_err();
        assert!(missing.is_not_found());
    }
}
