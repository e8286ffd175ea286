//! `clothcombo fit`: any garment file onto any body.

mod output;

use super::fit_arguments::FitArguments;
use crate::cli::output::print_report;
use crate::cli::values::file_to_make;
use crate::cli::verbosity::spinner;
use crate::dataset::load_body;
use crate::system::paths::{lossy, lossy_option};
use clap::Parser;
use clothcombo_data::fit::{FitReport, fit};
use miette::{IntoDiagnostic, Report, miette};
use output::{OutputForm, check_output, read, save};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Fits a garment file to a body: finds unit, axes and arm pose, repairs the mesh, says everything it did
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo fit shirt.glb --body datasets/open/body.npz -o shirt.obj\n  \
        clothcombo fit coat.obj --unit cm --up z --json\n  \
        clothcombo fit thick.obj --keep outer -o thin.obj\n  \
        clothcombo fit dress.obj --from-body SMPL_NEUTRAL.npz:1.2,-0.5 --body datasets/open/body.npz -o dress_fitted.obj\n\n\
        Reads OBJ, PLY, STL and glTF. Without -o nothing is written: the report alone is printed.\n\n\
        The OBJ is in metres, y up, at rest on the zero body in T-pose. What `check` would say of it are the report's warnings.\n\
        It has the file's own faces (quads too), texture coordinates, groups, materials and order of vertices,\n\
        except where that would be wrong: vertices and faces that were dropped are left out, vertices that were welded or joined\n\
        are one, and faces whose parts were dropped, cut or split are triangles. --triangles writes the triangles alone,\n\
        --with-thickness all of the file's vertices and faces, with both sheets of thick cloth."
)]
pub struct Arguments {
    /// Garment: .obj, .ply, .stl, .gltf or .glb
    garment: PathBuf,
    /// Body to fit it to: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// OBJ to write, with its materials beside it
    #[arg(short, long, value_parser = file_to_make())]
    output: Option<PathBuf>,
    /// Writes the repaired triangles alone, as they enter training
    #[arg(long, requires = "output")]
    triangles: bool,
    /// Writes all vertices and faces of the file: what --keep left out follows the sheet that was kept, as thick as it
    /// was. Such a file is for looking at, not for training
    #[arg(long, requires_all = ["output", "keep"], conflicts_with = "triangles")]
    with_thickness: bool,
    #[command(flatten)]
    hints: FitArguments,
    /// Print the report as JSON; elements are counted from 0
    #[arg(long)]
    json: bool,
}

impl Arguments {
    fn form(&self) -> OutputForm {
        match (self.triangles, self.with_thickness) {
            (true, _) => OutputForm::Triangles,
            (_, true) => OutputForm::Whole,
            _ => OutputForm::Repaired,
        }
    }
}

#[derive(Serialize)]
struct FitOutput<'a> {
    #[serde(serialize_with = "lossy")]
    garment: &'a Path,
    body: &'a str,
    #[serde(serialize_with = "lossy_option")]
    output: Option<&'a Path>,
    warnings: Vec<String>,
    #[serde(flatten)]
    report: &'a FitReport,
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read or written, or the mesh is no garment of this body.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let settings = arguments.hints.settings().into_diagnostic()?;
    arguments
        .output
        .as_deref()
        .map_or(Ok(()), |output| check_output(output, &arguments.garment, settings.from_body.as_deref()))?;
    let body = load_body(&arguments.body, 0)?;
    let given = read(&arguments.garment)?;
    let fitted = spinner("fitting", || fit(&given.mesh, &body, &settings))
        .map_err(|e| miette!("{} on body '{}': {e}", arguments.garment.display(), body.name))?;
    let report = &fitted.report;
    if let Some(output) = &arguments.output {
        let mut comments = vec![
            format!("fitted to body '{}': metres, y up, at rest in T-pose", body.name),
            format!("from {}", arguments.garment.file_name().unwrap_or_default().to_string_lossy()),
        ];
        comments.extend(report.assumptions().into_iter().map(|a| format!("assumed: {a}")));
        save(output, &given, &fitted, arguments.form(), &comments)?;
    }
    let output = FitOutput {
        garment: &arguments.garment,
        body: &body.name,
        output: arguments.output.as_deref(),
        warnings: report.warnings(),
        report,
    };
    print_report(arguments.json, &output, |output| match output.output {
        Some(file) => format!("{report}\nwritten   {}\n", file.display()),
        None => format!("{report}\n"),
    })
}
