//! `clothcombo fit`: any garment file onto any body.

use crate::cli::output::print_report;
use crate::cli::values::file_to_make;
use crate::cli::verbosity::spinner;
use crate::dataset::load_body;
use crate::system::paths::{lossy, lossy_option};
use clap::{Parser, ValueEnum};
use clothcombo_data::asset::Category;
use clothcombo_data::fit::{FitReport, FitSettings, Unit, UpAxis, fit};
use clothcombo_data::format::{load_mesh, obj};
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// Fits a garment file to a body: finds unit, axes and arm pose, repairs the mesh, says everything it did
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo fit shirt.glb --body datasets/open/body.npz -o shirt.obj\n  \
        clothcombo fit coat.obj --unit cm --up z --json\n\n\
        Reads OBJ, PLY, STL and glTF. Without -o nothing is written: the report alone is printed."
)]
pub struct Arguments {
    /// Garment: .obj, .ply, .stl, .gltf or .glb
    garment: PathBuf,
    /// Body to fit it to: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// OBJ to write: metres, y up, at rest on the zero body in T-pose; triangles only, without texture coordinates
    #[arg(short, long, value_parser = file_to_make())]
    output: Option<PathBuf>,
    /// Unit of the file: m, dm, cm, mm, inch or auto
    #[arg(long, default_value = "auto", value_parser = automatic::<Unit>)]
    unit: Automatic<Unit>,
    /// Axis of the file that points up: y, z, x or auto
    #[arg(long, default_value = "auto", value_parser = automatic::<UpAxis>)]
    up: Automatic<UpAxis>,
    /// Arms of the garment: level (t), lowered (a), or found out
    #[arg(long, value_enum, default_value_t = ArmPose::Auto)]
    pose: ArmPose,
    /// Category: dress, top, t_shirt, open_shirt, skirt or trousers; guessed from the shape if not given
    #[arg(long)]
    category: Option<Category>,
    /// Print the report as JSON; elements are counted from 0
    #[arg(long)]
    json: bool,
}

/// A value that may be found out.
#[derive(Clone, Copy, Debug)]
struct Automatic<T>(Option<T>);

fn automatic<T: std::str::FromStr<Err = String>>(text: &str) -> Result<Automatic<T>, String> {
    match text {
        "auto" => Ok(Automatic(None)),
        other => other.parse().map(|value| Automatic(Some(value))).map_err(|e: String| format!("{e}, auto")),
    }
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ArmPose {
    T,
    A,
    Auto,
}

#[derive(Serialize)]
struct Output<'a> {
    #[serde(serialize_with = "lossy")]
    garment: &'a Path,
    body: &'a str,
    #[serde(serialize_with = "lossy_option")]
    output: Option<&'a Path>,
    #[serde(flatten)]
    report: &'a FitReport,
}

/// Nothing but an OBJ is written, and never over the garment as it was given.
fn check_output(output: &Path, garment: &Path) -> Result<(), Report> {
    if !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
        let help = format!("for example -o {}", output.with_extension("obj").display());
        return Err(miette!(help = help, "{}: the fitted garment is written as .obj", output.display()));
    }
    let is_same = fs::canonicalize(output).ok().is_some_and(|o| fs::canonicalize(garment).ok() == Some(o));
    match is_same {
        true => Err(miette!(help = "give -o another name", "{} is the garment itself", output.display())),
        false => Ok(()),
    }
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read or written, or the mesh is no garment of this body.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    arguments.output.as_deref().map_or(Ok(()), |output| check_output(output, &arguments.garment))?;
    let body = load_body(&arguments.body, 0)?;
    let file = load_mesh(&arguments.garment).into_diagnostic()?;
    let settings = FitSettings {
        unit: arguments.unit.0,
        up: arguments.up.0,
        arms_lowered: match arguments.pose {
            ArmPose::T => Some(false),
            ArmPose::A => Some(true),
            ArmPose::Auto => None,
        },
        category: arguments.category,
    };
    let fitted = spinner("fitting", || fit(&file, &body, &settings))
        .map_err(|e| miette!("{} on body '{}': {e}", arguments.garment.display(), body.name))?;
    let report = &fitted.report;
    if let Some(output) = &arguments.output {
        let rest = &fitted.garment.rest;
        let mut comments = vec![
            format!("fitted to body '{}': metres, y up, at rest in T-pose", body.name),
            format!("from {}", arguments.garment.file_name().unwrap_or_default().to_string_lossy()),
        ];
        comments.extend(report.assumptions().into_iter().map(|a| format!("assumed: {a}")));
        obj::save(output, rest.positions(), rest.faces(), &comments).into_diagnostic()?;
    }
    let output =
        Output { garment: &arguments.garment, body: &body.name, output: arguments.output.as_deref(), report };
    print_report(arguments.json, &output, |output| match output.output {
        Some(file) => format!("{report}\nwritten   {}\n", file.display()),
        None => format!("{report}\n"),
    })
}
