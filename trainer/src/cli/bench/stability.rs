//! `clothcombo bench stability`: the degenerate cases, one row each.

use crate::cli::output::print_report;
use crate::cli::table::{Row, row, table};
use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::Args;
use clothcombo_data::degenerate_cases::{CaseOutcome, CaseReport, DegenerateCases, Expectation, TermReport};
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
    let wanted = arguments.case.as_deref().unwrap_or_default();
    let selected: Vec<_> = DegenerateCases::all().filter(|case| case.name.contains(wanted)).collect();
    if selected.is_empty() {
        let names: Vec<&str> = DegenerateCases::all().map(|case| case.name).collect();
        return Err(miette!(
            help = format!("the cases are: {}", names.join("; ")),
            "no case is named like '{wanted}'"
        ));
    }
    let body = load_body(&arguments.body, 0)?;
    let settings = if arguments.printed { EnergySettings::printed() } else { EnergySettings::default() };
    let cases = DegenerateCases::new(&body).into_diagnostic()?;
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
    print_report(arguments.json, &whole, |_| text(&reports))?;
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
        CaseOutcome::Evaluated(terms) => {
            let evaluated = terms
                .iter()
                .filter_map(|(term, report)| Some((term.name().to_owned(), json!(report.as_ref()?))));
            row["terms"] = Value::Object(evaluated.collect());
        }
        CaseOutcome::Refused(error) => row["error"] = json!(error.to_string()),
    }
    row
}

/// The largest of some number over the terms of a case, and the term.
fn worst(terms: &TermMap<Option<TermReport>>, number: impl Fn(&TermReport) -> f64) -> (f64, &'static str) {
    let numbers = terms.iter().filter_map(|(term, report)| Some((number(report.as_ref()?), term.name())));
    numbers.fold((0.0, "-"), |worst, next| if next.0 > worst.0 || next.0.is_nan() { next } else { worst })
}

fn text(reports: &[CaseReport]) -> String {
    // Refused cases have other columns than evaluated ones.
    let is_refused = |report: &&CaseReport| matches!(report.outcome, CaseOutcome::Refused(_));
    let (refused, evaluated): (Vec<_>, Vec<_>) = reports.iter().partition(is_refused);
    let cases = |reports: Vec<&CaseReport>| table(&reports.into_iter().map(case_row).collect::<Vec<_>>());
    let tables = [cases(evaluated), cases(refused), table(&Term::ALL.map(|term| term_row(term, reports)))];
    tables.into_iter().filter(|table| !table.is_empty()).collect::<Vec<_>>().join("\n")
}

fn case_row(report: &CaseReport) -> Row {
    let faults = report.faults();
    let kept = if faults.is_empty() { "kept".to_owned() } else { format!("BROKEN: {}", faults.join("; ")) };
    let name = report.case.name;
    let terms = match &report.outcome {
        CaseOutcome::Evaluated(terms) => terms,
        CaseOutcome::Refused(error) => {
            let refused = match report.case.expectation {
                Expectation::Refused(_) => "refused",
                Expectation::Bounded => "REFUSED",
            };
            return row!["case" => name, "" => refused, "error" => error.to_string(), "invariant" => kept];
        }
    };
    let evaluated = || terms.iter().filter_map(|(_, term)| term.as_ref());
    let (largest, of) = worst(terms, |r| r.largest_gradient);
    let share =
        |r: &TermReport| if r.gradient_bound > 0.0 { r.largest_gradient / r.gradient_bound } else { 0.0 };
    row! {
        "case" => name,
        "vertices" => report.vertices,
        "finite" => if evaluated().all(|r| r.finite) { "yes" } else { "NO" },
        "max |g|" => largest,
        "of" => of,
        "of bound" => worst(terms, share).0,
        "FD error" => worst(terms, |r| r.gradient_error).0,
        "kinks" => evaluated().map(|r| r.kinks).sum::<usize>(),
        "f32 error" => worst(terms, value_error).0,
        "invariant" => kept,
    }
}

fn term_row(term: Term, reports: &[CaseReport]) -> Row {
    let of_term = || {
        reports.iter().filter_map(|report| match &report.outcome {
            CaseOutcome::Evaluated(terms) => terms[term],
            CaseOutcome::Refused(_) => None,
        })
    };
    let largest = |number: fn(&TermReport) -> f64| of_term().map(|r| number(&r)).fold(0.0, f64::max);
    row! {
        "term" => term.name(),
        "FD error" => largest(|r| r.gradient_error),
        "f32 error" => largest(value_error),
        "f32 gradient" => largest(|r| r.f32_gradient_error),
        "cancels" => of_term().filter(TermReport::cancels).count(),
    }
}

/// Relative error of the value in `f32`; a cancellation has none.
fn value_error(report: &TermReport) -> f64 {
    if report.cancels() { 0.0 } else { report.f32_relative() }
}
