//! Trains the networks: `clothcombo-train --config configs/smoke.toml`.

use clap::Parser;
use clothcombo_trainer::cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    clothcombo_trainer::allocator::keep_freed_memory();
    let arguments = cli::train::Arguments::parse();
    arguments.verbosity().apply("warn");
    cli::exit_code(cli::train::run(&arguments))
}
