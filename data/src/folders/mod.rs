//! Folders of garments and motions.

pub mod garment_folder;
pub mod motion_folder;

pub use garment_folder::{
    ListedGarment, ManifestEntry, list_garment_folder, load_garment_folder, read_manifest, refuse_unlisted,
    save_garment, save_garment_folder, save_manifest,
};
pub use motion_folder::{list_motion_folder, load_motion_folder};
