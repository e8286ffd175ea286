//! Bodies, garments, poses and the files they come in.
//!
//! No networks here. Units are SI, y is up, the body faces +z with its left towards +x and its pelvis at the origin.

pub mod asset;
pub mod cache;
pub mod check;
pub mod degenerate_cases;
pub mod fit;
pub mod folders;
pub mod format;
pub mod generate;
pub mod import;
pub mod mesh;
