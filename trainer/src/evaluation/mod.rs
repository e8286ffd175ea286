//! Evaluation. In: a trained model and a dataset. Out: scores of scenes, tables, figures and pages, of what the losses say and of
//! what can be counted.

pub mod certificates;
pub mod equilibrium_error;
pub mod samples;
mod score;
mod sign_error;
pub mod study;
mod timing;
mod validation;

pub use score::{SceneScore, method_score, score_scene};
pub use sign_error::{RegionErrors, SignErrorSettings, SignErrors, WrongSigns, hard_poses, sign_errors};
pub use timing::median_ms;
pub use validation::ValidationSet;
