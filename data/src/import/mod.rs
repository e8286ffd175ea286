//! Importers: somebody else's files become this project's bodies, garments and motions.

pub mod anny;
pub mod bvh;
mod finish;
mod helper_garments;
pub mod makehuman;
mod reference_surface;
mod sheet_repair;

pub use anny::{AnnyError, AnnySettings, import_anny};
pub use bvh::{BvhImportError, BvhImportSettings, import_bvh};
pub use finish::GarmentResolution;
pub use makehuman::{MakeHumanError, MakeHumanSettings, import_makehuman};

use std::path::PathBuf;

/// What an importer did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// What was taken: name, and a line about it.
    pub taken: Vec<(String, String)>,
    /// What was left out: name, and why.
    pub skipped: Vec<(String, String)>,
    /// Assumptions and measurements worth knowing.
    pub notes: Vec<String>,
    /// The files written.
    pub written: Vec<PathBuf>,
}

/// Called with what is being done, how much of it is done, and how much there is.
pub type Progress<'a> = &'a mut dyn FnMut(&str, usize, usize);
