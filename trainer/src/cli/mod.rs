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
pub mod manual;
mod memory_table;
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

pub use interrupted::clear_up_on_signals;
pub use verbosity::Verbosity;

use crate::system::closed_pipe::print_stderr;
use clap::error::{ContextKind, ContextValue};
use clap::{Command, Parser};
use miette::Report;
use std::ffi::OsString;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};

/// The arguments of a program. What begins with a minus and a digit is a value and no flag, so that what takes it says what it
/// may be.
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
    let matches = command.try_get_matches_from_mut(with_values_joined(std::env::args_os())).map_err(plain)?;
    A::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// `--flag -1..3` as `--flag=-1..3`: clap takes a negative number for a value, but not what begins with one.
fn with_values_joined(arguments: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let begins_with_number = |text: &str| {
        let rest = text.strip_prefix('-').unwrap_or_default().trim_start_matches('.');
        rest.starts_with(|c: char| c.is_ascii_digit()) && text.parse::<f64>().is_err()
    };
    let mut joined: Vec<OsString> = Vec::new();
    for argument in arguments {
        match joined.last_mut() {
            Some(flag)
                if flag.to_str().is_some_and(|f| f.len() > 2 && f.starts_with("--") && !f.contains('='))
                    && argument.to_str().is_some_and(begins_with_number) =>
            {
                flag.push("=");
                flag.push(argument);
            }
            _ => joined.push(argument),
        }
    }
    joined
}

/// `error` with the reasons of Rust's number parsers ("invalid digit found in string") in plain words.
fn plain(error: clap::Error) -> clap::Error {
    let Some(source) = std::error::Error::source(&error) else { return error };
    let value = match error.get(ContextKind::InvalidValue) {
        Some(ContextValue::String(value)) => value.as_str(),
        _ => "",
    };
    let words = match source.downcast_ref::<ParseIntError>().map(ParseIntError::kind) {
        Some(IntErrorKind::PosOverflow) => "it is too large",
        Some(IntErrorKind::NegOverflow) => "it is too small",
        Some(_) if value.starts_with('-') => "it must not be negative",
        Some(_) => "it is no whole number",
        None if source.is::<ParseFloatError>() => "it is no number",
        None => return error,
    };
    let text = error.render().to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text).replace(&source.to_string(), words);
    clap::Error::raw(error.kind(), text)
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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn what_begins_like_a_negative_number_is_a_value() {
        let joined = |text: &str| -> Vec<String> {
            let all = with_values_joined(text.split(' ').map(OsString::from));
            all.into_iter().map(|a| a.into_string().unwrap()).collect()
        };
        assert_eq!(joined("p --frames -1..3 --every 2"), ["p", "--frames=-1..3", "--every", "2"]);
        assert_eq!(joined("p --join-seams -5mm -v"), ["p", "--join-seams=-5mm", "-v"]);
        assert_eq!(joined("p --w -.5x --a=b -3x"), ["p", "--w=-.5x", "--a=b", "-3x"]);
        for same in ["p --seed -1 --turn -9.5", "p -- -1..3", "p --json -o out", "p --frames 1..3 -5mm"] {
            assert_eq!(joined(same), same.split(' ').collect::<Vec<_>>());
        }
    }

    #[test]
    fn numbers_are_refused_in_plain_words() {
        #[derive(Parser)]
        struct Arguments {
            #[arg(long, value_delimiter = ',')]
            widths: Vec<usize>,
            #[arg(long, value_parser = clap::value_parser!(u32).range(1..9))]
            every: Option<u32>,
            #[arg(long)]
            shape: Option<f64>,
        }
        let said = |argument: &str| {
            let error =
                Arguments::command().try_get_matches_from(["p", argument]).map_err(plain).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        for (argument, words) in [
            ("--widths=64,x", "'x' for '--widths <WIDTHS>': it is no whole number"),
            ("--widths=-64,128", "'-64' for '--widths <WIDTHS>': it must not be negative"),
            ("--widths=99999999999999999999", "it is too large"),
            ("--every=x", "it is no whole number"),
            ("--every=-1", "-1 is not in 1..9"),
            ("--shape=a", "'a' for '--shape <SHAPE>': it is no number"),
        ] {
            let message = said(argument);
            assert!(message.contains(words) && message.starts_with("error: invalid value"), "{message}");
            assert!(!message.contains("invalid digit") && message.contains("--help"), "{message}");
        }
    }
}
