//! `clothcombo generate`: garments from nothing but a body.

use super::wardrobe_sheet::{PER_ROW, wardrobe_sheet};
use crate::cli::values::{at_least_one, picture_file};
use crate::cli::verbosity::{print_status, progress_bar};
use crate::config::MOST_GARMENTS;
use crate::dataset::load_body;
use crate::picture::save_png;
use clap::Parser;
use clothcombo_data::asset::{Body, Category, Garment};
use clothcombo_data::dataset::{
    FolderGarment, ManifestEntry, read_manifest, refuse_unlisted, save_garment, save_manifest,
};
use clothcombo_data::format::obj;
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings};
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Makes garments that fit a body: OBJ files with a garments.toml
#[derive(Parser)]
#[command(
    after_help = "Examples:\n  clothcombo generate --count 48 --seed 7 --body datasets/open/body.npz -o datasets/generated\n  \
                  clothcombo generate --count 4300 --picture garments.png -o datasets/garments\n\n\
                  Garment i is a function of body, seed + i, category and --vertices alone. The same command again goes on where \
                  it was stopped: garments that are there are kept. --start adds more to a folder."
)]
pub struct Arguments {
    /// Number of garments, at most 1000000
    #[arg(long, default_value_t = 12, value_parser = garment_count)]
    count: usize,
    /// Number of the first garment: makes garments START to START + COUNT - 1
    #[arg(long, default_value_t = 0)]
    start: u64,
    /// First seed; garment i uses seed + i
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Body the garments fit: "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Vertices per garment, about: 200 to 50000
    #[arg(long, default_value_t = 1500)]
    vertices: usize,
    /// Categories, taken in turn: dress, top, t_shirt, open_shirt, skirt, trousers
    #[arg(long, value_delimiter = ',')]
    categories: Vec<Category>,
    /// Picture of the first eight garments of each category (PNG)
    #[arg(long, value_parser = picture_file())]
    picture: Option<PathBuf>,
    /// Folder to write; one that holds garments is added to
    #[arg(short, long)]
    output: PathBuf,
}

/// As many garments as a configuration may ask for.
fn garment_count(text: &str) -> Result<usize, String> {
    match at_least_one(text)? {
        count if count > MOST_GARMENTS => Err(format!("it must be at most {MOST_GARMENTS}")),
        count => Ok(count),
    }
}

/// Runs the verb.
///
/// # Errors
/// When the body cannot be read, the folder holds other garments of the same names or cannot be written, or a garment could
/// not be made; all others are written before that is said.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let body = load_body(&arguments.body, 0)?;
    let order = Order::new(arguments, &body)?;
    let folder = &arguments.output;
    // Before anything is made: a folder that holds other garments stays as it is.
    (0..arguments.count as u64).try_for_each(|i| order.check(arguments.start.wrapping_add(i)))?;
    refuse_unlisted(folder, &order.paths(arguments)).into_diagnostic()?;
    let mut entries = read_manifest(folder).into_diagnostic()?;
    let listed: HashSet<String> = entries.iter().map(|e| e.file().to_string()).collect();
    let bar = progress_bar(arguments.count, "garments {bar:40} {pos}/{len} · {eta} left");
    let done: Vec<Made> = (0..arguments.count)
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let made = order.fill(arguments.start.wrapping_add(i as u64), &listed);
            bar.inc(1);
            made
        })
        .collect::<Result<_, _>>()?;
    bar.finish_and_clear();

    let (mut new, mut kept, mut failures) = (0, 0, Vec::new());
    for made in done {
        match made {
            Made::Listed => kept += 1,
            Made::Found(entry) => {
                kept += 1;
                entries.push(*entry);
            }
            Made::New(entry) => {
                new += 1;
                entries.push(*entry);
            }
            Made::Failed(reason) => failures.push(reason),
        }
    }
    save_manifest(folder, entries).into_diagnostic()?;
    print_status(&format!("{new} garments made, {kept} kept, in {}", folder.display()));
    if let Some(path) = &arguments.picture {
        save_png(&wardrobe_sheet(&body, &order.for_picture(arguments)?), path).into_diagnostic()?;
        print_status(&format!("picture {}", path.display()));
    }
    match failures.first() {
        None => Ok(()),
        Some(first) => Err(miette!(
            help = "the other garments are written; take other seeds for these with --start",
            "{} of {} garments could not be made; the first: {first}",
            failures.len(),
            arguments.count
        )),
    }
}

/// What became of one garment.
enum Made {
    /// It is there, and the manifest lists it.
    Listed,
    /// Left by a run that was stopped before it wrote the manifest.
    Found(Box<ManifestEntry>),
    New(Box<ManifestEntry>),
    Failed(String),
}

/// What is to be made, and where.
struct Order<'a> {
    body: &'a Body,
    generator: GarmentGenerator<'a>,
    categories: Vec<Category>,
    settings: GarmentSettings,
    seed: u64,
    folder: &'a Path,
}

impl<'a> Order<'a> {
    fn new(arguments: &'a Arguments, body: &'a Body) -> Result<Self, Report> {
        let categories = match &arguments.categories[..] {
            [] => Category::ALL.to_vec(),
            some => some.to_vec(),
        };
        let settings = GarmentSettings { target_vertices: arguments.vertices, ..GarmentSettings::default() };
        settings.check().into_diagnostic()?;
        let generator = GarmentGenerator::new(body).into_diagnostic()?;
        Ok(Self { body, generator, categories, settings, seed: arguments.seed, folder: &arguments.output })
    }

    fn category_and_seed(&self, index: u64) -> (Category, u64) {
        let category = self.categories[(index % self.categories.len() as u64) as usize];
        (category, self.seed.wrapping_add(index))
    }

    fn path(&self, category: Category, seed: u64) -> PathBuf {
        self.folder.join(format!("{}.obj", GarmentGenerator::name(category, seed)))
    }

    /// Refuses a folder in which another garment has the name of garment `index`.
    fn check(&self, index: u64) -> Result<(), Report> {
        let (category, seed) = self.category_and_seed(index);
        let path = self.path(category, seed);
        match path.exists() {
            true => check_source(&path, &self.generator.provenance(seed, &self.settings).source),
            false => Ok(()),
        }
    }

    /// Where all garments that are asked for lie.
    fn paths(&self, arguments: &Arguments) -> HashSet<PathBuf> {
        (0..arguments.count as u64)
            .map(|i| self.category_and_seed(arguments.start.wrapping_add(i)))
            .map(|(category, seed)| self.path(category, seed))
            .collect()
    }

    /// Makes garment `index` unless it is there.
    fn fill(&self, index: u64, listed: &HashSet<String>) -> Result<Made, Report> {
        let (category, seed) = self.category_and_seed(index);
        let path = self.path(category, seed);
        if path.exists() {
            if path.file_name().is_some_and(|name| listed.contains(&*name.to_string_lossy())) {
                return Ok(Made::Listed);
            }
            let entry = ManifestEntry::of(&self.as_entry(self.load(category, seed)?));
            return Ok(Made::Found(Box::new(entry)));
        }
        match self.generator.generate(category, seed, &self.settings) {
            Ok(garment) => {
                let entry = save_garment(self.folder, &self.as_entry(garment)).into_diagnostic()?;
                Ok(Made::New(Box::new(entry)))
            }
            Err(e) => Ok(Made::Failed(e.to_string())),
        }
    }

    fn as_entry(&self, garment: Garment) -> FolderGarment {
        FolderGarment { garment, layer: None, path: PathBuf::new() }
    }

    /// A garment written before.
    fn load(&self, category: Category, seed: u64) -> Result<Garment, Report> {
        let rest = obj::load(&self.path(category, seed)).into_diagnostic()?;
        Ok(Garment {
            name: GarmentGenerator::name(category, seed),
            category,
            holding: Garment::needs_holding(&rest, self.body),
            rest,
            source: self.generator.provenance(seed, &self.settings),
        })
    }

    /// The first garments of each category.
    fn for_picture(&self, arguments: &Arguments) -> Result<Vec<Garment>, Report> {
        let mut shown = Vec::new();
        for i in 0..arguments.count as u64 {
            let (category, seed) = self.category_and_seed(arguments.start.wrapping_add(i));
            let in_row = shown.iter().filter(|g: &&Garment| g.category == category).count();
            if in_row < PER_ROW && self.path(category, seed).exists() {
                shown.push(self.load(category, seed)?);
            }
            if shown.len() == PER_ROW * self.categories.len() {
                break;
            }
        }
        Ok(shown)
    }
}

/// Refuses a file that is not the garment this run would make.
fn check_source(path: &Path, source: &str) -> Result<(), Report> {
    const HEADER_LINES: usize = 8;
    let file = std::fs::File::open(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let found = BufReader::new(file)
        .lines()
        .take(HEADER_LINES)
        .map_while(Result::ok)
        .find_map(|line| line.strip_prefix("# source: ").map(str::to_string));
    match found {
        Some(found) if found == source => Ok(()),
        found => Err(miette!(
            help = "choose another folder with -o, or the same --body, --seed and --vertices as before",
            "{} is another garment: it says '{}', this run would make one '{source}'",
            path.display(),
            found.unwrap_or_default()
        )),
    }
}
