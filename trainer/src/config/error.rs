//! Why a configuration cannot be used.

use miette::{Diagnostic, NamedSource, SourceSpan};
use std::path::PathBuf;
use std::sync::Arc;
use thiserror::Error;

/// Why a configuration cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {reason}", path.display())]
    #[diagnostic(help("pass an existing file with --config, for example configs/smoke.toml"))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        reason: std::io::Error,
    },
    /// The file is not valid.
    #[error("{message}")]
    #[diagnostic(help(
        "`clothcombo config schema` documents every key; configs/smoke.toml is a short example"
    ))]
    Invalid {
        /// What is wrong.
        message: String,
        /// The file's text.
        #[source_code]
        source_code: Arc<NamedSource<String>>,
        /// Where.
        #[label("here")]
        span: Option<SourceSpan>,
    },
    /// A configuration that extends another cannot be put together.
    #[error("{}: {reason}", source_code.name())]
    #[diagnostic(help(
        "extends = \"base.toml\" names another configuration, relative to the folder of this one"
    ))]
    BadBase {
        /// What is wrong.
        reason: String,
        /// The text of the file that extends another.
        #[source_code]
        source_code: Arc<NamedSource<String>>,
        /// Where.
        #[label("here")]
        span: Option<SourceSpan>,
    },
    /// An override is not valid.
    #[error("--set {setting}: {message}")]
    #[diagnostic(help(
        "write --set section.key=value, for example --set stages.0.steps=100 or --set losses.strain.weight=2.0"
    ))]
    BadOverride {
        /// The override as given.
        setting: String,
        /// What is wrong.
        message: String,
    },
    /// Values contradict each other.
    #[error("{place} {what} ({})", source_code.name())]
    Inconsistent {
        /// The key.
        place: String,
        /// What is wrong.
        what: String,
        /// How to fix it.
        #[help]
        hint: String,
        /// The text of the file with the value.
        #[source_code]
        source_code: Arc<NamedSource<String>>,
        /// Where; `None` if an override is at fault.
        #[label("here")]
        span: Option<SourceSpan>,
    },
}
