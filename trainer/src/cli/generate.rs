//! `clothcombo generate`: garments from nothing but a body.

use crate::scene::load_body;
use clap::Parser;
use clothcombo_data::asset::Category;
use clothcombo_data::dataset::{FolderGarment, save_garment_folder};
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Report, miette};
use rayon::prelude::*;
use std::path::PathBuf;

/// Makes garments that fit a body: OBJ files with a garments.toml
#[derive(Parser)]
#[command(
    after_help = "Example:\n  clothcombo generate --count 48 --seed 7 --body datasets/open/body.npz -o datasets/generated"
)]
pub struct Arguments {
    /// Number of garments
    #[arg(long, default_value_t = 12)]
    count: usize,
    /// First seed; garment i uses seed + i
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Body the garments fit: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Vertices per garment, about
    #[arg(long, default_value_t = 1500)]
    vertices: usize,
    /// Categories, taken in turn: dress, top, t_shirt, open_shirt, skirt, trousers
    #[arg(long, value_delimiter = ',')]
    categories: Vec<Category>,
    /// Folder to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// When the body cannot be read, or the folder exists or cannot be written.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    if arguments.output.join("garments.toml").exists() {
        return Err(miette!(
            help = "choose another folder with -o, or remove it",
            "{} already holds garments",
            arguments.output.display()
        ));
    }
    let body = load_body(&arguments.body, 0)?;
    let categories =
        if arguments.categories.is_empty() { Category::ALL.to_vec() } else { arguments.categories.clone() };
    let settings = GarmentSettings { target_vertices: arguments.vertices, ..GarmentSettings::default() };
    let style =
        ProgressStyle::with_template("garments {bar:40} {pos}/{len} · {eta} left").into_diagnostic()?;
    let bar = ProgressBar::new(arguments.count as u64).with_style(style);
    let generator = GarmentGenerator::new(&body).into_diagnostic()?;
    let garments = (0..arguments.count)
        .into_par_iter()
        .map(|i| {
            let made = generator.generate(
                categories[i % categories.len()],
                arguments.seed.wrapping_add(i as u64),
                &settings,
            );
            bar.inc(1);
            made
        })
        .collect::<Result<Vec<_>, _>>()
        .into_diagnostic()?;
    bar.finish_and_clear();
    let count = garments.len();
    let garments: Vec<_> = garments
        .into_iter()
        .map(|garment| FolderGarment { garment, layer: None, path: PathBuf::new() })
        .collect();
    save_garment_folder(&arguments.output, &garments).into_diagnostic()?;
    eprintln!("{count} garments in {}", arguments.output.display());
    Ok(())
}
