//! Importers: somebody else's files become this project's bodies, garments and motions.

pub mod acclaim;
pub mod amass;
pub mod bvh;
pub mod cloth3d;
pub mod deepmimic;
mod find_files;
pub mod motions;
mod overwrite;
pub mod retarget;
mod rig;
pub mod smpl_family;
mod summary;
pub mod thinning;
mod up_axis;

pub use acclaim::{AmcSettings, import_amc};
pub use amass::{AmassSettings, import_amass};
pub use bvh::import_bvh;
pub use cloth3d::{Cloth3dBodies, Cloth3dSettings, import_cloth3d};
pub use deepmimic::import_deepmimic;
pub use motions::RetargetSettings;
pub use overwrite::refuse_overwriting;
pub use smpl_family::import_smpl_family;
pub use summary::{ImportError, Progress, Summary};
pub use thinning::Thinning;
pub use up_axis::WorldUp;
