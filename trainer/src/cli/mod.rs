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
use clap::{Command, Parser};
use miette::Report;

/// The arguments of a program. A negative number is a value and no flag, so that what takes it says what it may be.
///
/// # Errors
/// Those of clap, also for help and version.
pub fn parse<A: Parser>() -> Result<A, clap::Error> {
    fn with_negative_numbers(command: Command) -> Command {
        let takes_values = |argument: &clap::Arg| argument.get_action().takes_values();
        command
            .mut_args(|a| if takes_values(&a) { a.allow_negative_numbers(true) } else { a })
            .mut_subcommands(with_negative_numbers)
    }
    let mut command = with_negative_numbers(A::command());
    let matches = command.try_get_matches_from_mut(std::env::args_os())?;
    A::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

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
