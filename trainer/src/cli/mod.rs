//! The command lines of the two programs.

pub mod bench;
pub mod check;
pub mod config;
pub mod drape;
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
mod wardrobe_sheet;

use miette::{IntoDiagnostic, Report};
use std::io::{ErrorKind, IsTerminal, Write};
use tracing_subscriber::EnvFilter;

/// Log lines on stderr; `RUST_LOG` overrides `default`.
pub fn start_logging(default: &str) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
    // A second call (tests run several sessions in one process) keeps the first subscriber.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
        .with_writer(std::io::stderr)
        .try_init();
}

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
