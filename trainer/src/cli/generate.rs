//! `clothcombo generate`: garments from nothing but a body.

use super::garment_sheet::{PER_CATEGORY, garment_sheet};
use crate::cli::values::{count, folder_to_make, picture_file};
use crate::cli::verbosity::{print_status, progress_bar};
use crate::config::MOST_GENERATED_GARMENTS;
use crate::dataset::load_body;
use crate::picture::save_png;
use clap::{Parser, value_parser};
use clothcombo_data::asset::{Body, Category, Garment};
use clothcombo_data::folders::{ManifestEntry, read_manifest, refuse_unlisted, save_garment, save_manifest};
use clothcombo_data::format::obj;
use clothcombo_data::generate::GarmentGenerator;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use rayon::prelude::*;
use std::collections::HashSet;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// From here on every garment that may be asked for has a number.
const LAST_START: u64 = u64::MAX - MOST_GENERATED_GARMENTS as u64;

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
    #[arg(long, default_value_t = 12, value_parser = count)]
    count: usize,
    /// Number of the first garment: makes garments START to START + COUNT - 1
    #[arg(long, default_value_t = 0, value_parser = value_parser!(u64).range(..=LAST_START))]
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
    #[arg(short, long, value_parser = folder_to_make())]
    output: PathBuf,
}

/// Runs the verb.
///
/// # Errors
/// When the body cannot be read, the folder holds other garments of the same names or cannot be written, or a garment could
/// not be made; all others are written before that is said.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let body = load_body(&arguments.body, 0)?;
    let maker = GarmentMaker::new(arguments, &body)?;
    let wanted: Vec<WantedFile> = (0..arguments.count as u64).map(|i| maker.wanted(arguments, i)).collect();
    let folder = &arguments.output;
    // Before anything is made: a folder that holds other garments stays as it is.
    wanted.iter().try_for_each(|garment| maker.check(garment))?;
    refuse_unlisted(folder, &wanted.iter().map(|g| g.path.clone()).collect()).into_diagnostic()?;
    let mut entries = read_manifest(folder).into_diagnostic()?;
    let listed: HashSet<String> = entries.iter().map(|e| e.file().to_string()).collect();
    let bar = progress_bar(wanted.len(), "garments {bar:40} {pos}/{len} · {eta} left");
    let make = |garment| {
        let made = maker.make(garment, &listed);
        bar.inc(1);
        made
    };
    let made: Vec<Made> = wanted.par_iter().with_max_len(1).map(make).collect::<Result<_, _>>()?;
    bar.finish_and_clear();

    let (mut new, mut kept, mut failures) = (0, 0, Vec::new());
    for made in made {
        match made {
            Made::Kept(unlisted) => {
                kept += 1;
                entries.extend(unlisted.map(|entry| *entry));
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
        save_png(&garment_sheet(&body, &maker.for_picture(&wanted)?), path).into_diagnostic()?;
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

/// Result for one garment.
enum Made {
    /// It exists. A run that was stopped before it wrote the manifest leaves garments that need an entry.
    Kept(Option<Box<ManifestEntry>>),
    New(Box<ManifestEntry>),
    Failed(String),
}

struct WantedFile {
    category: Category,
    seed: u64,
    path: PathBuf,
}

struct GarmentMaker<'a> {
    body: &'a Body,
    generator: GarmentGenerator<'a>,
    vertices: usize,
    folder: &'a Path,
}

impl<'a> GarmentMaker<'a> {
    fn new(arguments: &'a Arguments, body: &'a Body) -> Result<Self, Report> {
        GarmentGenerator::check_vertices(arguments.vertices).into_diagnostic()?;
        let generator = GarmentGenerator::new(body).into_diagnostic()?;
        Ok(Self { body, generator, vertices: arguments.vertices, folder: &arguments.output })
    }

    /// Garment `i` of this run.
    fn wanted(&self, arguments: &Arguments, i: u64) -> WantedFile {
        let categories = match &arguments.categories[..] {
            [] => &Category::ALL,
            some => some,
        };
        let index = arguments.start + i;
        let category = categories[(index % categories.len() as u64) as usize];
        let seed = arguments.seed.wrapping_add(index);
        let path = self.folder.join(format!("{}.obj", GarmentGenerator::name(category, seed)));
        WantedFile { category, seed, path }
    }

    /// Refuses a folder in which another garment has the name of this one.
    fn check(&self, WantedFile { seed, path, .. }: &WantedFile) -> Result<(), Report> {
        match path.exists() {
            true => check_source(path, &self.generator.provenance(*seed, self.vertices).source),
            false => Ok(()),
        }
    }

    /// Makes a garment unless it exists.
    fn make(&self, wanted: &WantedFile, listed: &HashSet<String>) -> Result<Made, Report> {
        let WantedFile { category, seed, path } = wanted;
        if path.exists() {
            let is_listed = path.file_name().is_some_and(|name| listed.contains(&*name.to_string_lossy()));
            return Ok(Made::Kept(match is_listed {
                true => None,
                false => Some(Box::new(ManifestEntry::of(&self.load(wanted)?))),
            }));
        }
        match self.generator.generate(*category, *seed, self.vertices) {
            Ok(garment) => {
                let entry = save_garment(self.folder, &garment).into_diagnostic()?;
                Ok(Made::New(Box::new(entry)))
            }
            Err(e) => Ok(Made::Failed(e.to_string())),
        }
    }

    /// Reads a garment that exists.
    fn load(&self, WantedFile { category, seed, path }: &WantedFile) -> Result<Garment, Report> {
        let rest = obj::load(path).into_diagnostic()?;
        let name = GarmentGenerator::name(*category, *seed);
        let source = self.generator.provenance(*seed, self.vertices);
        let holding = Garment::needs_holding(&rest, self.body);
        Ok(Garment { name, holding, source, ..Garment::new(*category, rest) })
    }

    /// The first garments of each category.
    fn for_picture(&self, wanted: &[WantedFile]) -> Result<Vec<Garment>, Report> {
        let of = |category| {
            let all = wanted.iter().filter(move |garment| garment.category == category);
            all.filter(|garment| garment.path.exists()).take(PER_CATEGORY)
        };
        Category::ALL.into_iter().flat_map(of).map(|garment| self.load(garment)).collect()
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
