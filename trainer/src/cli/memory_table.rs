//! What a run will need of memory, as a table and in a line.

use crate::cli::table::{row, table};
use crate::config::{Config, PoseEncoding};
use crate::dataset::DataSizes;
use crate::run::memory::MemoryEstimate;
use crate::system::device::Backend;
use crate::system::memory::{available, gibibytes};
use burn::module::Module;
use clothcombo_model::{ClothCombo, Dimensions};
use miette::{IntoDiagnostic, Report};

/// Prints what a run of `config` on data of these sizes needs, on a GPU and on the processor.
///
/// # Errors
/// When the networks cannot be made.
pub fn print_memory(config: &Config, sizes: &DataSizes) -> Result<(), Report> {
    let parameters = parameter_count(config, sizes)?;
    let [gpu, cpu] = [false, true].map(|on| MemoryEstimate::new(config, sizes, parameters, on));
    let (count, total) = (sizes.vertices.len(), sizes.vertices.iter().sum::<usize>());
    println!(
        "\nmemory at the peak for {count} garments of {} vertices on average, {} shape components",
        total / count.max(1),
        sizes.shape_components
    );
    let (garments, operators) = match config.data.cache.folder.is_some() {
        true => (
            format!("garments kept, of {}", gibibytes(gpu.all_garments)),
            "operators, streamed from data.cache.folder",
        ),
        false => (
            "all garments, for want of data.cache.folder".to_owned(),
            "operators of all garments, for the same reason",
        ),
    };
    let tensors = format!("tensors and embeddings kept, of {}", gibibytes(gpu.all_tensors));
    let step = format!("the largest step ({})", largest_step(config));
    let on_host: [(&str, fn(&MemoryEstimate) -> u64); 5] = [
        ("program, body, list of garments", |m| m.program),
        (&garments, |m| m.garments),
        (operators, |m| m.operators),
        ("scenes prepared in advance", |m| m.scenes),
        ("at the start: garments being prepared", |m| m.preparation),
    ];
    let on_device: [(&str, fn(&MemoryEstimate) -> u64); 3] = [
        (&tensors, |m| m.tensors),
        ("Adam's moments, copies of the parameters", |m| m.parameters),
        (&step, |m| m.step),
    ];
    let on_host = on_host.map(|(name, of)| row![name, gibibytes(of(&gpu)), "", gibibytes(of(&cpu))]);
    let on_device = on_device.map(|(name, of)| row![name, "", gibibytes(of(&gpu)), gibibytes(of(&cpu))]);
    let [host, device, processor] = [gpu.host(), gpu.device(), cpu.peak()].map(gibibytes);
    let rows = [&on_host[..], &on_device, &[row!["together", host, device, processor]]].concat();
    print!("{}", table(&["", "GPU: host", "GPU: device", "CPU: host"], &rows));
    if config.data.poses.motions.is_some() {
        println!("motions come on top: about 0.6 KiB a frame of 22 joints");
    }
    if let Some(available) = available() {
        println!("available on this machine: {}", gibibytes(available));
    }
    Ok(())
}

/// Garments of the largest scene, and scenes of a step.
fn largest_step(config: &Config) -> String {
    let layers = config.stages.iter().map(|s| s.layers[1]).max().unwrap_or(1);
    format!("{layers} garment{}", if layers == 1 { "" } else { "s" })
}

/// Number of parameters of the networks of `config` for data of these sizes.
fn parameter_count(config: &Config, sizes: &DataSizes) -> Result<usize, Report> {
    let per_joint = match config.data.poses.encoding {
        PoseEncoding::RotationMatrix => 9,
        PoseEncoding::AxisAngle => 3,
    };
    let dimensions =
        Dimensions { joints: sizes.joints, shape: sizes.shape_components, pose: per_joint * sizes.joints };
    let model = ClothCombo::new(&config.model, &dimensions, config.seed, &Backend::preferred().device());
    Ok(model.into_diagnostic()?.num_params())
}

/// What a run that starts says.
pub fn memory_line(m: &MemoryEstimate) -> String {
    let of_host = format!(
        "{} in use, {} for garments, {} for prepared scenes",
        gibibytes(m.program),
        gibibytes(m.garments + m.operators),
        gibibytes(m.scenes)
    );
    let of_device = format!(
        "{} for their tensors, {} for the largest step, {} for parameters",
        gibibytes(m.tensors),
        gibibytes(m.step),
        gibibytes(m.parameters)
    );
    match m.is_processor {
        true => format!("memory: about {} at the peak ({of_host}, {of_device})", gibibytes(m.peak())),
        false => format!(
            "memory: about {} at the peak ({of_host}) and {} on the device ({of_device})",
            gibibytes(m.host()),
            gibibytes(m.device())
        ),
    }
}

/// What to say where the run is expected to need more than there is.
pub fn memory_warning(m: &MemoryEstimate) -> Option<String> {
    let further = m.peak().saturating_sub(m.program);
    let available = available().filter(|available| further > *available)?;
    Some(format!(
        "the run may need {} more memory, of which {} are available; smaller networks, fewer layers or \
            data.memory_mib take less",
        gibibytes(further),
        gibibytes(available)
    ))
}
