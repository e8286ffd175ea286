//! Folders of garments and motions.

pub mod garment_folder;
pub mod motion_folder;

pub use garment_folder::{
    FolderGarment, GarmentFolderError, ListedGarment, list_garment_folder, load_garment_folder,
    save_garment_folder,
};
pub use motion_folder::{MotionFolderError, load_motion_folder};
