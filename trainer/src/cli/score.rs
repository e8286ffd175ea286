//! `clothcombo score`.

use crate::score::{Score, score};
use clap::Parser;
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Scores anyone's draped garments: energies in the paper's printed form, exact intersections, layer order
#[derive(Parser)]
#[command(
    after_help = "Example (inner to outer):\n  clothcombo score --body body.obj --rest tee.obj coat.obj --draped tee_d.obj coat_d.obj --json"
)]
pub struct Arguments {
    /// The posed body
    #[arg(long)]
    body: PathBuf,
    /// Rest meshes, innermost first
    #[arg(long, num_args = 1.., required = true)]
    rest: Vec<PathBuf>,
    /// Draped meshes of the same topology, in the same order
    #[arg(long, num_args = 1.., required = true)]
    draped: Vec<PathBuf>,
    /// Distances to the closest surface point instead of the nearest vertex
    #[arg(long)]
    surface: bool,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read or meshes do not fit together.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let score = score(&arguments.body, &arguments.rest, &arguments.draped, arguments.surface)?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&score).into_diagnostic()?);
    } else {
        print_tables(&score);
    }
    Ok(())
}

fn print_tables(score: &Score) {
    println!(
        "{:<24}{:>9}{:>10}{:>10}{:>10}{:>12}{:>11}{:>10}{:>10}{:>8}{:>8}",
        "garment (raw, J)",
        "vertices",
        "strain",
        "bending",
        "gravity",
        "collision",
        "repulsion",
        "inside %",
        "depth mm",
        "body ×",
        "self ×"
    );
    for g in &score.garments {
        let raw = |name: &str| g.raw.get(name).copied().unwrap_or(0.0);
        println!(
            "{:<24}{:>9}{:>10.4}{:>10.5}{:>10.4}{:>12.3e}{:>11.2}{:>10.2}{:>10.2}{:>8}{:>8}",
            g.name,
            g.vertices,
            raw("strain"),
            raw("bending"),
            raw("gravity"),
            raw("body_collision"),
            raw("repulsion"),
            100.0 * g.penetration.vertices_inside,
            g.penetration.max_depth_mm,
            g.penetration.body_triangle_pairs,
            g.penetration.self_triangle_pairs
        );
    }
    if !score.layers.is_empty() {
        println!("\n{:<16}{:>16}{:>16}{:>10}{:>14}", "layers", "collision", "distance", "pairs ×", "wrong side %");
    }
    for l in &score.layers {
        println!(
            "{:<16}{:>16.3e}{:>16.3e}{:>10}{:>14.2}",
            format!("{} under {}", l.inner, l.outer),
            l.layer_collision,
            l.layer_distance,
            l.triangle_pairs,
            100.0 * l.order_violations
        );
    }
}
