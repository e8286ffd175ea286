//! `clothcombo score`: anyone's draped meshes, measured.

use super::table::{number, table};
use crate::score::{MeshFiles, Score, ScoreDistance, TermValues, score_files};
use clap::Parser;
use miette::{IntoDiagnostic, Report};
use std::path::PathBuf;

/// Scores draped garments: energies in the paper's printed form, penetration, exact intersections, layer order
#[derive(Parser)]
#[command(
    after_help = "Files are OBJ meshes in metres, y up; quads and polygons are cut into triangles. A draped mesh has the\n\
                  vertices and faces of its rest mesh.\n\n\
                  Example (inner to outer):\n  clothcombo score --body body.obj --rest rest/tee.obj rest/coat.obj \
                  --draped draped/tee.obj draped/coat.obj --json"
)]
pub struct Arguments {
    /// The posed body
    #[arg(long, value_name = "OBJ")]
    body: PathBuf,
    /// Rest meshes, innermost first
    #[arg(long, num_args = 1.., required = true, value_name = "OBJ")]
    rest: Vec<PathBuf>,
    /// Draped meshes, in the same order
    #[arg(long, num_args = 1.., required = true, value_name = "OBJ")]
    draped: Vec<PathBuf>,
    /// The meshes before skinning, in the same order: adds the holding energy against the rest meshes
    #[arg(long, num_args = 1.., value_name = "OBJ")]
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
    let Arguments { body, rest, draped, canonical, .. } = arguments;
    let files = MeshFiles { body, rest, draped, canonical };
    let distance = if arguments.surface { ScoreDistance::Surface } else { ScoreDistance::NearestVertex };
    let score = score_files(&files, distance)?;
    let text = if arguments.json {
        serde_json::to_string_pretty(&score).into_diagnostic()? + "\n"
    } else {
        tables(&score)
    };
    print!("{text}");
    Ok(())
}

/// Terms of one garment, in the order of the columns.
const TERMS: [&str; 6] = ["strain", "bending", "gravity", "body_collision", "repulsion", "holding"];

const RAW: [&str; 6] =
    ["strain [J]", "bending [J]", "gravity [J]", "collision [m³]", "repulsion [1]", "holding [m²]"];
const WEIGHTED: [&str; 6] = ["strain", "bending", "gravity", "collision", "repulsion", "holding"];
const CONTACT: [&str; 7] =
    ["contact", "vertices", "triangles", "inside [%]", "depth [mm]", "body pairs", "self pairs"];
const LAYERS: [&str; 5] =
    ["layers", "collision [m³]", "distance [m³]", "pairs", "order violations, nearest vertex [%]"];

fn tables(score: &Score) -> String {
    let garments = || score.garments.iter();
    // Holding comes last, and only with canonical meshes.
    let is_held = garments().any(|g| g.raw.contains_key(TERMS[TERMS.len() - 1]));
    let terms = if is_held { &TERMS[..] } else { &TERMS[..TERMS.len() - 1] };
    let head = |first: &str, names: &[&'static str], last: Option<&'static str>| -> Vec<String> {
        let names = names.iter().take(terms.len()).copied().chain(last);
        [first].into_iter().chain(names).map(str::to_owned).collect()
    };
    let term_row = |name: &str, values: &TermValues, with_sum| term_row(name, values, terms, with_sum);
    let mut raw: Vec<_> = garments().map(|g| term_row(&g.name, &g.raw, false)).collect();
    let mut weighted: Vec<_> = garments().map(|g| term_row(&g.name, &g.weighted, true)).collect();
    if score.garments.len() > 1 {
        raw.push(term_row("all", &sum(garments().map(|g| &g.raw)), false));
        weighted.push(term_row("all", &sum(garments().map(|g| &g.weighted)), true));
    }
    let contact: Vec<_> = garments()
        .map(|g| {
            let found = &g.penetration;
            vec![
                g.name.clone(),
                g.vertices.to_string(),
                g.triangles.to_string(),
                format!("{:.2}", 100.0 * found.vertices_inside),
                format!("{:.2}", found.max_depth_mm),
                found.body_triangle_pairs.to_string(),
                found.self_triangle_pairs.to_string(),
            ]
        })
        .collect();
    let name = |i: usize| &score.garments[i].name;
    let layers: Vec<_> = score
        .layers
        .iter()
        .map(|layer| {
            vec![
                format!("{} under {}", name(layer.inner), name(layer.outer)),
                number(layer.layer_collision),
                number(layer.layer_distance),
                layer.triangle_pairs.to_string(),
                format!("{:.2}", 100.0 * layer.order_violations_nearest_vertex),
            ]
        })
        .collect();
    let raw = table(&head("raw", &RAW, None), &raw);
    let weighted = table(&head("weighted [J]", &WEIGHTED, Some("sum")), &weighted);
    let mut text = [raw, weighted, table(&CONTACT, &contact)].join("\n");
    if !layers.is_empty() {
        text += &format!("\n{}", table(&LAYERS, &layers));
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

fn term_row(name: &str, values: &TermValues, terms: &[&str], with_sum: bool) -> Vec<String> {
    let value = |term: &&str| values.get(*term).map_or_else(String::new, |v| number(*v));
    let sum = with_sum.then(|| number(values.values().sum()));
    [name.to_owned()].into_iter().chain(terms.iter().map(value)).chain(sum).collect()
}
