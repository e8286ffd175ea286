//! The command lines. In: arguments. Out: the exit code of one of the two programs; one file or folder per verb.

pub mod bench;
pub mod check;
pub mod config;
mod data_check;
mod device_argument;
pub mod drape;
pub mod eval;
pub mod fit;
mod fit_arguments;
mod garment_sheet;
pub mod generate;
pub mod import;
mod interrupted;
mod loading;
mod memory_table;
mod model_arguments;
mod output;
mod post_process;
pub mod prepare;
pub mod replay;
pub mod resolve;
pub mod runs;
pub mod score;
mod table;
pub mod train;
mod values;
mod verbosity;

pub use verbosity::Verbosity;

use crate::system::closed_pipe::print_stderr;
use miette::Report;

/// Exit code of a program that ended with `result`; an error is printed once, with its place and hint.
pub fn exit_code(result: Result<(), Report>) -> std::process::ExitCode {
    match result {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(report) => {
            print_stderr(format_args!("{report:?}"));
            std::process::ExitCode::FAILURE
        }
    }
}
