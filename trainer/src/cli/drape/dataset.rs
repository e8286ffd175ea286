//! The folders of `--dataset`: searched through as by `clothcombo check`.

use clothcombo_data::check::{Target, find_targets, only_body};
use miette::{Report, miette};
use std::path::{Path, PathBuf};

/// What the folders hold.
#[derive(Debug, Default, PartialEq)]
pub(super) struct DatasetFolders {
    /// Folders of garments, in the order they were found.
    pub garments: Vec<PathBuf>,
    /// The one body among the files; none where there are several.
    pub body: Option<String>,
}

impl DatasetFolders {
    /// Searches through `folders`.
    ///
    /// # Errors
    /// When one of them cannot be read, lists what is not there, or holds no garment.
    pub fn find(folders: &[PathBuf]) -> Result<Self, Report> {
        let mut found = Self::default();
        let mut targets = Vec::new();
        for folder in folders {
            let within = find_targets(std::slice::from_ref(folder));
            let before = found.garments.len();
            for target in &within {
                match target {
                    Target::Unusable { reason, .. } => return Err(miette!("--dataset {reason}")),
                    Target::Garment { path, .. } => {
                        let parent = path.parent().unwrap_or(Path::new("")).to_owned();
                        if !found.garments.contains(&parent) {
                            found.garments.push(parent);
                        }
                    }
                    _ => {}
                }
            }
            if found.garments.len() == before {
                return Err(miette!("--dataset {}: no garments in it", folder.display()));
            }
            targets.extend(within);
        }
        found.body = only_body(&targets).map(|path| path.display().to_string());
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::asset::Provenance;
    use clothcombo_data::generate::mannequin;
    use std::fs;

    #[test]
    fn garments_lie_anywhere_in_a_folder_and_one_body_is_its_body() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("garments")).unwrap();
        let find = || DatasetFolders::find(&[folder.path().to_owned()]);
        assert!(find().is_err(), "nothing in it");
        fs::write(at("garments/tee.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        assert_eq!(find().unwrap(), DatasetFolders { garments: vec![at("garments")], body: None });
        mannequin().save(&at("body.npz"), &Provenance::default()).unwrap();
        assert_eq!(find().unwrap().body, Some(at("body.npz").display().to_string()));
        mannequin().save(&at("other.npz"), &Provenance::default()).unwrap();
        assert_eq!(find().unwrap().body, None);
        let missing = DatasetFolders::find(&[at("none")]).unwrap_err().to_string();
        assert!(missing.contains("none"), "{missing}");
    }
}
