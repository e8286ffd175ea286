//! What a scene is made of: bodies, poses, motions and garments, all in metres, radians, y up, facing +z.

pub mod binding;
pub mod body;
pub mod body_file;
pub mod category;
mod footprint;
pub mod garment;
mod garment_material;
pub mod motion;
mod normal_equations;
pub mod pose;
pub mod provenance;
mod recover;
pub mod rotation;
mod shape_match;
pub mod skeleton;
pub mod skin_weights;

pub use binding::{Binding, BindingSettings};
pub use body::{Body, BodyError, BodyParts, PosedBody, ShapedBody};
pub use body_file::BodyFileSettings;
pub use category::Category;
pub use footprint::Footprint;
pub use garment::{Garment, infeasible_pair};
pub use garment_material::GarmentMaterial;
pub use motion::Motion;
pub(crate) use normal_equations::NormalEquations;
pub use pose::Pose;
pub use provenance::Provenance;
pub use recover::{KnownShape, RecoveredBody, recover_body};
pub use shape_match::{ShapeMatch, match_shape};
pub use skeleton::{BODY_JOINT_COUNT, BODY_JOINT_NAMES, BODY_JOINT_PARENTS};
pub use skin_weights::SparseSkinWeights;
