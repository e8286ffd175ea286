//! `clothcombo bench backends`.

use crate::cli::loading::load_dataset;
use crate::cli::output::print_report;
use crate::cli::table::{markdown, row};
use crate::cli::values::{measuring_seconds, not_negative};
use crate::cli::verbosity::print_status;
use crate::system::device::DeviceChoice;
use crate::training::measure::{BenchmarkRun, Case};
use burn::tensor::Device;
use clap::Parser;
use miette::{Report, miette};
use serde::Serialize;

/// Whether all compute devices of this build agree on loss and gradients, and how fast they are
#[derive(Parser)]
#[command(
    after_help = "Example:\n  cargo run --release --features ndarray --bin clothcombo -- bench backends\n\n\
        Every device gets the same networks and the same scene. Gradients are compared parameter by parameter, relative to \
        the norm of the parameter's gradient on the first device."
)]
pub struct Arguments {
    /// Devices to compare with the first of this build, named as for --device; default: one of each backend of this build
    #[arg(long, value_name = "DEVICE,…", value_delimiter = ',')]
    devices: Vec<DeviceChoice>,
    /// Width of the networks
    #[arg(long, default_value_t = 48)]
    width: usize,
    /// Garments
    #[arg(long, default_value_t = 3)]
    layers: usize,
    /// Vertices per garment, about
    #[arg(long, default_value_t = 700)]
    vertices: usize,
    /// Time spent on each single measurement (s)
    #[arg(long, default_value_t = 1.0, value_parser = measuring_seconds)]
    seconds: f64,
    /// Largest relative difference of the loss
    #[arg(long, default_value_t = 1e-4, value_parser = not_negative)]
    most_loss: f64,
    /// Largest relative difference of a parameter's gradient
    #[arg(long, default_value_t = 1e-3, value_parser = not_negative)]
    most_gradient: f64,
    /// Largest difference of a coordinate of the drapes (m)
    #[arg(long, default_value_t = 1e-4, value_parser = not_negative)]
    most_position: f64,
    /// Print JSON instead of a Markdown table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct DeviceCosts {
    device: String,
    loss: f64,
    /// Relative difference to the first device.
    loss_difference: f64,
    /// Largest difference of a coordinate of a draped vertex, posed or canonical (m).
    position_difference_m: f64,
    /// Largest relative difference over single parameters, and whose it is.
    gradient_difference: f64,
    parameter: String,
    forward_ms: f64,
    step_ms: f64,
}

/// Runs the bench.
///
/// # Errors
/// When a device fails, or disagrees with the first by more than is asked for.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let all = DeviceChoice::of_this_build();
    let wanted = if arguments.devices.is_empty() { &all } else { &arguments.devices };
    let others = wanted.iter().copied().filter(|choice| *choice != all[0]);
    // All before the first is measured: one that is not there is known at once.
    let opened = [all[0]].into_iter().chain(others).map(|choice| Ok((choice, choice.open()?)));
    let devices = opened.collect::<Result<Vec<_>, Report>>()?;
    let config = Case::new(arguments.width, arguments.layers, arguments.vertices).config(&[])?;
    let dataset = load_dataset(&config)?;
    let run_on = |device: &Device| BenchmarkRun::new(config.clone(), dataset.clone(), 0, device);
    let first = run_on(&devices[0].1)?;
    let scene = first.scene(0)?;
    let (loss, gradients) = first.loss_and_gradients(&scene)?;
    let positions = first.host_drape(&scene)?;
    let mut rows = Vec::new();
    for (choice, device) in &devices {
        print_status(&format!("measuring {choice}"));
        let mut run = run_on(device)?;
        run.copy_parameters(&first)?;
        let (found_loss, found) = run.loss_and_gradients(&scene)?;
        let differences = gradients
            .iter()
            .zip(&found)
            .map(|((name, expected), (_, found))| (difference(found, expected), name));
        let worst = differences.max_by(|a, b| a.0.total_cmp(&b.0));
        let found_positions = run.host_drape(&scene)?;
        let costs = run.costs(arguments.seconds, 1)?;
        rows.push(DeviceCosts {
            device: choice.to_string(),
            loss: found_loss,
            loss_difference: ((found_loss - loss) / loss).abs(),
            position_difference_m: largest_distance(&found_positions, &positions),
            gradient_difference: worst.as_ref().map_or(0.0, |worst| worst.0),
            parameter: worst.map(|worst| worst.1.clone()).unwrap_or_default(),
            forward_ms: costs.forward_ms,
            step_ms: costs.step_ms,
        });
    }
    print_report(arguments.json, &rows, |rows| text(rows))?;
    let agrees = |row: &&DeviceCosts| {
        row.loss_difference <= arguments.most_loss
            && row.gradient_difference <= arguments.most_gradient
            && row.position_difference_m <= arguments.most_position
    };
    match rows.iter().find(|row| !agrees(row)) {
        None => Ok(()),
        Some(row) => Err(miette!(
            help = "small networks and scenes agree best: --width 32 --vertices 400",
            "{} disagrees with {}: loss by {:.2e}, the gradient of {} by {:.2e}, positions by {:.2e} m (at most {:.0e}, \
             {:.0e} and {:.0e} m)",
            row.device,
            rows[0].device,
            row.loss_difference,
            row.parameter,
            row.gradient_difference,
            row.position_difference_m,
            arguments.most_loss,
            arguments.most_gradient,
            arguments.most_position
        )),
    }
}

/// Largest difference of two coordinates; infinite where the sizes differ.
fn largest_distance(found: &[Vec<[f32; 3]>; 2], expected: &[Vec<[f32; 3]>; 2]) -> f64 {
    let pairs = found.iter().zip(expected);
    if pairs.clone().any(|(a, b)| a.len() != b.len()) {
        return f64::INFINITY;
    }
    let coordinates = pairs.flat_map(|(a, b)| a.as_flattened().iter().zip(b.as_flattened()));
    coordinates
        .map(|(a, b)| f64::from((a - b).abs()))
        .fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a })
}

/// Norm of the difference over the norm of `expected`; infinite where the sizes differ.
fn difference(found: &[f32], expected: &[f32]) -> f64 {
    if found.len() != expected.len() {
        return f64::INFINITY;
    }
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
    let apart = norm(&mut found.iter().zip(expected).map(|(a, b)| f64::from(a - b)));
    if apart == 0.0 { 0.0 } else { apart / norm(&mut expected.iter().map(|v| f64::from(*v))) }
}

fn text(rows: &[DeviceCosts]) -> String {
    let row = |measured: &DeviceCosts| {
        row! {
            "device" => measured.device,
            "loss" => format!("{:.6}", measured.loss),
            "relative difference" => measured.loss_difference,
            "positions [m]" => measured.position_difference_m,
            "largest relative gradient difference" => measured.gradient_difference,
            "of" => measured.parameter,
            "forward [ms]" => measured.forward_ms,
            "step [ms]" => measured.step_ms,
        }
    };
    markdown(&rows.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_and_of_equal_sizes() {
        assert_eq!(difference(&[3.0, 4.0], &[3.0, 4.0]), 0.0);
        assert!((difference(&[3.0, 4.5], &[3.0, 4.0]) - 0.1).abs() < 1e-6);
        assert_eq!(difference(&[1.0], &[1.0, 2.0]), f64::INFINITY);
        assert_eq!(difference(&[0.0], &[0.0]), 0.0);
    }
}
