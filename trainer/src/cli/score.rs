//! `clothcombo score`: anyone's draped meshes, measured.

use super::output::print_report;
use super::table::{Row, number, row, table};
use crate::score::{NamedMesh, SceneMeshes, Score, ScoreDistance, TermValues, score_meshes};
use clap::Parser;
use miette::Report;
use std::path::PathBuf;

/// Scores draped garments: energies in the paper's printed form, penetration, exact intersections, layer order
#[derive(Parser)]
#[command(
    after_help = "Files are OBJ, PLY, STL or glTF meshes in metres, y up; quads and polygons are cut into triangles. A draped mesh\n\
                  has the vertices and faces of its rest mesh.\n\n\
                  Example (inner to outer):\n  clothcombo score --body body.obj --rest rest/tee.obj rest/coat.obj \
                  --draped draped/tee.obj draped/coat.obj --json"
)]
pub struct Arguments {
    /// The posed body
    #[arg(long, value_name = "MESH")]
    body: PathBuf,
    /// Rest meshes, innermost first
    #[arg(long, num_args = 1.., required = true, value_name = "MESH")]
    rest: Vec<PathBuf>,
    /// Draped meshes, in the same order
    #[arg(long, num_args = 1.., required = true, value_name = "MESH")]
    draped: Vec<PathBuf>,
    /// The meshes before skinning, in the same order: adds the holding energy against the rest meshes
    #[arg(long, num_args = 1.., value_name = "MESH")]
    canonical: Vec<PathBuf>,
    /// Distances to the closest point of the body's surface instead of its nearest vertex
    #[arg(long)]
    surface: bool,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Runs the verb.
///
/// # Errors
/// When a file cannot be read, or meshes do not fit together.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let load = |paths: &[PathBuf]| -> Result<Vec<NamedMesh>, Report> {
        paths.iter().map(|path| NamedMesh::load(path)).collect()
    };
    let meshes = SceneMeshes {
        body: NamedMesh::load_body(&arguments.body)?,
        rest: load(&arguments.rest)?,
        draped: load(&arguments.draped)?,
        canonical: load(&arguments.canonical)?,
    };
    let distance = if arguments.surface { ScoreDistance::Surface } else { ScoreDistance::NearestVertex };
    let score = score_meshes(meshes, distance)?;
    print_report(arguments.json, &score, tables)
}

/// Terms of one garment in the order of their columns: name, heading, unit.
const TERMS: [(&str, &str, &str); 6] = [
    ("strain", "strain", "J"),
    ("bending", "bending", "J"),
    ("gravity", "gravity", "J"),
    ("body_collision", "collision", "m³"),
    ("repulsion", "repulsion", "1"),
    ("holding", "holding", "m²"),
];

/// Cells of the terms that have values, whose headings name the units `with_units`.
pub(super) fn term_cells(values: &TermValues, with_units: bool) -> Row {
    let cell = |(term, heading, unit): &(&str, &str, &str)| {
        let heading = if with_units { format!("{heading} [{unit}]") } else { heading.to_string() };
        Some((heading, number(*values.get(*term)?)))
    };
    TERMS.iter().filter_map(cell).collect()
}

fn tables(score: &Score) -> String {
    let garments = || score.garments.iter();
    let raw_row = |name: &str, values: &TermValues| [row!["raw" => name], term_cells(values, true)].concat();
    let weighted_row = |name: &str, values: &TermValues| {
        let sum = row!["sum" => values.values().sum::<f64>()];
        [row!["weighted [J]" => name], term_cells(values, false), sum].concat()
    };
    let mut raw: Vec<Row> = garments().map(|g| raw_row(&g.name, &g.raw)).collect();
    let mut weighted: Vec<Row> = garments().map(|g| weighted_row(&g.name, &g.weighted)).collect();
    if score.garments.len() > 1 {
        raw.push(raw_row("all", &sum(garments().map(|g| &g.raw))));
        weighted.push(weighted_row("all", &sum(garments().map(|g| &g.weighted))));
    }
    let contact = garments().map(|g| {
        row! {
            "contact" => g.name,
            "vertices" => g.vertices,
            "triangles" => g.triangles,
            "inside [%]" => 100.0 * g.penetration.vertices_inside,
            "depth [mm]" => g.penetration.max_depth_mm,
            "body pairs" => g.penetration.body_triangle_pairs,
            "self pairs" => g.penetration.self_triangle_pairs,
        }
    });
    let name = |i: usize| &score.garments[i].name;
    let layers = score.layers.iter().map(|layer| {
        row! {
            "layers" => format!("{} under {}", name(layer.inner), name(layer.outer)),
            "collision [m³]" => layer.layer_collision,
            "distance [m³]" => layer.layer_distance,
            "pairs" => layer.triangle_pairs,
            "order violations, nearest vertex [%]" => 100.0 * layer.order_violations_nearest_vertex,
        }
    });
    let mut text = [raw, weighted, contact.collect()].map(|rows| table(&rows)).join("\n");
    if !score.layers.is_empty() {
        text += &format!("\n{}", table(&layers.collect::<Vec<_>>()));
    }
    let distance = match score.settings.distance {
        ScoreDistance::NearestVertex => "the nearest vertex",
        ScoreDistance::Surface => "the closest surface point",
    };
    text + &format!(
        "\nε {} mm; distances to {distance} of the body; body with itself: {} pairs, counted against no garment\n",
        score.settings.epsilon_mm, score.body.self_triangle_pairs
    )
}

fn sum<'a>(of: impl Iterator<Item = &'a TermValues>) -> TermValues {
    let mut sums = TermValues::new();
    for (term, value) in of.flatten() {
        *sums.entry(term.clone()).or_default() += value;
    }
    sums
}
