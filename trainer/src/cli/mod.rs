//! The command lines of the two programs.

pub mod bench;
pub mod check;
pub mod config;
pub mod drape;
pub mod eval;
pub mod fit;
pub mod generate;
pub mod import;
pub mod prepare;
pub mod replay;
pub mod resolve;
pub mod runs;
pub mod score;
mod table;
pub mod train;
mod verbosity;
mod wardrobe_sheet;

pub use verbosity::Verbosity;

use miette::{IntoDiagnostic, Report};
use std::io::{ErrorKind, Write};

/// Exit code of a program that ended with `result`; an error is printed once, with its place and hint.
pub fn exit_code(result: Result<(), Report>) -> std::process::ExitCode {
    match result {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(report) => {
            eprintln!("{report:?}");
            std::process::ExitCode::FAILURE
        }
    }
}

/// Prints `text` to stdout.
pub(crate) fn print_all(text: &str) -> Result<(), Report> {
    match std::io::stdout().write_all(text.as_bytes()) {
        // Whoever reads the output has seen enough.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.into_diagnostic(),
    }
}
