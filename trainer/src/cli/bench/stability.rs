//! `clothcombo bench stability`: the degenerate cases, one row each.

use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::Args;
use clothcombo_data::degenerate_cases::{CaseReport, DegenerateCases, Expectation, Outcome, TermReport};
use clothcombo_physics::energy::{EnergySettings, Term, TermMap};
use miette::{IntoDiagnostic, Report, miette};
use serde_json::{Value, json};

/// Arguments of `bench stability`.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  clothcombo bench stability\n  clothcombo bench stability --body datasets/open/body.npz --json > stability.json\n\n\
        Exit code 1 if any case breaks its promise."
)]
pub struct Arguments {
    /// Body the cases wear: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// The paper's printed form of the energies instead of the default (the layer collision without its gate)
    #[arg(long)]
    printed: bool,
    /// Only cases whose name holds this text
    #[arg(long, value_name = "TEXT")]
    case: Option<String>,
    /// One JSON object with every term of every case instead of a table
    #[arg(long)]
    json: bool,
}

/// Runs the bench.
///
/// # Errors
/// When the body cannot be read or a case breaks its promise.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let wanted = |name: &str| arguments.case.as_ref().is_none_or(|text| name.contains(text.as_str()));
    let selected: Vec<_> = DegenerateCases::all().filter(|case| wanted(case.name)).collect();
    if selected.is_empty() {
        let names: Vec<&str> = DegenerateCases::all().map(|case| case.name).collect();
        let text = arguments.case.as_deref().unwrap_or_default();
        return Err(miette!(
            help = format!("the cases are: {}", names.join("; ")),
            "no case is named like '{text}'"
        ));
    }
    let body = load_body(&arguments.body, 0)?;
    let settings = if arguments.printed { EnergySettings::printed() } else { EnergySettings::default() };
    let cases = DegenerateCases::new(&body).into_diagnostic()?;
    let bar = progress_bar(selected.len(), "degenerate cases {bar:40} {pos}/{len} {msg}");
    let reports: Vec<CaseReport> = selected
        .into_iter()
        .map(|case| {
            bar.set_message(case.name);
            let report = cases.assess(case, &settings, &Term::ALL);
            bar.inc(1);
            report
        })
        .collect();
    bar.finish_and_clear();
    if arguments.json {
        let rows: Vec<Value> = reports.iter().map(json_row).collect();
        let whole = json!({ "body": body.name, "printed": arguments.printed, "cases": rows });
        println!("{}", serde_json::to_string_pretty(&whole).into_diagnostic()?);
    } else {
        print_table(&reports);
    }
    let broken: Vec<String> = reports
        .iter()
        .flat_map(|report| report.faults().into_iter().map(|fault| format!("{}: {fault}", report.case.name)))
        .collect();
    if broken.is_empty() {
        return Ok(());
    }
    Err(miette!("{} broken promises:\n{}", broken.len(), broken.join("\n")))
}

fn json_row(report: &CaseReport) -> Value {
    let case = &report.case;
    let mut row = json!({
        "name": case.name,
        "description": case.description,
        "expectation": case.expectation,
        "vertices": report.vertices,
        "faults": report.faults(),
    });
    match &report.outcome {
        Outcome::Evaluated(terms) => {
            let spoken = terms
                .iter()
                .filter_map(|(term, report)| Some((term.name().to_owned(), json!(report.as_ref()?))));
            row["terms"] = Value::Object(spoken.collect());
        }
        Outcome::Refused(error) => row["error"] = json!(error.to_string()),
    }
    row
}

/// The largest of some number over the terms of a case, and the term.
fn worst(terms: &TermMap<Option<TermReport>>, number: impl Fn(&TermReport) -> f64) -> (f64, &'static str) {
    let numbers = terms.iter().filter_map(|(term, report)| Some((number(report.as_ref()?), term.name())));
    numbers.fold((0.0, "-"), |worst, next| if next.0 > worst.0 || next.0.is_nan() { next } else { worst })
}

fn print_table(reports: &[CaseReport]) {
    println!(
        "{:<40} {:>8} {:>6} {:>10} {:<16} {:>9} {:>9} {:>6} {:>9}  promise",
        "case", "vertices", "finite", "max |g|", "of", "of bound", "FD error", "kinks", "f32 error"
    );
    for report in reports {
        let name = report.case.name;
        let faults = report.faults();
        let kept =
            if faults.is_empty() { "kept".to_owned() } else { format!("BROKEN: {}", faults.join("; ")) };
        match &report.outcome {
            Outcome::Evaluated(terms) => {
                let finite = terms.iter().filter_map(|(_, r)| r.as_ref()).all(|r| r.finite);
                let (largest, of) = worst(terms, |r| r.largest_gradient);
                let share = worst(terms, |r| {
                    if r.gradient_bound > 0.0 { r.largest_gradient / r.gradient_bound } else { 0.0 }
                });
                let kinks: usize = terms.iter().filter_map(|(_, r)| r.as_ref()).map(|r| r.kinks).sum();
                println!(
                    "{name:<40} {:>8} {:>6} {largest:>10.2e} {of:<16} {:>9.1e} {:>9.1e} {kinks:>6} {:>9.1e}  {kept}",
                    report.vertices,
                    if finite { "yes" } else { "NO" },
                    share.0,
                    worst(terms, |r| r.gradient_error).0,
                    worst(terms, value_error).0,
                );
            }
            Outcome::Refused(error) => {
                let promise = match report.case.expectation {
                    Expectation::Refused(_) => "refused",
                    Expectation::Bounded => "REFUSED",
                };
                println!("{name:<40} {promise:>8} {error}  {kept}");
            }
        }
    }
    println!(
        "\n{:<16} {:>9} {:>10} {:>13} {:>9}",
        "term", "FD error", "f32 error", "f32 gradient", "cancels"
    );
    for term in Term::ALL {
        let of_term = || {
            reports.iter().filter_map(|report| match &report.outcome {
                Outcome::Evaluated(terms) => terms[term],
                Outcome::Refused(_) => None,
            })
        };
        let largest = |number: fn(&TermReport) -> f64| of_term().map(|r| number(&r)).fold(0.0, f64::max);
        println!(
            "{term:<16} {:>9.1e} {:>10.1e} {:>13.1e} {:>9}",
            largest(|r| r.gradient_error),
            largest(value_error),
            largest(|r| r.f32_gradient_error),
            of_term().filter(TermReport::cancels).count()
        );
    }
}

/// Relative error of the value in `f32`; a cancellation has none.
fn value_error(report: &TermReport) -> f64 {
    if report.cancels() { 0.0 } else { report.f32_relative() }
}
