//! Is the data of a configuration fit to train on? The judgement of `clothcombo check`, before anything is made.

use super::body::load_body;
use super::error::DatasetError;
use super::garment_source::GarmentSource;
use crate::config::Config;
use crate::system::paths::lossy;
use clothcombo_data::check::{Checker, FileCheck, ManifestHints, Target};
use clothcombo_data::folders::{ListedGarment, list_motion_folder};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What was found out about the files of a configuration. Generated garments need no check.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct DataCheck {
    /// Files looked at.
    pub files: usize,
    /// What cannot be trained on.
    #[serde(skip)]
    pub faults: Vec<Fault>,
    /// What should be looked at.
    pub warnings: Vec<FileWarnings>,
}

/// A file that cannot be trained on.
#[derive(Clone, Debug)]
pub struct Fault {
    /// Name of the garment, clip or body.
    pub name: String,
    /// Its file.
    pub file: PathBuf,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub remedy: String,
}

/// The warnings about a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FileWarnings {
    /// The file.
    #[serde(serialize_with = "lossy")]
    pub file: PathBuf,
    /// What should be looked at.
    pub warnings: Vec<String>,
}

/// A file, the name of what it holds, and how to check it.
struct ListedFile {
    name: String,
    target: Target,
}

impl DataCheck {
    /// Checks the body, every garment file and every motion file that `config` names. `progress(done, total)` is called per file.
    ///
    /// # Errors
    /// [`DatasetError`] when there is no body to check against, or a folder cannot be listed.
    pub fn run(config: &Config, progress: &(dyn Fn(usize, usize) + Sync)) -> Result<Self, DatasetError> {
        DatasetError::check_inputs(config)?;
        let sources = GarmentSource::list(&config.data.garments)?;
        let mut files: Vec<ListedFile> = sources.into_iter().filter_map(garment).collect();
        if let Some(folder) = &config.data.poses.motions {
            files.extend(list_motion_folder(folder).map_err(DatasetError::data)?.into_iter().map(motion));
        }
        if files.is_empty() && config.data.body == "mannequin" {
            return Ok(Self::default());
        }
        let body = load_body(&config.data.body, config.data.shape_components)?;
        if let Some(what) = body.implausibility() {
            // Everything else would be measured on it.
            let remedy = "convert it to metres, y up, facing +z".into();
            let fault = Fault { name: body.name.clone(), file: (&config.data.body).into(), what, remedy };
            return Ok(Self { files: 1, faults: vec![fault], warnings: Vec::new() });
        }
        let checker = Checker::new(body);
        let done = AtomicUsize::new(0);
        let check = |file: &ListedFile| {
            let found = checker.check(&file.target);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, files.len());
            found
        };
        let found: Vec<FileCheck> = files.par_iter().map(check).collect();
        let mut all = Self { files: files.len(), ..Self::default() };
        for (file, found) in files.iter().zip(found) {
            if let Some(reason) = &found.unusable {
                all.faults.push(fault(file, &found, reason, &config.data.body));
            } else if !found.warnings.is_empty() {
                all.warnings.push(FileWarnings { file: found.path, warnings: found.warnings });
            }
        }
        Ok(all)
    }
}

fn garment(source: GarmentSource) -> Option<ListedFile> {
    let GarmentSource::File(ListedGarment { path, name, category, holding, layer, .. }) = source else {
        return None;
    };
    let entry = ManifestHints { category, layer, holding };
    Some(ListedFile { name, target: Target::Garment { path, entry } })
}

fn motion(path: PathBuf) -> ListedFile {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    ListedFile { name, target: Target::Npz { path } }
}

fn fault(file: &ListedFile, found: &FileCheck, reason: &str, body: &str) -> Fault {
    let path = found.path.display().to_string();
    let remedy = match found.garment {
        Some(_) => format!("clothcombo fit {path} --body {body} -o {}.obj", file.name),
        None => "export or convert it again, or take it out of the data".into(),
    };
    Fault { name: file.name.clone(), file: found.path.clone(), what: without_path(reason, &path), remedy }
}

/// `reason` without the file that it begins with, which has a column of its own in the table.
fn without_path(reason: &str, path: &str) -> String {
    let Some(rest) = reason.strip_prefix(path).and_then(|rest| rest.strip_prefix(':')) else {
        return reason.to_owned();
    };
    match rest.strip_prefix(' ') {
        Some(rest) => rest.to_owned(),
        None => format!("line {rest}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_loses_its_file_and_keeps_its_line() {
        for (reason, short) in
            [("a.obj: torn", "torn"), ("a.obj:2: no number", "line 2: no number"), ("torn", "torn")]
        {
            assert_eq!(without_path(reason, "a.obj"), short);
        }
    }
}
