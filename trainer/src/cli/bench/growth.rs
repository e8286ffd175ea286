//! `clothcombo bench growth`.

use crate::cli::values::{measuring_seconds, picture_file};
use crate::cli::verbosity::progress_bar;
use crate::picture::{Line, LinePanel, draw_lines, save_png};
use crate::training::measure::Case;
use clap::Parser;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::Serialize;
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

/// How time and memory of a training step grow with vertices, layers, width and eigenpairs
#[derive(Parser)]
#[command(after_help = "Example:\n  clothcombo bench growth --picture docs/growth.png > growth.md\n\n\
        Every size runs in a process of its own, because memory that a process gave back may still count as its own. \
        Two threads and fewer: RAYON_NUM_THREADS=2. Nothing else should run meanwhile.")]
pub struct Arguments {
    /// Vertices per garment; one garment, networks of --width
    #[arg(long, value_delimiter = ',', default_values_t = [1000, 2000, 4000, 8000, 16000, 20000])]
    vertices: Vec<usize>,
    /// Numbers of garments of 2,000 vertices; networks of --width
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2, 3, 4, 6, 8])]
    layers: Vec<usize>,
    /// Widths; one garment of 2,000 vertices, all with the depth and eigenpairs of --width
    #[arg(long, value_delimiter = ',', default_values_t = [32, 64, 128, 256, 512])]
    widths: Vec<usize>,
    /// Eigenpairs; one garment of 2,000 vertices, networks of --width
    #[arg(long, value_delimiter = ',', default_values_t = [16, 32, 64, 128])]
    eigen_counts: Vec<usize>,
    /// Width where it is not what varies
    #[arg(long, default_value_t = 64)]
    width: usize,
    /// Time spent on each single measurement [s]
    #[arg(long, default_value_t = 0.5, value_parser = measuring_seconds)]
    seconds: f64,
    /// Writes the curves (PNG)
    #[arg(long, value_name = "FILE", value_parser = picture_file())]
    picture: Option<PathBuf>,
    /// Print JSON instead of Markdown tables
    #[arg(long)]
    json: bool,
}

/// One measured size.
#[derive(Clone, Copy, Debug, Serialize)]
struct Point {
    /// What varies: vertices of all garments, garments, width or eigenpairs.
    size: f64,
    step_ms: f64,
    forward_ms: f64,
    losses_ms: f64,
    peak_mib: f64,
}

/// One quantity varied, the others fixed.
#[derive(Clone, Debug, Serialize)]
struct Sweep {
    varied: &'static str,
    fixed: String,
    points: Vec<Point>,
    exponents: Exponents,
}

/// Slopes of the logarithms over the whole sweep, and between its two largest sizes.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Exponents {
    step: f64,
    step_at_the_end: f64,
    forward: f64,
    losses: f64,
    memory: f64,
}

/// Runs the verb.
///
/// # Errors
/// When a size is out of range, a measurement fails or the picture cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let Arguments { vertices, layers, widths, eigen_counts, width, .. } = arguments;
    let base = Case::new(*width, 1, 2000);
    let sweeps: [(&'static str, Vec<Case>); 4] = [
        ("vertices", vertices.iter().map(|&vertices| Case { vertices, ..base }).collect()),
        ("layers", layers.iter().map(|&layers| Case { layers, ..base }).collect()),
        ("width", widths.iter().map(|&width| Case { width, ..base }).collect()),
        ("eigenpairs", eigen_counts.iter().map(|&eigen_count| Case { eigen_count, ..base }).collect()),
    ];
    for case in sweeps.iter().flat_map(|(_, cases)| cases) {
        case.config(&[])?;
    }
    let bar = progress_bar(
        sweeps.iter().map(|(_, cases)| cases.len()).sum(),
        "{bar:40} {pos}/{len} {msg} · {eta} left",
    );
    let mut measured = Vec::with_capacity(sweeps.len());
    for (varied, cases) in sweeps {
        let mut points = Vec::with_capacity(cases.len());
        for case in &cases {
            bar.set_message(case.name());
            points.push(measure(varied, case, base, arguments.seconds)?);
            bar.inc(1);
        }
        let fixed = fixed(varied, base);
        measured.push(Sweep { varied, fixed, exponents: exponents(&points), points });
    }
    bar.finish_and_clear();
    if let Some(path) = &arguments.picture {
        let picture = draw_lines("Growth of a training step", &panels(&measured)).into_diagnostic()?;
        save_png(&picture, path).into_diagnostic()?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&measured).into_diagnostic()?);
    } else {
        measured.iter().for_each(print_table);
    }
    Ok(())
}

fn fixed(varied: &str, Case { vertices, layers, width, eigen_count, blocks, .. }: Case) -> String {
    let parts = [
        ("vertices", format!("{vertices} vertices per garment")),
        ("layers", format!("M = {layers}")),
        ("width", format!("width {width}")),
        ("eigenpairs", format!("k = {eigen_count}")),
    ];
    let parts: Vec<String> =
        parts.into_iter().filter(|(name, _)| *name != varied).map(|(_, text)| text).collect();
    format!("{}, {blocks} DiffusionNet blocks", parts.join(", "))
}

/// Runs one size in a process of its own.
fn measure(varied: &str, case: &Case, base: Case, seconds: f64) -> Result<Point, Report> {
    let program =
        std::env::current_exe().into_diagnostic().wrap_err("the path of this program is not known")?;
    let numbers = [
        ("--widths", case.width),
        ("--layers", case.layers),
        ("--vertices", case.vertices),
        ("--eigen-count", case.eigen_count),
        ("--blocks", base.blocks),
        ("--steps", 1),
    ];
    let mut command = Command::new(program);
    command.args(["bench", "step", "--json", "--seconds", &seconds.to_string()]);
    for (option, number) in numbers {
        command.args([option, &number.to_string()]);
    }
    let output = command.output().into_diagnostic().wrap_err("this program cannot be started again")?;
    if !output.status.success() {
        return Err(miette!("{}: {}", case.name(), String::from_utf8_lossy(&output.stderr).trim()));
    }
    let report: Value = serde_json::from_slice(&output.stdout).into_diagnostic()?;
    let found = &report["cases"][0];
    let cost = |name: &str| found["costs"][name].as_f64().unwrap_or(f64::NAN);
    let size = match varied {
        "vertices" => found["vertices"].as_f64().unwrap_or(f64::NAN),
        "layers" => case.layers as f64,
        "width" => case.width as f64,
        _ => case.eigen_count as f64,
    };
    Ok(Point {
        size,
        step_ms: cost("step_ms"),
        forward_ms: cost("forward_ms"),
        losses_ms: cost("losses_ms"),
        peak_mib: cost("peak_mib"),
    })
}

fn exponents(points: &[Point]) -> Exponents {
    let all =
        |value: fn(&Point) -> f64| slope(&points.iter().map(|p| (p.size, value(p))).collect::<Vec<_>>());
    let last = &points[points.len().saturating_sub(2)..];
    Exponents {
        step: all(|p| p.step_ms),
        step_at_the_end: slope(&last.iter().map(|p| (p.size, p.step_ms)).collect::<Vec<_>>()),
        forward: all(|p| p.forward_ms),
        losses: all(|p| p.losses_ms),
        memory: all(|p| p.peak_mib),
    }
}

/// Least-squares slope of log value over log size; NaN for fewer than two sizes.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let logs = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (x, y) = logs().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / count, sum.1 + y / count));
    let (across, along) =
        logs().fold((0.0, 0.0), |sum, (lx, ly)| (sum.0 + (lx - x) * (ly - y), sum.1 + (lx - x).powi(2)));
    across / along
}

fn panels(sweeps: &[Sweep]) -> Vec<LinePanel> {
    sweeps
        .iter()
        .map(|sweep| {
            let line = |name: String, value: fn(&Point) -> f64| Line {
                name,
                points: sweep.points.iter().map(|p| (p.size, value(p))).collect(),
            };
            let e = &sweep.exponents;
            LinePanel {
                // What is fixed stands in the table; it does not fit over a panel.
                title: format!("over {}", sweep.varied),
                lines: vec![
                    line(format!("step [ms], exponent {:.2}", e.step), |p| p.step_ms),
                    line(format!("forward [ms], exponent {:.2}", e.forward), |p| p.forward_ms),
                    line(format!("losses [ms], exponent {:.2}", e.losses), |p| p.losses_ms),
                    line(format!("peak memory [MiB], exponent {:.2}", e.memory), |p| p.peak_mib),
                ],
            }
        })
        .collect()
}

fn print_table(sweep: &Sweep) {
    use super::step::short;
    println!("### {} ({})\n", sweep.varied, sweep.fixed);
    println!("| {} | step [ms] | forward [ms] | losses [ms] | peak memory [MiB] |", sweep.varied);
    println!("|---:|---:|---:|---:|---:|");
    for p in &sweep.points {
        let times = [p.step_ms, p.forward_ms, p.losses_ms].map(short).join(" | ");
        println!("| {} | {times} | {:.0} |", p.size, p.peak_mib);
    }
    let e = &sweep.exponents;
    println!(
        "| exponent (at the end) | {:.2} ({:.2}) | {:.2} | {:.2} | {:.2} |\n",
        e.step, e.step_at_the_end, e.forward, e.losses, e.memory
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_power_is_its_exponent() {
        let points: Vec<(f64, f64)> = [1.0, 2.0, 5.0, 9.0].map(|x: f64| (x, 3.0 * x.powf(1.3))).to_vec();
        assert!((slope(&points) - 1.3).abs() < 1e-12);
        assert!(slope(&points[..1]).is_nan());
    }
}
