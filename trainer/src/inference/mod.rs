//! Inference. In: a trained model, any garments in their order, any body. Out: draped garments, with a certificate of what still
//! intersects.
//!
//! ```no_run
//! use clothcombo_data::asset::Pose;
//! use clothcombo_data::fit::FitSettings;
//! use clothcombo_trainer::inference::{BodyState, Draper, DraperSettings};
//! use std::path::Path;
//!
//! let draper = Draper::load(Some(Path::new("runs/smoke")), &DraperSettings::default())?;
//! let catalog = draper.catalog(&[])?;
//! let hints = FitSettings::default();
//! let garments = ["t_shirt_000003", "skirt_000005"].map(|name| catalog.find(name, draper.body(), None, &hints));
//! let outfit = draper.outfit(garments.into_iter().collect::<Result<_, _>>()?)?;
//! let drape = draper.drape(&outfit, &BodyState::new(vec![1.0, -0.5], Pose::t_pose(22)))?;
//! for (garment, draped) in outfit.garments.iter().zip(&drape.garments) {
//!     println!("{}: {} vertices", garment.name, draped.positions.len());
//! }
//! # Ok::<(), miette::Report>(())
//! ```
//!
//! [`Draper::outfit`] does what depends on the garments alone (binding, operators, embedding), once per garment and process,
//! and once per machine with a cache; [`Draper::drape`] does what depends on the body: networks, post-process,
//! refinement; [`Draper::drape_motion`] does it for the frames of a motion. The networks see the pose without its heading;
//! positions come back in the frame of the given pose.

mod acceleration;
mod acceptance;
mod bodies;
mod checks;
pub mod descent;
mod drape;
pub(crate) mod draped;
mod draper;
mod embed;
mod embedded;
mod frame;
mod motion;
mod names;
mod network_drape;
pub mod networks;
pub mod on_body;
mod outfit;
pub mod output;
mod phase_times;
pub mod reference;
mod refine;
mod report;
mod shape_space;
mod shipped;
mod smooth;
mod source;
mod temporal_filter;
pub mod tensor_store;

pub use acceleration::{Acceleration, acceleration};
pub use bodies::{
    Bodies, BodyReport, BodyState, FrameRange, Moment, check_body_mesh, file_and_frame, read_pose,
};
pub use checks::{MAX_GARMENTS, MOST_SHAPE};
pub use clothcombo_physics::contact::resolve::Certificate;
pub use drape::{Drape, GarmentDrape};
pub use draped::Draped;
pub use draper::{Draper, DraperSettings};
pub use embedded::MAX_DRAPED_VERTICES;
pub use motion::DrapeProgress;
pub use names::UniqueNames;
pub use outfit::{Outfit, OutfitGarment};
pub use phase_times::PhaseTimes;
pub use refine::{RefineSteps, Refinement, refine};
pub use report::{DrapeReport, DrapedGarmentReport, FrameReport, ModelReport};
pub use shipped::shipped_model;
pub use smooth::{MOST_RADIUS, Smoothing};
pub use source::{GarmentCatalog, GivenGarment};
