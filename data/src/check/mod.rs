//! Is this file usable, and what is it like: garments, bodies, motions.
//!
//! A file is unusable when training would refuse it; everything else worth knowing is a warning.

mod anatomy;
mod body;
mod checked;
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
use checked::CheckedFile;
use clothcombo_physics::Surface;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What was found out about one file.
#[derive(Clone, Debug, Default, Serialize)]
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
    /// Takes over what was found out, but for the measurements.
    fn take<T>(&mut self, checked: CheckedFile<T>) -> Option<T> {
        (self.warnings, self.unusable) = (checked.warnings, checked.unusable);
        Some(checked.measured)
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
        let mut file = FileCheck { path: target.path().into(), ..FileCheck::default() };
        file.unusable = self.fill(&mut file, target).err().or(file.unusable);
        file
    }

    /// Adds what is found out; the error is why the file cannot be read.
    fn fill(&self, file: &mut FileCheck, target: &Target) -> Result<(), String> {
        match target {
            Target::Garment { path, entry } => {
                let placement = self.placement.as_ref().map_err(Clone::clone)?;
                file.garment = file.take(garment::check(path, entry, &self.body, &self.surface, placement)?);
            }
            Target::Npz { path } => {
                let mut npz = NpzFile::open(path).map_err(|e| e.to_string())?;
                if npz.contains("v_template") {
                    file.body = file.take(body::check(path, &mut npz)?);
                } else if holds_poses(&npz) {
                    file.motion = file.take(motion::check(path)?);
                } else {
                    let path = path.display();
                    return Err(format!(
                        "{path}: neither a body (no key 'v_template') nor a motion (no key 'poses')"
                    ));
                }
            }
            Target::Unlisted { .. } => {
                file.warnings.push(format!("not in the {MANIFEST} beside it, so no dataset takes it"));
            }
            Target::Unusable { reason, .. } => return Err(reason.clone()),
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
