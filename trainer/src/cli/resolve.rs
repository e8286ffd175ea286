//! `clothcombo resolve`: anyone's garments taken out of anyone's body, and out of each other.

use crate::cli::output::print_report;
use crate::cli::post_process::{PostProcessArguments, left_over};
use crate::cli::table::{row, table};
use crate::cli::verbosity::spinner;
use crate::inference::UniqueNames;
use crate::inference::output::Staged;
use crate::picture::{DressedRow, draw_dressed, save_png};
use crate::score::{DrapedGarment, NamedMesh, Score, ScoreDistance, checked_body, checked_garment, score};
use crate::system::paths::lossy;
use clap::Parser;
use clothcombo_data::format::obj::MovedObj;
use clothcombo_data::format::{MeshFormat, load_mesh};
use clothcombo_physics::contact::resolve::{
    Certificate, Layer, ResolveError, ResolveSettings, Resolved, RestGarment, certify, resolve,
};
use clothcombo_physics::mesh::TriMesh;
use clothcombo_physics::query::Surface;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::Serialize;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Takes draped garments out of the body and out of each other, in their order, and proves what it reached
#[derive(Parser)]
#[command(
    after_help = "Files are meshes of any topology in metres, y up (OBJ, PLY, STL, glTF); nothing is trained or fitted.\n\
                  Vertices of an OBJ file move, its normals go, its materials come along; faces, groups and texture\n\
                  coordinates stay. What cannot be resolved is listed in report.json.\n\n\
                  Example (inner to outer):\n  clothcombo resolve --body body.obj --garments tee.obj coat.obj -o resolved"
)]
pub struct Arguments {
    /// The posed body
    #[arg(long, value_name = "MESH")]
    body: PathBuf,
    /// Draped garments, innermost first
    #[arg(long, num_args = 1.., required = true, value_name = "MESH")]
    garments: Vec<PathBuf>,
    /// Their rest meshes, in the same order, for strain; default: the garments as they are
    #[arg(long, num_args = 1.., value_name = "MESH")]
    rest: Vec<PathBuf>,
    /// Folder to make, for NAME.obj (and NAME.mtl) of every garment, picture.png, layers.png and report.json
    #[arg(short, long, default_value = "resolved")]
    output: PathBuf,
    /// Replaces the folder of an earlier run
    #[arg(long)]
    replace: bool,
    #[command(flatten)]
    post_process: PostProcessArguments,
    /// Leave self-intersections of the garments
    #[arg(long)]
    keep_self: bool,
    /// Print the report as JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Everything `report.json` holds.
#[derive(Serialize)]
struct ResolveReport {
    gap_mm: f64,
    before: Score,
    after: Score,
    certificate_before: Certificate,
    certificate: Certificate,
    milliseconds: Milliseconds,
    garments: Vec<ResolvedGarment>,
}

#[derive(Serialize)]
struct Milliseconds {
    body: f64,
    resolve: Vec<f64>,
    certificate: f64,
}

#[derive(Serialize)]
struct ResolvedGarment {
    name: String,
    #[serde(serialize_with = "lossy")]
    output: PathBuf,
    rounds: usize,
    moved_vertices: usize,
    largest_move_mm: f64,
}

/// A garment as read.
struct ReadGarment {
    path: PathBuf,
    name: String,
    rest: TriMesh,
    draped: TriMesh,
}

impl ReadGarment {
    fn file(&self) -> String {
        format!("{}.obj", self.name)
    }
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read or written, or meshes do not fit together. Intersections that stay are a result, not an error.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let settings =
        ResolveSettings { self_contact: !arguments.keep_self, ..arguments.post_process.settings() };
    settings.check().into_diagnostic()?;
    let inputs: Vec<PathBuf> =
        [&arguments.body].into_iter().chain(&arguments.garments).chain(&arguments.rest).cloned().collect();
    let staged = Staged::new(&arguments.output, arguments.replace, &inputs)?;
    let body = checked_body(NamedMesh::load_body(&arguments.body)?)?;
    let garments = load_garments(arguments, &body)?;
    let surface = Surface::from_mesh(&body);
    let rest: Vec<RestGarment> = garments.iter().map(|g| RestGarment::new(&g.rest)).collect();
    let layers: Vec<Layer> = rest
        .iter()
        .zip(&garments)
        .map(|(garment, read)| Layer { garment, positions: read.draped.positions() })
        .collect();
    let named = |error: ResolveError| {
        let path = error.garment().map(|garment| garments[garment].path.display().to_string());
        let report = Report::from_err(error);
        match path {
            Some(path) => report.wrap_err(path),
            None => report,
        }
    };
    let certificate_before =
        spinner("counting intersections", || certify(&surface, &layers)).map_err(named)?;
    let resolved = spinner("resolving", || resolve(&surface, &layers, &settings)).map_err(named)?;
    let scored = |positions: Vec<&[[f64; 3]]>| {
        let draped = |(g, positions)| {
            let ReadGarment { name, rest, .. }: &ReadGarment = g;
            DrapedGarment { name, rest, positions, canonical: None }
        };
        let draped: Vec<DrapedGarment> = garments.iter().zip(positions).map(draped).collect();
        score(&body, &draped, ScoreDistance::Surface)
    };
    let ms = |time: Duration| 1e3 * time.as_secs_f64();
    let report = ResolveReport {
        gap_mm: arguments.post_process.gap_mm,
        before: spinner("scoring", || scored(garments.iter().map(|g| g.draped.positions()).collect()))?,
        after: spinner("scoring", || scored(resolved.positions.iter().map(Vec::as_slice).collect()))?,
        certificate_before,
        certificate: resolved.certificate.clone(),
        milliseconds: Milliseconds {
            body: ms(resolved.body_time),
            resolve: resolved.garments.iter().map(|g| ms(g.time)).collect(),
            certificate: ms(resolved.certificate_time),
        },
        garments: garments
            .iter()
            .zip(&resolved.garments)
            .map(|(garment, work)| ResolvedGarment {
                name: garment.name.clone(),
                output: arguments.output.join(garment.file()),
                rounds: work.rounds,
                moved_vertices: work.moved,
                largest_move_mm: 1e3 * work.largest_move,
            })
            .collect(),
    };
    spinner("writing", || write(staged, &body, &garments, &resolved, &report))?;
    print_report(arguments.json, &report, |report| text(report, arguments.keep_self))
}

fn load_garments(arguments: &Arguments, body: &TriMesh) -> Result<Vec<ReadGarment>, Report> {
    let (draped, rest) = (&arguments.garments, &arguments.rest);
    if !rest.is_empty() && rest.len() != draped.len() {
        return Err(miette!(
            help = "give each garment once in both lists, from the body outwards",
            "{} rest meshes (--rest) but {} garments (--garments)",
            rest.len(),
            draped.len()
        ));
    }
    let mut garments: Vec<ReadGarment> = Vec::with_capacity(draped.len());
    let mut names = UniqueNames::default();
    for (i, path) in draped.iter().enumerate() {
        let (rest, draped) = (NamedMesh::load(rest.get(i).unwrap_or(path))?, NamedMesh::load(path)?);
        let name = checked_garment(&rest, &draped, body)?;
        // Two files of one name from two folders must not overwrite each other.
        garments.push(ReadGarment {
            path: path.clone(),
            name: names.take(&name),
            rest: rest.mesh,
            draped: draped.mesh,
        });
    }
    Ok(garments)
}

/// Writes everything, after everything that could fail has been computed.
fn write(
    staged: Staged,
    body: &TriMesh,
    garments: &[ReadGarment],
    resolved: &Resolved,
    report: &ResolveReport,
) -> Result<(), Report> {
    let meshes = garments.iter().zip(&resolved.positions).map(|(garment, p)| moved(garment, p));
    let meshes = meshes.collect::<Result<Vec<_>, Report>>()?;
    let json = serde_json::to_string_pretty(report).into_diagnostic()?;
    let folder = staged.folder();
    let failed = |name: &str| format!("cannot write {}", folder.join(name).display());
    for (garment, mesh) in garments.iter().zip(&meshes) {
        mesh.save(folder, &garment.name).into_diagnostic().wrap_err_with(|| failed(&garment.file()))?;
    }
    save_pictures(folder, body, garments, resolved)?;
    fs::write(folder.join("report.json"), json).into_diagnostic().wrap_err_with(|| failed("report.json"))?;
    staged.commit()
}

/// Writes `picture.png`, before and after one below the other, and `layers.png`, after, each garment alone, where there is more
/// than one.
fn save_pictures(
    folder: &Path,
    body: &TriMesh,
    garments: &[ReadGarment],
    resolved: &Resolved,
) -> Result<(), Report> {
    let rows = [
        row("before", body, garments, garments.iter().map(|garment| garment.draped.positions())),
        row("after", body, garments, resolved.positions.iter().map(Vec::as_slice)),
    ];
    let names: Vec<&str> = garments.iter().map(|garment| garment.name.as_str()).collect();
    let save = |rows: &[DressedRow<'_>], name: &str| {
        save_png(&draw_dressed("clothcombo resolve", &names, rows), &folder.join(name)).into_diagnostic()
    };
    save(&rows, "picture.png")?;
    match garments {
        [_] => Ok(()),
        _ => save(&rows[1].layers(&names), "layers.png"),
    }
}

fn row<'a>(
    label: &str,
    body: &'a TriMesh,
    garments: &'a [ReadGarment],
    positions: impl Iterator<Item = &'a [[f64; 3]]>,
) -> DressedRow<'a> {
    DressedRow {
        label: label.to_owned(),
        body: (body.positions(), body.faces()),
        heading: 0.0,
        garments: positions.zip(garments).map(|(p, garment)| (p, garment.draped.faces())).collect(),
        innermost: 0,
    }
}

/// The garment's file with new positions; a file of another format becomes an OBJ of its polygons.
fn moved(garment: &ReadGarment, positions: &[[f64; 3]]) -> Result<MovedObj, Report> {
    let path = &garment.path;
    let bytes = fs::read(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    if MeshFormat::detect(path, &bytes) == Some(MeshFormat::Obj) {
        return MovedObj::new(path, &bytes, positions, &garment.name)
            .map_err(|count| miette!("{} changed while it was read: {count} vertices now", path.display()));
    }
    let mut text = String::new();
    for [x, y, z] in positions {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for polygon in load_mesh(path).into_diagnostic()?.polygons() {
        text.push('f');
        polygon.iter().for_each(|v| {
            let _ = write!(text, " {}", u64::from(*v) + 1);
        });
        text.push('\n');
    }
    Ok(MovedObj { obj: text.into_bytes(), mtl: None, libraries: Vec::new() })
}

fn text(report: &ResolveReport, keeps_self: bool) -> String {
    let row = |what: &str, value: fn(&Certificate) -> Option<f64>| {
        let [before, after] = [&report.certificate_before, &report.certificate].map(value);
        row!["" => what, "before" => before, "after" => after]
    };
    let rows = [
        row("pairs with the body", |c| Some(c.body_triangle_pairs as f64)),
        row("pairs between garments", |c| Some(c.layer_triangle_pairs as f64)),
        row("pairs of a garment with itself", |c| Some(c.self_triangle_pairs as f64)),
        row("pairs where the body is pinched", |c| Some(c.pinched.count() as f64)),
        row("length of the intersection curves [mm]", |c| Some(c.contour_length_mm)),
        row("deepest vertex [mm]", |c| Some(c.max_depth_mm)),
        row("vertices under an inner layer [%]", |c| Some(100.0 * c.order_violations)),
        row("strain added [%]", |c| c.strain_added.map(|strain| 100.0 * strain)),
    ];
    let garments = report.garments.iter().zip(&report.milliseconds.resolve).map(|(garment, ms)| {
        row! {
            "garment" => garment.name,
            "moved vertices" => garment.moved_vertices,
            "largest move [mm]" => garment.largest_move_mm,
            "rounds" => garment.rounds,
            "ms" => *ms,
            "file" => garment.output.display().to_string(),
        }
    });
    let found = &report.certificate;
    let pairs = if keeps_self { found.between() } else { found.pairs() };
    let left = left_over(pairs, found.is_stopped).map_or_else(String::new, |text| format!("\n{text}\n"));
    format!("{}\n{}{left}", table(&rows), table(&garments.collect::<Vec<_>>()))
}
