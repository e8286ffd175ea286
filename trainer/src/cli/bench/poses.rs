//! `clothcombo bench poses`: how many bodies run through themselves, and what it costs to find out.

use crate::dataset::load_body;
use clap::Parser;
use clothcombo_data::asset::{Body, Pose};
use clothcombo_data::dataset::load_motion_folder;
use clothcombo_data::generate::{PoseAugmentation, PoseSampler, SelfContact};
use miette::{IntoDiagnostic, Report, miette};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::PathBuf;
use std::time::Instant;

/// Measures self-intersections of posed bodies: sampled, recorded and augmented poses
#[derive(Parser)]
#[command(
    after_help = "Example:\n  clothcombo bench poses --body datasets/open/body.npz --motions datasets/open/motions\n\n\
                  Per kind of pose: share in which far-apart parts of the body intersect; share above 0.05, 0.1, 0.2 and 0.4 m of \
                  curves of intersection (see data.poses.max_self_intersection); mean time per pose [ms]."
)]
pub struct Arguments {
    /// Poses of each kind
    #[arg(long, default_value_t = 300)]
    count: usize,
    /// Seed
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Folder of motion npz files; without it only sampled poses are measured
    #[arg(long)]
    motions: Option<PathBuf>,
}

/// Runs the bench; the table goes to stdout.
///
/// # Errors
/// When body or motions cannot be read.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let body = load_body(&arguments.body, 0)?;
    let contact = SelfContact::new(&body);
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.seed);
    println!(
        "{:<10} {:>6} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}",
        "poses", "count", "touching", ">0.05", ">0.1", ">0.2", ">0.4", "ms"
    );
    let sampler = PoseSampler::default();
    let sampled: Vec<Pose> = (0..arguments.count).map(|_| sampler.sample(&mut rng)).collect();
    print_row("sampled", &body, &contact, &sampled)?;
    let Some(folder) = &arguments.motions else { return Ok(()) };
    let frames: Vec<Pose> =
        load_motion_folder(folder).into_diagnostic()?.into_iter().flat_map(|motion| motion.poses).collect();
    if frames.is_empty() {
        return Err(miette!("{}: the motions have no frames", folder.display()));
    }
    let any = |rng: &mut ChaCha8Rng| frames[rng.random_range(0..frames.len())].clone();
    let recorded: Vec<Pose> = (0..arguments.count).map(|_| any(&mut rng)).collect();
    print_row("recorded", &body, &contact, &recorded)?;
    let augmentation = PoseAugmentation::default();
    let augmented: Vec<Pose> = (0..arguments.count)
        .map(|_| {
            let (pose, other) = (any(&mut rng), any(&mut rng));
            augmentation.apply(&pose, &other, &mut rng)
        })
        .collect();
    print_row("augmented", &body, &contact, &augmented)
}

fn print_row(name: &str, body: &Body, contact: &SelfContact, poses: &[Pose]) -> Result<(), Report> {
    let start = Instant::now();
    let lengths =
        poses.iter().map(|p| contact.of_pose(body, p)).collect::<Result<Vec<f64>, _>>().into_diagnostic()?;
    let count = poses.len().max(1) as f64;
    let milliseconds = start.elapsed().as_secs_f64() * 1e3 / count;
    let share = |limit: f64| 100.0 * lengths.iter().filter(|l| **l > limit).count() as f64 / count;
    println!(
        "{name:<10} {:>6} {:>7.1} % {:>5.1} % {:>5.1} % {:>5.1} % {:>5.1} % {milliseconds:>7.2}",
        poses.len(),
        share(0.0),
        share(0.05),
        share(0.1),
        share(0.2),
        share(0.4)
    );
    Ok(())
}
