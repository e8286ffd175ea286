//! The draper as a library: two garments of the model's own data on three bodies.
//!
//! ```text
//! cargo run --release --example drape -- runs/smoke
//! ```

use clothcombo_data::asset::Pose;
use clothcombo_data::fit::FitSettings;
use clothcombo_trainer::cli;
use clothcombo_trainer::inference::{BodyState, Draper, DraperSettings};
use miette::{Report, miette};
use std::path::PathBuf;

fn main() -> std::process::ExitCode {
    cli::Verbosity::default().apply("warn");
    cli::exit_code(run())
}

fn run() -> Result<(), Report> {
    // Without a path the model that the program carries is taken.
    let model = std::env::args().nth(1).map(PathBuf::from);
    let draper = Draper::load(model.as_deref(), &DraperSettings::default())?;

    // Garments the model knows by name; `GivenGarment::read` takes a mesh file, `GivenGarment::new` a garment in memory.
    let catalog = draper.catalog(&[])?;
    let [inner, outer, ..] = catalog.names() else {
        return Err(miette!("the model's own garments are not there; use GivenGarment::read"));
    };
    let sources = [inner, outer].map(|name| catalog.find(name, draper.body(), None, &FitSettings::default()));
    let outfit = draper.outfit(sources.into_iter().collect::<Result<_, _>>()?)?;

    // The garments are embedded once; every body costs only what depends on it.
    let mut arms_lowered = Pose::t_pose(22);
    arms_lowered.rotations[16] = [0.0, 0.0, -1.0];
    arms_lowered.rotations[17] = [0.0, 0.0, 1.0];
    for shape in [-1.5, 0.0, 1.5] {
        let drape = draper.drape(&outfit, &BodyState::new(vec![shape], arms_lowered.clone()))?;
        let score = drape.score(&draper, &outfit, |garment| &garment.positions)?;
        for (garment, scored) in outfit.garments.iter().zip(&score.garments) {
            println!(
                "shape {shape:>4}: {} has {:.2} % of {} vertices inside the body",
                garment.name,
                100.0 * scored.penetration.vertices_inside,
                scored.vertices
            );
        }
        println!(
            "shape {shape:>4}: {} pairs of triangles intersect, {:.0} ms",
            drape.certificate.pairs(),
            drape.milliseconds.total()
        );
    }
    Ok(())
}
