//! `clothcombo config`: what a configuration may say, and what one comes to.

use crate::cli::data_check::check_data;
use crate::cli::device_argument::DeviceArgument;
use crate::cli::loading::load_dataset;
use crate::cli::memory_table::print_memory;
use crate::cli::output::print_json;
use crate::cli::table::{row, table};
use crate::cli::values::count;
use crate::config::{ClipScope, Config, StageConfig, Trains, load, schema};
use crate::dataset::DataSizes;
use crate::run::report::duration;
use crate::training::estimate::{StageTime, time_stages};
use clap::{Parser, Subcommand};
use clothcombo_physics::energy::Term;
use miette::Report;
use std::path::PathBuf;

/// What a configuration may say, and what one comes to
#[derive(Subcommand)]
pub enum ConfigVerb {
    /// Prints the JSON schema of a configuration: every key with meaning, type, unit and default
    Schema,
    /// Checks a configuration and prints the resolved plan: stages, schedules, weights, estimated time
    Check(CheckArguments),
}

/// Checks a configuration.
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo config check configs/smoke.toml\n  \
        clothcombo config check configs/open.toml --no-timing\n  \
        clothcombo config check configs/paper.toml --garments 4300 --vertices 8000 --shape-components 300\n\n\
        The data is checked as training checks it. Memory is estimated from the number of vertices of every garment, and the time from a few real steps of every stage \
        on this machine; both need the data. --no-timing looks at the file alone; --garments and --vertices state the memory \
        for a dataset that is not at hand.")]
pub struct CheckArguments {
    /// Configuration file (TOML)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Overrides one value; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Do not check and load the data, and time no steps
    #[arg(long)]
    no_timing: bool,
    /// Steps timed per stage
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..=1000))]
    timed_steps: u64,
    #[command(flatten)]
    device: DeviceArgument,
    /// State the memory for so many garments instead of those there are, on a body like SMPL-X; no data is loaded
    #[arg(long, value_name = "N", requires = "vertices", value_parser = count)]
    garments: Option<usize>,
    /// Vertices of each of those garments
    #[arg(long, value_name = "V", requires = "garments", value_parser = count)]
    vertices: Option<usize>,
    /// Shape components of that body; default: data.shape_components or, where that takes all, the 300 of SMPL-X
    #[arg(long, value_name = "K", requires = "garments")]
    shape_components: Option<usize>,
}

/// Runs the verb.
///
/// # Errors
/// When the configuration or, for the time, its data cannot be used.
pub fn run(verb: &ConfigVerb) -> Result<(), Report> {
    match verb {
        ConfigVerb::Schema => print_json(&schema()),
        ConfigVerb::Check(arguments) => check(arguments),
    }
}

fn check(arguments: &CheckArguments) -> Result<(), Report> {
    let config = load(&arguments.file, &arguments.overrides)?;
    let file = arguments.file.display();
    println!("{file}: every key and value is valid; seed {}, {} steps", config.seed, config.total_steps());
    print_plan(&config);
    if let (Some(garments), Some(vertices)) = (arguments.garments, arguments.vertices) {
        let all = if config.data.shape_components == 0 { 300 } else { config.data.shape_components };
        let components = arguments.shape_components.unwrap_or(all);
        return print_memory(&config, &DataSizes::assumed(garments, vertices, components));
    }
    if arguments.no_timing {
        return Ok(());
    }
    let device = arguments.device.open()?;
    check_data(&config)?;
    print_memory(&config, &DataSizes::of_named(&config)?)?;
    let dataset = load_dataset(&config)?;
    let times = time_stages(&config, &dataset, &device, arguments.timed_steps)?;
    print_times(&config, &times);
    Ok(())
}

fn print_plan(config: &Config) {
    let mut first = 0;
    for (i, stage) in config.stages.iter().enumerate() {
        println!("\nstage {i} {:?}: {} steps, {first} to {}", stage.name, stage.steps, first + stage.steps);
        first += stage.steps;
        println!("  trains         {}", trains(stage.trains));
        println!("  layers         {}", layers(stage));
        println!("  pose scale     {}", stage.pose_scale);
        println!("  learning rate  {}", rate(stage));
        println!("  a step         {}", step(stage));
    }
    println!("\nweights over the run");
    for term in Term::ALL {
        println!("  {:<16} {}", term.name(), config.losses.weight(term));
    }
    println!("  {:<16} {}", "single garments", config.losses.single_garments);
    let o = &config.optimizer;
    println!(
        "\nAdam {} {} · gradient norm {} · average of the weights {}",
        o.beta_1,
        o.beta_2,
        match (o.max_norm(), o.clip) {
            (None, _) => "not clipped".into(),
            (Some(most), ClipScope::Scene) => format!("of every scene clipped at {most}"),
            (Some(most), ClipScope::Step) => format!("of the mean over the scenes clipped at {most}"),
        },
        if o.ema_decay > 0.0 { format!("with decay {}", o.ema_decay) } else { "none".into() }
    );
}

fn trains(trains: Trains) -> &'static str {
    match trains {
        Trains::Single => "embedding, draping and skinning",
        Trains::Draping => "draping and skinning, on the frozen embedding",
        Trains::Untangling => "untangling, on the frozen first stage",
        Trains::All => "both phases",
    }
}

fn layers(stage: &StageConfig) -> String {
    let [low, high] = stage.layers;
    let range = if low == high { format!("{low}") } else { format!("{low} to {high}") };
    match stage.layer_curriculum {
        c if c > 0.0 && low < high => {
            format!("{range}, the most reached after {:.0} % of the stage", 100.0 * c)
        }
        _ => range,
    }
}

fn rate(stage: &StageConfig) -> String {
    match stage.warm_up_steps {
        0 => stage.learning_rate.to_string(),
        steps => format!("{}, warmed up over {steps} steps", stage.learning_rate),
    }
}

fn step(stage: &StageConfig) -> String {
    let plural = |n: usize, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
    format!(
        "{} on {} each",
        plural(stage.accumulate, "outfit", "outfits"),
        plural(stage.bodies, "body", "bodies")
    )
}

fn print_times(config: &Config, times: &[StageTime]) {
    let steps = times.first().map_or(0, |t| t.steps);
    println!("\nestimated time on this machine ({steps} timed steps per stage)");
    let stage_seconds =
        |(stage, time): (&StageConfig, &StageTime)| time.seconds_per_step * stage.steps as f64;
    let stages = || config.stages.iter().zip(times);
    let mut rows: Vec<_> = stages()
        .map(|(stage, time)| {
            let ms = format!("{:.1}", 1000.0 * time.seconds_per_step);
            row!["stage" => stage.name, "ms/step" => ms, "time" => duration(stage_seconds((stage, time)))]
        })
        .collect();
    rows.push(row!["" => "together", "" => "", "" => duration(stages().map(stage_seconds).sum())]);
    print!("{}", table(&rows));
    println!("validation, pictures and checkpoints not counted");
}
