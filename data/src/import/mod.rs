//! Importers: somebody else's files become this project's bodies, garments and motions.

pub mod amass;
pub mod bvh;
pub mod cloth3d;
pub mod deepmimic;
pub mod motions;
mod overwrite;
pub mod retarget;
pub mod smpl_family;
pub mod thinning;

pub use amass::{AmassSettings, UpAxis, import_amass};
pub use bvh::{BvhImportSettings, import_bvh};
pub use cloth3d::{Cloth3dBodies, Cloth3dError, Cloth3dSettings, import_cloth3d};
pub use deepmimic::{DeepMimicSettings, import_deepmimic};
pub use motions::MotionImportError;
pub use overwrite::{OverwriteError, refuse_overwriting};
pub use smpl_family::{SmplFamilyError, import_smpl_family};
pub use thinning::Thinning;

use std::fmt;
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

/// One line per item and the counts.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, about) in &self.taken {
            writeln!(f, "taken    {name}: {about}")?;
        }
        for (name, reason) in &self.skipped {
            writeln!(f, "skipped  {name}: {reason}")?;
        }
        for note in &self.notes {
            writeln!(f, "note     {note}")?;
        }
        for file in &self.written {
            writeln!(f, "written  {}", file.display())?;
        }
        write!(f, "{} taken, {} skipped", self.taken.len(), self.skipped.len())
    }
}

/// Called with what is being done, how much of it is done, and how much there is.
pub type Progress<'a> = &'a mut dyn FnMut(&str, usize, usize);
