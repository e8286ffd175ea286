//! Is this file usable, and what is it like: garments, bodies, motions.
//!
//! A file is unusable when training would refuse it; everything else worth knowing is a warning.

mod anatomy;
mod body;
mod garment;
mod motion;
mod placement;
mod targets;

pub use anatomy::{impossible_turn, is_possible};
pub use body::BodyCheck;
pub use garment::{GarmentCheck, layer_guess};
pub use motion::{MotionCheck, not_radians, not_upright};
pub use targets::{ManifestHints, Target, find_targets, only_body};

use crate::asset::Body;
use crate::asset::motion::holds_poses;
use crate::fit::PlacementCheck;
use crate::folders::garment_folder::MANIFEST;
use crate::format::NpzFile;
use clothcombo_physics::Surface;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was found out about one file.
#[derive(Clone, Debug, Serialize)]
pub struct FileCheck {
    /// The file.
    #[serde(serialize_with = "lossy")]
    pub path: PathBuf,
    /// Why it cannot be used, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unusable: Option<String>,
    /// What should be looked at.
    pub warnings: Vec<String>,
    /// If it is a garment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub garment: Option<GarmentCheck>,
    /// If it is a body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<BodyCheck>,
    /// If it is a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionCheck>,
}

/// Names need not be UTF-8, JSON must.
fn lossy<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

impl FileCheck {
    fn new(path: &Path) -> Self {
        Self {
            path: path.into(),
            unusable: None,
            warnings: Vec::new(),
            garment: None,
            body: None,
            motion: None,
        }
    }
}

/// Checks files against one body.
#[derive(Debug)]
pub struct Checker {
    body: Body,
    surface: Surface<f64>,
    /// Or why the body is no standing person.
    placement: Result<PlacementCheck, String>,
}

impl Checker {
    /// Garments are measured against the zero body of `body`.
    pub fn new(body: Body) -> Self {
        let surface = Surface::new(body.template.clone(), body.faces.clone());
        // Built once here, not by the first of many threads.
        surface.closest_point();
        let placement = PlacementCheck::new(&body).map_err(|e| e.to_string());
        Self { body, surface, placement }
    }

    /// Checks one file.
    pub fn check(&self, target: &Target) -> FileCheck {
        let file = FileCheck::new(target.path());
        let checked = match target {
            Target::Garment { path, entry } => {
                let placement = self.placement.as_ref().map_err(Clone::clone);
                placement.and_then(|p| garment::check(path, entry, &self.body, &self.surface, p)).map(
                    |garment::Checked { garment, warnings, misplaced }| FileCheck {
                        garment: Some(garment),
                        warnings,
                        unusable: misplaced,
                        ..file.clone()
                    },
                )
            }
            Target::Npz { path } => check_npz(&file, path),
            Target::Unlisted { .. } => {
                let warning = format!("not in the {MANIFEST} beside it, so no dataset takes it");
                Ok(FileCheck { warnings: vec![warning], ..file.clone() })
            }
            Target::Unusable { reason, .. } => Err(reason.clone()),
        };
        checked.unwrap_or_else(|reason| FileCheck { unusable: Some(reason), ..file })
    }
}

fn check_npz(file: &FileCheck, path: &Path) -> Result<FileCheck, String> {
    let mut npz = NpzFile::open(path).map_err(|e| e.to_string())?;
    if npz.contains("v_template") {
        let body::Checked { body, warnings, unusable } = body::check(path, &mut npz)?;
        Ok(FileCheck { body: Some(body), warnings, unusable, ..file.clone() })
    } else if holds_poses(&npz) {
        let (check, warnings) = motion::check(path)?;
        let unusable = motion::unusable(&check, path);
        Ok(FileCheck { motion: Some(check), warnings, unusable, ..file.clone() })
    } else if npz.contains("positions") && npz.contains("f") {
        let warning = "a simulated sequence: training does not read it".into();
        Ok(FileCheck { warnings: vec![warning], ..file.clone() })
    } else {
        Err(format!("{}: neither a body (no key 'v_template') nor a motion (no key 'poses')", path.display()))
    }
}

/// Whether a file is a body npz, by its keys.
pub fn is_body_file(path: &Path) -> bool {
    NpzFile::open(path).is_ok_and(|file| file.contains("v_template"))
}

#[cfg(test)]
mod tests;
