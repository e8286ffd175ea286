//! Why the data of a run cannot be used.

use crate::config::{Config, MissingInput};
use crate::system::memory::gibibytes;
use clothcombo_data::asset::BODY_JOINT_COUNT;
use miette::Diagnostic;
use std::error::Error as StdError;
use std::path::PathBuf;
use thiserror::Error;

/// Why the data of a run cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum DatasetError {
    /// A file is missing or wrong; the message names it and says how to fix it.
    #[error("{0}")]
    Data(String),
    /// A file or folder that the configuration names is not there.
    #[error("{} = {:?}: there is no such file or folder, neither beside the configuration nor in {}", input.key, input.value, input.folder.display())]
    #[diagnostic(help(
        "paths are relative to the folder of the configuration that names them, or to that in which the program was started"
    ))]
    Missing {
        /// What is missing.
        input: MissingInput,
    },
    /// A garment cannot be prepared.
    #[error("garment {name}: {reason}")]
    #[diagnostic(help("`clothcombo check` lists every defect of a garment file"))]
    Garment {
        /// Its name.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// A garment is over the configured limit.
    #[error("garment {name} has {vertices} vertices, more than data.max_vertices = {limit}")]
    #[diagnostic(help("raise data.max_vertices (memory grows with it), or decimate the garment"))]
    TooLarge {
        /// Its name.
        name: String,
        /// Its vertex count.
        vertices: usize,
        /// The limit.
        limit: usize,
    },
    /// Without a cache all garments stay in memory, which is too small for them.
    #[error(
        "the {garments} garments take about {} of memory, of which {} are available",
        gibibytes(*needed), gibibytes(*available)
    )]
    #[diagnostic(help(
        "set data.cache.folder: what is computed from a garment is then kept on disk, and read when a scene needs it"
    ))]
    Memory {
        /// Number of garments.
        garments: usize,
        /// What they take (bytes).
        needed: u64,
        /// What the system can give (bytes).
        available: u64,
    },
    /// There is nowhere to store what would be computed.
    #[error("the configuration names no cache to prepare")]
    #[diagnostic(help(
        "set data.cache.folder, in the file or with --set data.cache.folder=\"datasets/cache/prepared\""
    ))]
    NoCache,
    /// Nothing is left to train on.
    #[error("all {0} garments are held out, none is left to train on")]
    #[diagnostic(help("shorten data.held_out_garments"))]
    AllHeldOut(usize),
    /// A held-out name fits no garment.
    #[error("data.held_out_garments names {name:?}, which is no garment of this run")]
    #[diagnostic(help("the garments are: {available}"))]
    UnknownHeldOut {
        /// The name.
        name: String,
        /// The existing names.
        available: String,
    },
    /// A held-out name fits no clip.
    #[error("data.poses.{key} names {name:?}, which fits no clip in {}", folder.display())]
    #[diagnostic(help(
        "a name that may fit none belongs in data.poses.optional_clips as well; the clips are: {clips}"
    ))]
    UnknownClip {
        /// The key.
        key: &'static str,
        /// The motion folder.
        folder: PathBuf,
        /// The name.
        name: String,
        /// The clips of the folder.
        clips: String,
    },
    /// A clip is for validation and for the test.
    #[error("clip {clip} is named by data.poses.validation_clips and by data.poses.test_clips")]
    #[diagnostic(help("a clip is for one of them; a name stands for every clip whose name contains it"))]
    ClipOfTwoSets {
        /// The clip.
        clip: String,
    },
    /// A wanted name fits no garment of its source.
    #[error("data.garments[{source_index}].only names {name:?}, which is no garment of this source")]
    #[diagnostic(help("the garments are: {available}"))]
    UnknownOnly {
        /// Number of the source in the configuration, from 0.
        source_index: usize,
        /// The name.
        name: String,
        /// The existing names.
        available: String,
    },
    /// No clip is left to train on.
    #[error("{}: no clip to train on: {named} are named by data.poses.validation_clips or test_clips, the others have no frames", folder.display())]
    #[diagnostic(help(
        "name fewer clips there, or add some: a run needs frames to train on beside those that it validates on"
    ))]
    NoTrainedClip {
        /// The motion folder.
        folder: PathBuf,
        /// Clips named for validation and test.
        named: usize,
    },
    /// One side of the pose split is empty.
    #[error(
        "{}: {train} frames to train on and {held_out} held out to validate on; the clips are too few or too short to hold a part \
         out of them",
        folder.display()
    )]
    #[diagnostic(help("{remedy}"))]
    EmptySplit {
        /// The motion folder.
        folder: PathBuf,
        /// Training frames.
        train: usize,
        /// Held-out frames.
        held_out: usize,
        /// What to set or add.
        remedy: String,
    },
    /// Clips are weighted by their length in time, and some of these have none.
    #[error("{}: at frame rates from {lowest:?} to {highest:?} a second the clips' lengths in time cannot be compared", folder.display())]
    #[diagnostic(help(
        "`clothcombo check` tells the frame rate of every motion; set mocap_framerate, for example to 30"
    ))]
    FrameRates {
        /// The motion folder.
        folder: PathBuf,
        /// Lowest frame rate (1/s).
        lowest: f64,
        /// Highest frame rate (1/s).
        highest: f64,
    },
    /// The skeleton is too small for the poses.
    #[error("body {name} has {joints} joints, poses turn the {BODY_JOINT_COUNT} body joints of SMPL")]
    #[diagnostic(help(
        "use a body whose first joints are SMPL's: SMPL, SMPL-H, SMPL-X, or one imported by `clothcombo import`"
    ))]
    FewJoints {
        /// The body.
        name: String,
        /// Its joints.
        joints: usize,
    },
    /// The networks see joints that the body lacks.
    #[error("body {body} has no joint {}, which the networks were trained with", missing.join(", "))]
    #[diagnostic(help("use the body of the checkpoint, or train a new model"))]
    MissingJoints {
        /// The body.
        body: String,
        /// The joints.
        missing: Vec<String>,
    },
    /// More shape components are asked for than the body has.
    #[error("data.shape_components = {asked}, but the body has {available}")]
    #[diagnostic(help("use 0 to take all the body has"))]
    ShapeComponents {
        /// Asked for.
        asked: usize,
        /// Present.
        available: usize,
    },
}

impl DatasetError {
    /// Whether every file and folder of the data that `config` names is there.
    ///
    /// # Errors
    /// [`Missing`](Self::Missing), naming the first that is not.
    pub(crate) fn check_inputs(config: &Config) -> Result<(), Self> {
        config.missing_input().map_or(Ok(()), |input| Err(Self::Missing { input }))
    }

    /// Wraps an error of the data crate, whose message already names file and remedy; causes are appended.
    pub(crate) fn data(error: impl StdError) -> Self {
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let cause_text = cause.to_string();
            if !text.contains(&cause_text) {
                text = format!("{text}: {cause_text}");
            }
            source = cause.source();
        }
        DatasetError::Data(text)
    }
}
