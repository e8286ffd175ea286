//! `clothcombo runs`: all runs of a folder in one table.

use crate::run::summary::{FoundRun, RunSummary, find_runs};
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
    #[arg(long, value_enum, default_value_t = Order::Name)]
    sort: Order,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum Order {
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
    if arguments.sort == Order::Score {
        let score = |r: &FoundRun| r.best_score().unwrap_or(f64::INFINITY);
        runs.sort_by(|a, b| score(a).total_cmp(&score(b)));
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&runs).into_diagnostic()?);
        return Ok(());
    }
    let width = runs.iter().map(|r| r.name().chars().count()).max().unwrap_or(0).clamp(3, 32);
    println!(
        "{:<width$} {:<10} {:>17} {:<18} {:>9} {:>8} {:>9} {:>9} {:>8} {:>8} {:>8} {:>7} {:>6} {:>10}",
        "run",
        "state",
        "step",
        "stage",
        "loss",
        "ms/step",
        "score",
        "at step",
        "strain ×",
        "inside %",
        "order %",
        "skipped",
        "spikes",
        "checkpoint"
    );
    for run in &runs {
        match run {
            FoundRun::Whole(run) => println!("{}", row(run, width)),
            FoundRun::Unreadable(run) => {
                // On one line, as every run.
                let error = run.error.split_whitespace().collect::<Vec<_>>().join(" ");
                println!("{:<width$} {:<10} {error}", run.name, run.state);
            }
        }
    }
    Ok(())
}

fn row(r: &RunSummary, width: usize) -> String {
    let or_dash = |value: Option<String>| value.unwrap_or_else(|| "–".into());
    let number = |v: Option<f64>, digits: usize| or_dash(v.map(|v| format!("{v:.digits$}")));
    let percent = |v: Option<f64>| or_dash(v.map(|v| format!("{:.2}", 100.0 * v)));
    let step = |v: Option<u64>| or_dash(v.map(|v| v.to_string()));
    format!(
        "{:<width$} {:<10} {:>17} {:<18} {:>9} {:>8} {:>9} {:>9} {:>8} {:>8} {:>8} {:>7} {:>6} {:>10}",
        r.name,
        r.state,
        format!("{}/{}", r.step, r.total_steps),
        r.stage,
        number(r.loss, 3),
        number(r.seconds_per_step.map(|s| 1000.0 * s), 1),
        number(r.best_score, 3),
        step(r.best_step),
        number(r.strain_ratio, 3),
        percent(r.inside),
        percent(r.order_violations),
        r.skipped,
        r.spikes,
        step(r.checkpoint)
    )
}
