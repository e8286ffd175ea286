//! `clothcombo completions` and `clothcombo manual`: what shells and `man` know about the two programs.

use crate::cli::train;
use clap::{Command, CommandFactory, Parser};
use clap_complete::{Shell, generate};
use miette::{IntoDiagnostic, Report, WrapErr};
use std::fs;
use std::io::{self, Write};
use std::path::PathBuf;

/// Prints completions of both programs for a shell
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo completions bash > ~/.local/share/bash-completion/completions/clothcombo\n  \
        clothcombo completions fish | source"
)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

/// Writes a page for `man` of both programs and of every verb
#[derive(Parser)]
#[command(after_help = "Example:\n  clothcombo manual -o ~/.local/share/man/man1 && man clothcombo-drape")]
pub struct Manual {
    /// Folder of the pages; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

/// Prints completions; `clothcombo` is the command line of the program that runs.
///
/// # Errors
/// When they cannot be printed.
pub fn complete(arguments: &Completions, clothcombo: Command) -> Result<(), Report> {
    let mut text = Vec::new();
    for mut command in [clothcombo, train::Arguments::command()] {
        let name = command.get_name().to_owned();
        generate(arguments.shell, &mut command, name, &mut text);
    }
    io::stdout().write_all(&text).into_diagnostic().wrap_err("cannot print the completions")
}

/// Writes the pages; `clothcombo` is the command line of the program that runs.
///
/// # Errors
/// When they cannot be written.
pub fn write(arguments: &Manual, clothcombo: Command) -> Result<(), Report> {
    let folder = &arguments.output;
    let wrong = || format!("cannot write the pages to {}", folder.display());
    fs::create_dir_all(folder).into_diagnostic().wrap_err_with(wrong)?;
    for command in [clothcombo, train::Arguments::command()] {
        clap_mangen::generate_to(command, folder).into_diagnostic().wrap_err_with(wrong)?;
    }
    Ok(())
}
