//! Everything around training: making and importing data, scoring drapes, measuring.

use clap::{CommandFactory, Parser, Subcommand};
use clothcombo_trainer::cli;
use clothcombo_trainer::system::limits::{SystemMemory, report_limits};
use clothcombo_trainer::system::workers::among_workers;
use std::process::ExitCode;

/// Learned draping of multi-layered clothing: data in, garments on bodies out.
#[derive(Parser)]
#[command(
    name = "clothcombo",
    version,
    about,
    after_help = "Train with clothcombo-train. Every verb has its own --help with examples."
)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    verbosity: cli::Verbosity,
}

#[derive(Subcommand)]
enum Verb {
    #[command(subcommand)]
    Bench(cli::bench::Bench),
    Check(cli::check::Arguments),
    Completions(cli::manual::Completions),
    #[command(subcommand)]
    Config(cli::config::ConfigVerb),
    Drape(Box<cli::drape::Arguments>),
    Eval(cli::eval::Arguments),
    Fit(cli::fit::Arguments),
    Generate(cli::generate::Arguments),
    #[command(subcommand)]
    Import(cli::import::ImportSource),
    Manual(cli::manual::Manual),
    Prepare(cli::prepare::Arguments),
    Replay(cli::replay::Arguments),
    Resolve(cli::resolve::Arguments),
    Runs(cli::runs::Arguments),
    Score(cli::score::Arguments),
}

#[global_allocator]
static ALLOCATOR: SystemMemory = SystemMemory;

fn main() -> ExitCode {
    report_limits();
    clothcombo_trainer::system::allocator::keep_freed_memory();
    clothcombo_trainer::system::device::prefer_processor();
    clothcombo_trainer::system::closed_pipe::end_quietly();
    let arguments: Arguments = cli::parse().unwrap_or_else(|error| error.exit());
    arguments.verbosity.apply("info");
    cli::clear_up_on_signals();
    cli::exit_code(match &arguments.verb {
        Verb::Bench(bench) => cli::bench::run(bench),
        Verb::Check(arguments) => cli::check::run(arguments),
        Verb::Completions(arguments) => cli::manual::complete(arguments, Arguments::command()),
        Verb::Config(verb) => cli::config::run(verb),
        Verb::Drape(arguments) => among_workers(|| cli::drape::run(arguments)),
        Verb::Eval(arguments) => cli::eval::run(arguments),
        Verb::Fit(arguments) => cli::fit::run(arguments),
        Verb::Generate(arguments) => cli::generate::run(arguments),
        Verb::Import(source) => cli::import::run(source),
        Verb::Manual(arguments) => cli::manual::write(arguments, Arguments::command()),
        Verb::Prepare(arguments) => cli::prepare::run(arguments),
        Verb::Replay(arguments) => cli::replay::run(arguments),
        Verb::Resolve(arguments) => among_workers(|| cli::resolve::run(arguments)),
        Verb::Runs(arguments) => cli::runs::run(arguments),
        Verb::Score(arguments) => cli::score::run(arguments),
    })
}
