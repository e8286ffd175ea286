//! The model that is used when none is named.

use super::error::DraperError;
use crate::run::checkpoint::TrainedModel;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of models, beside the working folder or the program.
const MODELS: &str = "models";
/// Environment variable that names another folder of models, which is then the only one.
const VARIABLE: &str = "CLOTHCOMBO_MODELS";
/// Taken first where there are several.
const PREFERRED: &str = "default";

/// Opens the shipped model: `models/default`, or the only folder in `models`, in the working folder or above the program;
/// the environment variable `CLOTHCOMBO_MODELS` names another place for `models`.
///
/// # Errors
/// When there is none, or several of which none is called `default`.
pub fn shipped_model() -> Result<TrainedModel, DraperError> {
    let places = places();
    for place in &places {
        if let Some(folder) = choose(place)? {
            return Ok(TrainedModel::open(&folder)?);
        }
    }
    Err(DraperError::NoModel { searched: places.iter().map(|p| p.display().to_string()).collect() })
}

fn places() -> Vec<PathBuf> {
    if let Some(named) = std::env::var_os(VARIABLE).filter(|v| !v.is_empty()) {
        return vec![named.into()];
    }
    let mut places = vec![PathBuf::from(MODELS)];
    let program = std::env::current_exe().ok();
    // PREFIX/bin/clothcombo and target/release/clothcombo.
    places
        .extend(program.iter().flat_map(|p| p.ancestors().skip(1).take(3)).map(|folder| folder.join(MODELS)));
    places
}

fn choose(place: &Path) -> Result<Option<PathBuf>, DraperError> {
    let Ok(entries) = fs::read_dir(place) else { return Ok(None) };
    let mut found: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.join("state.json").is_file()).collect();
    found.sort();
    if let Some(preferred) = found.iter().find(|p| p.ends_with(PREFERRED)) {
        return Ok(Some(preferred.clone()));
    }
    match &found[..] {
        [] => Ok(None),
        [one] => Ok(Some(one.clone())),
        several => {
            let name = |p: &PathBuf| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Err(DraperError::SeveralModels {
                folder: place.into(),
                names: several.iter().map(name).collect(),
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_taken_default_is_preferred_and_several_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| {
            fs::create_dir_all(folder.path().join(name)).unwrap();
            fs::write(folder.path().join(name).join("state.json"), "{}").unwrap();
        };
        assert_eq!(choose(folder.path()).unwrap(), None);
        make("small");
        assert!(choose(folder.path()).unwrap().unwrap().ends_with("small"));
        make("large");
        let message = choose(folder.path()).unwrap_err().to_string();
        assert!(message.contains("large, small"), "{message}");
        make(PREFERRED);
        assert!(choose(folder.path()).unwrap().unwrap().ends_with(PREFERRED));
    }
}
