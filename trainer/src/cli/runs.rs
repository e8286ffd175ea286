//! `clothcombo runs`: all runs of a folder in one table.

use crate::cli::output::print_report;
use crate::cli::table::{Row, row, table};
use crate::run::summary::{FoundRun, RunContent, RunSummary, find_runs};
use clap::Parser;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use std::path::PathBuf;

/// Compares training runs in a table: state, progress, losses, best validation
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo runs\n  clothcombo runs experiments --sort score\n  clothcombo runs --json\n\n\
        loss and ms/step are medians of the last 100 logged steps; score is the mean total loss of the networks at the best \
        validation; strain × compares them with skinning alone at the last one."
)]
pub struct Arguments {
    /// A folder of runs, or one run
    #[arg(value_name = "DIR", default_value = "runs")]
    folder: PathBuf,
    /// Order of the rows
    #[arg(long, value_enum, default_value_t = RunOrder::Name)]
    sort: RunOrder,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum RunOrder {
    /// By name
    Name,
    /// Best validation first
    Score,
}

/// Runs the verb.
///
/// # Errors
/// When the folder cannot be listed or holds no run. A damaged run is none: the table says what is wrong with it.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let mut runs = find_runs(&arguments.folder)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot list {}", arguments.folder.display()))?;
    if runs.is_empty() {
        return Err(miette!(
            help = "pass a folder whose subfolders are runs, as clothcombo-train makes them",
            "{} holds no run",
            arguments.folder.display()
        ));
    }
    if arguments.sort == RunOrder::Score {
        let score = |r: &FoundRun| r.best_score().unwrap_or(f64::INFINITY);
        runs.sort_by(|a, b| score(a).total_cmp(&score(b)));
    }
    print_report(arguments.json, &runs, |runs| {
        let readable = runs.iter().filter_map(|run| match &run.content {
            RunContent::Whole(summary) => Some(table_row(run, summary)),
            RunContent::Unreadable { .. } => None,
        });
        let mut text = table(&readable.collect::<Vec<_>>());
        for run in runs {
            if let RunContent::Unreadable { error } = &run.content {
                // On one line, as every run.
                let error = error.split_whitespace().collect::<Vec<_>>().join(" ");
                text += &format!("{}  {}  {error}\n", run.name, run.state);
            }
        }
        text
    })
}

fn table_row(run: &FoundRun, r: &RunSummary) -> Row {
    row! {
        "run" => run.name,
        "state" => run.state,
        "step" => format!("{}/{}", r.step, r.total_steps),
        "stage" => r.stage,
        "loss" => r.loss,
        "ms/step" => r.seconds_per_step.map(|s| 1000.0 * s),
        "score" => r.best_score,
        "at step" => r.best_step,
        "strain ×" => r.strain_ratio,
        "inside %" => r.inside.map(|share| 100.0 * share),
        "order %" => r.order_violations.map(|share| 100.0 * share),
        "skipped" => r.skipped,
        "spikes" => r.spikes,
        "checkpoint" => r.checkpoint,
    }
}
