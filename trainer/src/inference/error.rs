//! Why something cannot be draped.

use crate::dataset::DatasetError;
use crate::run::checkpoint::CheckpointError;
use clothcombo_data::asset::BodyError;
use clothcombo_data::fit::FitError;
use clothcombo_data::generate::POSE_NAMES;
use clothcombo_model::ModelError;
use clothcombo_physics::contact::resolve::ResolveError;
use clothcombo_physics::energy::EnergyError;
use clothcombo_physics::equilibrium::EquilibriumError;
use miette::Diagnostic;
use std::path::PathBuf;
use thiserror::Error;

/// Why something cannot be draped.
#[derive(Debug, Error, Diagnostic)]
pub enum DraperError {
    /// No model was named, and the program was built without one.
    #[error("no trained model: none was named, and this program was built without one")]
    #[diagnostic(help(
        "name one with --checkpoint: a run of clothcombo-train, or models/default of the project's checkout"
    ))]
    NoModel,
    /// The model cannot be read.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// Body or garment folder cannot be read, or a garment not be prepared.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Dataset(#[from] DatasetError),
    /// The body the model was trained on is not there.
    #[error("the model was trained on body {body}, which is not there")]
    #[diagnostic(help(
        "put it beside the model as body.npz, run from the folder its path is relative to, or pass --body"
    ))]
    NoBody {
        /// The path in the model's configuration.
        body: String,
    },
    /// The body lacks joints the networks were trained on.
    #[error("body '{body}' has no joint {}", missing.join(", "))]
    #[diagnostic(help("use the body the model was trained on, or one with joints of the same names"))]
    Joints {
        /// The body.
        body: String,
        /// Names of the missing joints.
        missing: Vec<String>,
    },
    /// Shape or pose do not fit the body.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A shape parameter that makes no body.
    #[error("shape parameter {value} makes no body: at most {most}, models are trained with about 2")]
    Shape {
        /// The parameter.
        value: f64,
        /// The largest one that is taken.
        most: f64,
    },
    /// A number in shape or pose is not finite.
    #[error("the {what} holds a number that is not finite")]
    NotFinite {
        /// Shape or pose.
        what: &'static str,
    },
    /// A motion without the frame that is asked for.
    #[error("{of} has {count} frames, no frame {frame}")]
    #[diagnostic(help("{}", if *count == 0 { "export it again with its poses" } else { "frames count from 0" }))]
    NoFrame {
        /// The motion.
        of: String,
        /// The frame.
        frame: usize,
        /// Its frames.
        count: usize,
    },
    /// A pose that is neither a file nor a known name.
    #[error("--pose {text}: neither a file nor the name of a pose")]
    #[diagnostic(help(
        "its names: {}; or give a frame of a motion file, FILE.npz:FRAME",
        POSE_NAMES.join(", ")
    ))]
    UnknownPose {
        /// What was asked for.
        text: String,
    },
    /// A frame that is no number.
    #[error("--pose {text}: {frame:?} is no number of a frame")]
    FrameNumber {
        /// What was asked for.
        text: String,
        /// Its frame.
        frame: String,
    },
    /// A mesh that is no pose of the body model.
    #[error("{of}: {reason}")]
    #[diagnostic(help(
        "the mesh must be a pose of the body model: the same vertices in the same order, metres, y up; and its shape known, by \
         --t-pose or --shape"
    ))]
    Recover {
        /// The mesh.
        of: String,
        /// Why not.
        reason: String,
    },
    /// Angles in another unit.
    #[error("{of}: {why}")]
    #[diagnostic(help("convert them to radians; `clothcombo check` looks at motion files"))]
    NotRadians {
        /// The pose or motion.
        of: String,
        /// What tells it.
        why: String,
    },
    /// Hints about a garment that is taken as it is.
    #[error("{name}: --fit never takes garments as they are, so that nothing can be said about their files")]
    #[diagnostic(help("leave --fit never out"))]
    Unfitted {
        /// The garment.
        name: String,
    },
    /// Neither a file nor a known name.
    #[error("no garment {name:?}: it is no file, and {}", match known.len() {
        0 => "no folder of garments is known".to_owned(),
        n => format!("none of the {n} known garments is called that"),
    })]
    #[diagnostic(help("{}", known_names(known)))]
    UnknownGarment {
        /// What was asked for.
        name: String,
        /// Garments known by name.
        known: Vec<String>,
    },
    /// A mesh is no garment of this body.
    #[error("{}: {reason}", path.display())]
    #[diagnostic(help(
        "hints about a file are those of `clothcombo fit --help`; `clothcombo check` lists defects"
    ))]
    Fit {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: FitError,
    },
    /// A mesh that is not to be fitted lies nowhere near the body.
    #[error("{}: {what}", path.display())]
    #[diagnostic(help("leave out --fit never: unit, axes and place are then found"))]
    Place {
        /// The file.
        path: PathBuf,
        /// What tells it.
        what: String,
    },
    /// A garment that is no file cannot be placed as one.
    #[error(
        "{name} is made by the generator, on this body: --offset, --turn and --from-body are about files"
    )]
    #[diagnostic(help(
        "leave them out, or say them in a file of outfits (--outfits) for the garments that they are about"
    ))]
    Generated {
        /// The garment.
        name: String,
    },
    /// A garment is too fine.
    #[error(
        "garment '{name}' has {vertices} vertices, more than {} can be draped at once",
        super::MAX_VERTICES
    )]
    #[diagnostic(help("decimate it first: the networks see no detail of a millimetre"))]
    TooLarge {
        /// The garment.
        name: String,
        /// Its vertices.
        vertices: usize,
    },
    /// Too few or too many layers.
    #[error("{count} garments; an outfit has 1 to {most}")]
    Count {
        /// Garments given.
        count: usize,
        /// Most garments.
        most: usize,
    },
    /// A posed surface with another number of vertices than the body.
    #[error("the posed body has {found} vertices, body '{body}' has {expected}")]
    #[diagnostic(help("a posed mesh must have the vertices of the body model, in its order"))]
    Surface {
        /// The body model.
        body: String,
        /// Vertices given.
        found: usize,
        /// Vertices of the model.
        expected: usize,
    },
    /// The networks do not take it.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The networks made something that is no number.
    #[error("the networks moved garment '{garment}' to a place that is not finite")]
    #[diagnostic(help(
        "either the garment lies far from the body (metres, y up, about the origin: `clothcombo fit` finds unit and axes), or \
         the model is damaged or was trained to divergence: try an earlier checkpoint"
    ))]
    Diverged {
        /// The garment.
        garment: String,
    },
    /// A garment without energies.
    #[error(transparent)]
    Energy(#[from] EnergyError),
    /// Refinement failed.
    #[error("refinement: {0}")]
    Refine(EquilibriumError),
    /// A garment came to the post-process far from the body.
    #[error(
        "post-process: garment '{garment}', vertex {vertex} (from 0) is at [{}, {}, {}]",
        position[0], position[1], position[2]
    )]
    #[diagnostic(help(
        "positions are finite, in metres, within a kilometre of the origin: check the garment's coordinates, `clothcombo fit` \
         finds unit and axes"
    ))]
    Far {
        /// The garment.
        garment: String,
        /// The vertex.
        vertex: usize,
        /// Where it is (m).
        position: [f64; 3],
    },
    /// A garment that is taken as it is has a face twice.
    #[error("post-process: garment '{garment}', face {face} (from 0) has the vertices of face {first}")]
    #[diagnostic(help(
        "let the mesh be repaired: `clothcombo fit` does it, and drape where --fit is not never"
    ))]
    DoubledFace {
        /// The garment.
        garment: String,
        /// The face.
        face: u32,
        /// The earlier one.
        first: u32,
    },
    /// The post-process refused its input.
    #[error("post-process: {0}")]
    Resolve(ResolveError),
}

// Not as sources: their text is part of the message, and would be printed twice.
impl From<EquilibriumError> for DraperError {
    fn from(reason: EquilibriumError) -> Self {
        Self::Refine(reason)
    }
}

impl From<ResolveError> for DraperError {
    fn from(reason: ResolveError) -> Self {
        Self::Resolve(reason)
    }
}

fn known_names(known: &[String]) -> String {
    const SHOWN: usize = 12;
    match known.len() {
        0 => "pass a mesh file (.obj, .ply, .stl, .gltf, .glb), or --dataset FOLDER".to_owned(),
        n if n > SHOWN => format!("for example {}, and {} more", known[..SHOWN].join(", "), n - SHOWN),
        _ => format!("the garments are: {}", known.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;

    #[test]
    fn a_cause_that_the_message_holds_is_no_source_as_well() {
        let resolve = DraperError::from(ResolveError::EmptyBody);
        let refine = DraperError::from(EquilibriumError::Count { what: "positions", expected: 2, found: 1 });
        for error in [resolve, refine] {
            assert!(error.to_string().contains(": ") && error.source().is_none(), "{error}");
        }
        let far = DraperError::Far { garment: "tee".into(), vertex: 7, position: [1e9, 0.0, 0.0] };
        assert_eq!(
            far.to_string(),
            "post-process: garment 'tee', vertex 7 (from 0) is at [1000000000, 0, 0]"
        );
    }
}
