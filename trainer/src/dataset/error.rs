//! Why the data of a run cannot be used.

use crate::config::Config;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body};
use miette::Diagnostic;
use std::error::Error as StdError;
use thiserror::Error;

/// Why the data of a run cannot be used, and how to mend it.
#[derive(Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct DatasetError {
    message: String,
    #[help]
    help: Option<String>,
}

impl DatasetError {
    /// What is wrong, and how to mend it.
    pub(crate) fn new(message: String, help: impl Into<String>) -> Self {
        Self { message, help: Some(help.into()) }
    }

    /// Something else that failed, whose message already names file and remedy; causes are appended.
    pub(crate) fn data(error: impl StdError) -> Self {
        let mut message = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let cause_text = cause.to_string();
            if !message.contains(&cause_text) {
                message = format!("{message}: {cause_text}");
            }
            source = cause.source();
        }
        Self { message, help: None }
    }

    /// A garment of this name cannot be prepared.
    pub(crate) fn garment(name: &str, reason: impl StdError) -> Self {
        Self::new(
            format!("garment {name}: {reason}"),
            "`clothcombo check` lists every defect of a garment file",
        )
    }

    /// The skeleton of `body` is too small for the poses.
    pub(crate) fn few_joints(body: &Body) -> Self {
        let (name, joints) = (&body.name, body.joint_count());
        Self::new(
            format!("body {name} has {joints} joints, poses turn the {BODY_JOINT_COUNT} body joints of SMPL"),
            "use a body whose first joints are SMPL's: SMPL, SMPL-H, SMPL-X, or one imported by `clothcombo import`",
        )
    }

    /// Whether every file and folder of the data that `config` names is there.
    ///
    /// # Errors
    /// Naming the first that is not.
    pub(crate) fn check_inputs(config: &Config) -> Result<(), Self> {
        let Some(input) = config.missing_input() else { return Ok(()) };
        Err(Self::new(
            format!(
                "{} = {:?}: there is no such file or folder, neither beside the configuration nor in {}",
                input.key,
                input.value,
                input.folder.display()
            ),
            "paths are relative to the folder of the configuration that names them, or to that in which the program was started",
        ))
    }
}
