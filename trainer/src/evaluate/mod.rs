//! Scores of draped scenes: what the losses say, and what a stranger would count.

pub mod certificates;
pub mod equilibrium_error;
pub mod reference;
mod report;
mod score;
mod sign_error;
mod validation;

pub use report::{GroupReport, MethodScore, Spread, ValidationReport};
pub use score::{Draped, SceneScore, score_scene};
pub use sign_error::{RegionErrors, SignErrorSettings, SignErrors, WrongSigns, hard_poses, sign_errors};
pub(crate) use validation::GARMENTS_AT_ONCE;
pub use validation::{Method, ValidationSet};
