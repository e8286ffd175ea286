//! `clothcombo check`: every file of a dataset, in one table.

use crate::cli::output::print_report;
use crate::cli::table::{Row, row, table};
use crate::cli::verbosity::progress_bar;
use crate::dataset::load_body;
use clap::Parser;
use clothcombo_data::check::{
    BodyCheck, Checker, FileCheck, GarmentCheck, MotionCheck, find_targets, only_body,
};
use miette::{Report, miette};
use rayon::prelude::*;
use serde::Serialize;
use std::path::PathBuf;

/// Checks garments, bodies and motions; exits 1 if a file is unusable
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo check datasets/open\n  clothcombo check my_garments --body body.npz --json\n\n\
        Garments are measured on the zero body of --body; without it on the one body among the files, else on the mannequin.\n\
        Category, layer and holding in brackets are guesses; layer N+ means layer N or the next one up."
)]
pub struct Arguments {
    /// Files and folders; folders are searched through, garments.toml is obeyed
    #[arg(required = true)]
    paths: Vec<PathBuf>,
    /// Body the garments lie on: "mannequin" or a body npz
    #[arg(long)]
    body: Option<String>,
    /// Print JSON instead of tables; elements are counted from 0
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct CheckOutput<'a> {
    body: &'a str,
    unusable: usize,
    files: &'a [FileCheck],
}

/// Runs the verb.
///
/// # Errors
/// When the body cannot be read, or any file is unusable; each is named.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let targets = find_targets(&arguments.paths);
    let only =
        || only_body(&targets).map_or_else(|| "mannequin".to_owned(), |path| path.display().to_string());
    let body_name = arguments.body.clone().unwrap_or_else(only);
    let checker = Checker::new(load_body(&body_name, 0)?);
    let bar = progress_bar(targets.len(), "checking {bar:40} {pos}/{len} · {eta} left");
    let check = |target| {
        let file = checker.check(target);
        bar.inc(1);
        file
    };
    let files: Vec<FileCheck> = targets.par_iter().map(check).collect();
    bar.finish_and_clear();
    let unusable: Vec<&str> = files.iter().filter_map(|f| f.unusable.as_deref()).collect();
    let output = CheckOutput { body: &body_name, unusable: unusable.len(), files: &files };
    print_report(arguments.json, &output, text)?;
    match unusable.is_empty() {
        true => Ok(()),
        false => Err(miette!(
            help =
                "`clothcombo fit` repairs garments; other files must be found, exported or downloaded again",
            "{} of {} files are unusable\n{}",
            unusable.len(),
            files.len(),
            unusable.join("\n")
        )),
    }
}

fn text(output: &CheckOutput<'_>) -> String {
    let files = output.files;
    let name = |f: &FileCheck| f.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let garments: Vec<Row> =
        files.iter().filter_map(|f| f.garment.as_ref().map(|g| garment_row(&name(f), g))).collect();
    let bodies: Vec<Row> =
        files.iter().filter_map(|f| f.body.as_ref().map(|b| body_row(&name(f), b))).collect();
    let motions: Vec<Row> =
        files.iter().filter_map(|f| f.motion.as_ref().map(|m| motion_row(&name(f), m))).collect();
    let mut lines = Vec::new();
    for file in files {
        lines.extend(file.warnings.iter().map(|warning| format!("warning {}: {warning}", name(file))));
        lines.extend(file.unusable.iter().map(|reason| format!("unusable {reason}")));
    }
    let warned = files.iter().filter(|f| f.unusable.is_none() && !f.warnings.is_empty()).count();
    lines.push(format!(
        "{} files against body '{}': {} usable, {warned} of them with warnings, {} unusable\n",
        files.len(),
        output.body,
        files.len() - output.unusable,
        output.unusable
    ));
    [garments, bodies, motions].map(|rows| table(&rows)).concat() + &lines.join("\n")
}

fn body_row(name: &str, b: &BodyCheck) -> Row {
    row! {
        "body" => name,
        "verts" => b.vertices,
        "tris" => b.triangles,
        "joints" => b.joints,
        "shape components" => b.shape_components,
        "height m" => b.height,
        "skin weights sum to" => format!("{:.4}–{:.4}", b.weight_sums[0], b.weight_sums[1]),
    }
}

fn motion_row(name: &str, m: &MotionCheck) -> Row {
    row! {
        "motion" => name,
        "frames" => m.frames,
        "frames/s" => m.frame_rate,
        "s" => m.duration,
        "frames outside joint limits" => m.frames_outside_limits,
        "by up to °" => m.largest_excess_degrees,
    }
}

fn garment_row(name: &str, g: &GarmentCheck) -> Row {
    let guess = |text: String, guessed: bool| if guessed { format!("({text})") } else { text };
    let layer = match g.layer {
        [low, high] if high == low + 1 => format!("{low}+"),
        [low, high] if high == low => format!("{low}"),
        [low, high] => format!("{low}–{high}"),
    };
    let m = &g.mesh;
    row! {
        "garment" => name,
        "verts" => m.vertices,
        "tris" => m.triangles,
        "pcs" => m.components,
        "rim" => m.boundary_loops,
        "edge mm (min–max)" => format!("{:.1} ({:.1}–{:.1})", m.edge_median_mm, m.edge_min_mm, m.edge_max_mm),
        "category" => guess(g.category.to_string(), g.category_guessed),
        "layer" => guess(layer, g.layer_guessed),
        "held" => g.holding,
        "min mm" => g.distance_min_mm,
        "mid mm" => g.distance_median_mm,
        "inside" => g.inside,
        "body×" => g.body_triangle_pairs,
        "self×" => g.self_triangle_pairs,
        "defects" => m.defects.counts().iter().map(|(n, _)| n).sum::<usize>(),
    }
}
