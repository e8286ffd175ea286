//! Writes garments of a configuration as OBJ files on a posed body, skinned but not draped: input for `clothcombo score`
//! and for other programs.
//!
//! ```text
//! cargo run --release --example pose_garments -- --config configs/open.toml --garments Tank_Top_01,Coat \
//!     --motion Boxing_Toes --frame 600 --shape 1.0,-0.5 -o /tmp/outfit
//! ```
//! makes `body.obj` and, per garment, `rest/NAME.obj`, `canonical/NAME.obj` (rest plus transferred shape) and
//! `draped/NAME.obj` (linear blend skinning of that: what the networks start from).

use clap::Parser;
use clothcombo_data::asset::{Binding, BindingSettings, Body, Garment, Pose};
use clothcombo_data::folders::{load_garment_folder, load_motion_folder};
use clothcombo_data::format::obj;
use clothcombo_trainer::config::{self, Config};
use clothcombo_trainer::{cli, dataset};
use miette::{IntoDiagnostic, Report, miette};
use std::path::PathBuf;

/// Poses garments of a configuration on its body by linear blend skinning and writes OBJ files
#[derive(Parser)]
struct Arguments {
    /// Configuration that names body, garment folders and motions
    #[arg(long, default_value = "configs/open.toml")]
    config: PathBuf,
    /// Names of garments, innermost first
    #[arg(long, value_delimiter = ',', required = true)]
    garments: Vec<String>,
    /// Motion clip; without it the T-pose
    #[arg(long)]
    motion: Option<String>,
    /// Frame of the clip, from 0
    #[arg(long, default_value_t = 0)]
    frame: usize,
    /// Shape components β; missing ones are 0
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true)]
    shape: Vec<f64>,
    /// Folder to write
    #[arg(short, long)]
    output: PathBuf,
}

fn main() -> std::process::ExitCode {
    let arguments = Arguments::parse();
    cli::Verbosity::default().apply("info");
    cli::exit_code(run(&arguments))
}

fn run(arguments: &Arguments) -> Result<(), Report> {
    let config = config::load(&arguments.config, &[])?;
    let body = dataset::load_body(&config.data.body, config.data.shape_components)?;
    let garments = named_garments(&config, &body, &arguments.garments)?;
    let posed = body.posed(&arguments.shape, &pose(&config, arguments)?).into_diagnostic()?;
    let start = &config.start;
    let settings = BindingSettings {
        smoothing_iterations: start.smoothing_iterations,
        skirt_smoothing_iterations: start.skirt_smoothing_iterations,
        smooth: start.smooth_weights,
        shape_transfer: start.shape_transfer,
    };

    let write = |file: &str, positions: &[[f64; 3]], faces: &[[u32; 3]], note: &str| {
        obj::save(&arguments.output.join(file), positions, faces, &[note.to_owned()]).into_diagnostic()
    };
    write("body.obj", &posed.positions, &body.faces, &body.name)?;
    for garment in &garments {
        let binding = Binding::new(garment, &body, &settings);
        let rest = garment.rest.positions();
        let displacement = binding.shape_displacement(&arguments.shape, body.shape_count);
        let canonical: Vec<[f64; 3]> = match displacement.is_empty() {
            true => rest.to_vec(),
            false => {
                rest.iter().zip(displacement).map(|(p, d)| std::array::from_fn(|a| p[a] + d[a])).collect()
            }
        };
        let draped = binding.skinned(&canonical, &posed.bones);
        for (folder, positions) in
            [("rest", rest), ("canonical", canonical.as_slice()), ("draped", draped.as_slice())]
        {
            // Garments under CC BY ask for their author's name wherever they go.
            let note = format!("{}: {} {}", garment.name, garment.source.author, garment.source.licence);
            write(&format!("{folder}/{}.obj", garment.name), positions, garment.rest.faces(), &note)?;
        }
    }
    eprintln!("{} garments in {}", garments.len(), arguments.output.display());
    Ok(())
}

/// The garments called `names`, in that order.
fn named_garments(config: &Config, body: &Body, names: &[String]) -> Result<Vec<Garment>, Report> {
    let mut all = Vec::new();
    for folder in config.data.garments.iter().filter_map(|source| source.folder.as_ref()) {
        all.extend(load_garment_folder(folder, body).into_diagnostic()?);
    }
    let find = |name: &String| {
        let known = || all.iter().map(|g| g.name.as_str()).collect::<Vec<_>>().join(", ");
        let found = all.iter().find(|g| g.name == *name).cloned();
        found.ok_or_else(|| {
            miette!(help = format!("the garments are: {}", known()), "no garment is called {name:?}")
        })
    };
    names.iter().map(find).collect()
}

fn pose(config: &Config, arguments: &Arguments) -> Result<Pose, Report> {
    let Some(name) = &arguments.motion else { return Ok(Pose::t_pose(0)) };
    let Some(folder) = &config.data.poses.motions else {
        return Err(miette!(
            help = "set data.poses.motions",
            "{} names no motions",
            arguments.config.display()
        ));
    };
    let clips = load_motion_folder(folder).into_diagnostic()?;
    let Some(clip) = clips.iter().find(|clip| clip.name == *name) else {
        let known = clips.iter().map(|clip| clip.name.as_str()).collect::<Vec<_>>().join(", ");
        return Err(miette!(help = format!("the clips are: {known}"), "no motion is called {name:?}"));
    };
    let Some(pose) = clip.poses.get(arguments.frame) else {
        let (frame, count) = (arguments.frame, clip.poses.len());
        return Err(miette!(help = "frames count from 0", "{name} has {count} frames, not a frame {frame}"));
    };
    Ok(if config.data.poses.remove_heading { pose.without_heading().0 } else { pose.clone() })
}
