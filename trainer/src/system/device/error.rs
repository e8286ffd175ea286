//! Why a device cannot be used.

use miette::Diagnostic;
use thiserror::Error;

/// Why a device cannot be used.
#[derive(Debug, Error, Diagnostic)]
pub enum DeviceError {
    /// Its backend is not compiled in.
    #[error("--device {device}: this build has no Cargo feature `{feature}`")]
    #[diagnostic(help("build it: cargo build --release --workspace --bins --features {feature}"))]
    NotInThisBuild {
        /// The device as it was named.
        device: String,
        /// The feature.
        feature: &'static str,
    },
    /// The machine has none of its kind.
    #[error("--device {device}: no adapter was found")]
    #[diagnostic(help("{hint}"))]
    NoAdapter {
        /// The device as it was named.
        device: String,
        /// What to install.
        hint: &'static str,
    },
    /// The machine has fewer.
    #[error("--device {device}: there is no adapter of that number")]
    #[diagnostic(help("found here:{list}"))]
    NoSuchAdapter {
        /// The device as it was named.
        device: String,
        /// Those that are there, each on a line of its own after a line break.
        list: String,
    },
    /// It is there but does not work.
    #[error("--device {device} cannot be opened: {reason}")]
    #[diagnostic(help("check its driver; `--device flex` computes on the processor"))]
    CannotOpen {
        /// The device as it is numbered.
        device: String,
        /// What the driver says.
        reason: String,
    },
    /// A tensor is larger than the device's kernels can read.
    #[error(
        "the largest outfit needs a tensor of {} MiB, and {device} grants {} MiB at once",
        bytes.div_ceil(1 << 20),
        limit >> 20
    )]
    #[diagnostic(help(
        "fewer garments per outfit (layers) or vertices, a smaller model.siren_width, or --device flex"
    ))]
    TooLarge {
        /// The device as it is named.
        device: String,
        /// Size of the tensor (bytes).
        bytes: u64,
        /// The most that the device grants (bytes).
        limit: u64,
    },
}
