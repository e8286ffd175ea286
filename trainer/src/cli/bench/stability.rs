//! `clothcombo bench stability`: the hard cases, one row each.

use crate::cli::output::print_report;
use crate::cli::table::{row, table};
use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::Args;
use clothcombo_data::hard_cases::{CaseReport, Expectation, HardCases, Outcome, TermReport};
use clothcombo_physics::energy::{EnergySettings, Term, TermMap};
use miette::{IntoDiagnostic, Report, miette};
use serde_json::{Value, json};

/// Arguments of `bench stability`.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  clothcombo bench stability\n  clothcombo bench stability --body datasets/open/body.npz --json > stability.json\n\n\
        Exit code 1 if any case violates the invariant."
)]
pub struct Arguments {
    /// Body of the cases: "mannequin" or a body npz
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
/// When the body cannot be read or a case violates the invariant.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let text = arguments.case.as_deref().unwrap_or_default();
    let selected: Vec<_> = HardCases::all().filter(|case| case.name.contains(text)).collect();
    if selected.is_empty() {
        let names: Vec<&str> = HardCases::all().map(|case| case.name).collect();
        return Err(miette!(
            help = format!("the cases are: {}", names.join("; ")),
            "no case is named like '{text}'"
        ));
    }
    let body = load_body(&arguments.body, 0)?;
    let settings = if arguments.printed { EnergySettings::printed() } else { EnergySettings::default() };
    let cases = HardCases::new(&body).into_diagnostic()?;
    let bar = progress_bar(selected.len(), "degenerate cases {bar:40} {pos}/{len} {msg}");
    let assess = |case| {
        let report = cases.assess(case, &settings, &Term::ALL);
        bar.set_message(report.case.name);
        bar.inc(1);
        report
    };
    let reports: Vec<CaseReport> = selected.into_iter().map(assess).collect();
    bar.finish_and_clear();
    let rows: Vec<Value> = reports.iter().map(json_row).collect();
    let whole = json!({ "body": body.name, "printed": arguments.printed, "cases": rows });
    print_report(arguments.json, &whole, |_| format!("{}\n{}", case_table(&reports), term_table(&reports)))?;
    let violations: Vec<String> = reports
        .iter()
        .flat_map(|report| report.faults().into_iter().map(|fault| format!("{}: {fault}", report.case.name)))
        .collect();
    if violations.is_empty() {
        return Ok(());
    }
    Err(miette!("{} violations of the invariant:\n{}", violations.len(), violations.join("\n")))
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
            let evaluated = terms
                .iter()
                .filter_map(|(term, report)| Some((term.name().to_owned(), json!(report.as_ref()?))));
            row["terms"] = Value::Object(evaluated.collect());
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

fn case_table(reports: &[CaseReport]) -> String {
    let head =
        row!["case", "vertices", "finite", "max |g|", "of", "of bound", "FD error", "kinks", "f32 error"];
    let row = |report: &CaseReport| {
        let (name, faults) = (report.case.name, report.faults());
        let kept =
            if faults.is_empty() { "kept".to_owned() } else { format!("BROKEN: {}", faults.join("; ")) };
        let terms = match &report.outcome {
            Outcome::Evaluated(terms) => terms,
            Outcome::Refused(error) => {
                let refused = match report.case.expectation {
                    Expectation::Refused(_) => "refused",
                    Expectation::Bounded => "REFUSED",
                };
                return row![name, "", "", "", "", "", "", "", "", format!("{refused}: {error}  {kept}")];
            }
        };
        let evaluated = || terms.iter().filter_map(|(_, term)| term.as_ref());
        let (largest, of) = worst(terms, |r| r.largest_gradient);
        let share = |r: &TermReport| match r.gradient_bound > 0.0 {
            true => r.largest_gradient / r.gradient_bound,
            false => 0.0,
        };
        row![
            name,
            report.vertices,
            if evaluated().all(|r| r.finite) { "yes" } else { "NO" },
            format!("{largest:.2e}"),
            of,
            scientific(worst(terms, share).0),
            scientific(worst(terms, |r| r.gradient_error).0),
            evaluated().map(|r| r.kinks).sum::<usize>(),
            scientific(worst(terms, value_error).0),
            kept
        ]
    };
    table(&[head, row!["invariant"]].concat(), &reports.iter().map(row).collect::<Vec<_>>())
}

fn term_table(reports: &[CaseReport]) -> String {
    let row = |term: Term| {
        let of_term = || {
            reports.iter().filter_map(|report| match &report.outcome {
                Outcome::Evaluated(terms) => terms[term],
                Outcome::Refused(_) => None,
            })
        };
        let largest =
            |number: fn(&TermReport) -> f64| scientific(of_term().map(|r| number(&r)).fold(0.0, f64::max));
        row![
            term,
            largest(|r| r.gradient_error),
            largest(value_error),
            largest(|r| r.f32_gradient_error),
            of_term().filter(TermReport::cancels).count()
        ]
    };
    table(&["term", "FD error", "f32 error", "f32 gradient", "cancels"], &Term::ALL.map(row))
}

fn scientific(value: f64) -> String {
    format!("{value:.1e}")
}

/// Relative error of the value in `f32`; a cancellation has none.
fn value_error(report: &TermReport) -> f64 {
    if report.cancels() { 0.0 } else { report.f32_relative() }
}
