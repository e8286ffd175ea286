//! `clothcombo bench distance`.

use crate::cli::verbosity::progress_bar;
use crate::config::PoseConfig;
use crate::dataset::{HeldOut, PoseLibrary, load_body};
use crate::evaluation::{RegionErrors, SignErrorSettings, SignErrors, WrongSigns, hard_poses, sign_errors};
use clap::Parser;
use clothcombo_data::asset::{BODY_JOINT_COUNT, Body, Pose};
use miette::{IntoDiagnostic, Report, miette};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;

/// How often the sign of the distance to the body is wrong, by nearest vertex and by closest surface point
#[derive(Parser)]
#[command(
    after_help = "Example:\n  clothcombo bench distance --body datasets/open/body.npz --motions datasets/open/motions --poses 20"
)]
pub struct Arguments {
    /// "mannequin" or a body npz
    #[arg(long, default_value = "mannequin")]
    body: String,
    /// Folder of motions; their held-out frames are drawn. Without it poses are sampled within joint limits
    #[arg(long)]
    motions: Option<PathBuf>,
    /// Random poses
    #[arg(long, default_value_t = 20)]
    poses: usize,
    /// Points per pose
    #[arg(long, default_value_t = 2000)]
    points: usize,
    /// Largest distance of a point from the surface (m)
    #[arg(long, default_value_t = 0.05)]
    band: f64,
    /// Seed of poses and points
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print JSON instead of a Markdown table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row {
    poses: String,
    #[serde(flatten)]
    errors: SignErrors,
}

/// Runs the verb.
///
/// # Errors
/// When body or motions cannot be read, or an option is out of range.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    if arguments.points == 0 {
        return Err(miette!(help = "give at least --points 1", "no points to measure at"));
    }
    if !(arguments.band.is_finite() && arguments.band > 0.0) {
        return Err(miette!(help = "the default is 0.05", "--band {} is not a distance", arguments.band));
    }
    let body = Arc::new(load_body(&arguments.body, 0)?);
    let drawn = draw(arguments, &body)?;
    let mut groups = vec![("T-pose".to_owned(), vec![Pose::t_pose(BODY_JOINT_COUNT)])];
    if !drawn.is_empty() {
        let source = if arguments.motions.is_some() { "held-out motion" } else { "sampled poses" };
        groups.push((source.to_owned(), drawn));
    }
    groups.extend(hard_poses().into_iter().map(|(name, pose)| (name.to_owned(), vec![pose])));

    let total = groups.iter().map(|(_, poses)| poses.len()).sum::<usize>();
    let bar = progress_bar(total, "poses {bar:40} {pos}/{len} · {eta} left");
    let mut rows = Vec::with_capacity(groups.len());
    for (name, poses) in groups {
        let mut parts = Vec::with_capacity(poses.len());
        for pose in &poses {
            let settings = SignErrorSettings {
                points: arguments.points,
                band: arguments.band,
                seed: arguments.seed.wrapping_add(bar.position()),
            };
            parts.push(sign_errors(&body, pose, &settings).into_diagnostic()?);
            bar.inc(1);
        }
        rows.push(Row { poses: name, errors: SignErrors::sum(&parts) });
    }
    bar.finish_and_clear();
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&rows).into_diagnostic()?);
    } else {
        print_table(&rows);
    }
    Ok(())
}

fn draw(arguments: &Arguments, body: &Arc<Body>) -> Result<Vec<Pose>, Report> {
    let config = PoseConfig { motions: arguments.motions.clone(), ..PoseConfig::default() };
    let dataset = PoseLibrary::new(&config, body)?;
    let mut rng = ChaCha8Rng::seed_from_u64(arguments.seed);
    Ok((0..arguments.poses).map(|_| dataset.draw_held_out(HeldOut::Windows, &mut rng)).collect())
}

/// Shares in percent, as Markdown; the farthest wrong point in millimetres.
fn print_table(rows: &[Row]) {
    let cells = |region: &RegionErrors, signs: &WrongSigns| {
        let share = |count: usize| 100.0 * count as f64 / region.points.max(1) as f64;
        format!(
            "{:.3} % / {:.3} % / {:.1}",
            share(signs.wrong),
            share(signs.wrong_beyond_2mm),
            1e3 * signs.farthest
        )
    };
    println!("Wrong signs: share / share farther than 2 mm from the surface / farthest [mm].\n");
    println!(
        "| poses | surface | points | nearest vertex | closest point | ms per 1,000: vertex | ms per 1,000: point |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|");
    for row in rows {
        for (name, region) in [("apart", &row.errors.apart), ("overlapping", &row.errors.overlapping)] {
            if region.points == 0 {
                continue;
            }
            println!(
                "| {} ({}) | {name} | {} | {} | {} | {:.3} | {:.3} |",
                row.poses,
                row.errors.poses,
                region.points,
                cells(region, &region.nearest_vertex),
                cells(region, &region.closest_point),
                row.errors.nearest_vertex_ms,
                row.errors.closest_point_ms
            );
        }
    }
}
