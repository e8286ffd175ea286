//! What a run will need of memory, as a table and in a line.

use crate::cli::table::{row, table};
use crate::config::Config;
use crate::dataset::DataSizes;
use crate::run::memory::MemoryEstimate;
use crate::system::device::default_device;
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
            &*format!("garments kept, of {}", gibibytes(gpu.all_garments)),
            "operators, streamed from data.cache.folder",
        ),
        false => {
            ("all garments, for want of data.cache.folder", "operators of all garments, for the same reason")
        }
    };
    let row = |name: &str, host: Option<u64>, device: Option<u64>, processor: u64| {
        let bytes = |bytes: Option<u64>| bytes.map_or(String::new(), gibibytes);
        row! {
            "" => name,
            "GPU: host" => bytes(host),
            "GPU: device" => bytes(device),
            "CPU: host" => gibibytes(processor),
        }
    };
    let on_host = |name: &str, of: fn(&MemoryEstimate) -> u64| row(name, Some(of(&gpu)), None, of(&cpu));
    let on_device = |name: &str, of: fn(&MemoryEstimate) -> u64| row(name, None, Some(of(&gpu)), of(&cpu));
    let rows = [
        on_host("program, body, list of garments", |m| m.program),
        on_host(garments, |m| m.garments),
        on_host(operators, |m| m.operators),
        on_host("scenes prepared in advance", |m| m.scenes),
        on_host("at the start: garments being prepared", |m| m.preparation),
        on_host("pictures", |m| m.pictures),
        on_device(&format!("tensors and embeddings kept, of {}", gibibytes(gpu.all_tensors)), |m| m.tensors),
        on_device("Adam's moments, copies of the parameters", |m| m.parameters),
        on_device(&format!("the largest step ({})", largest_step(config)), |m| m.step),
        row("together", Some(gpu.host()), Some(gpu.device()), cpu.peak()),
    ];
    print!("{}", table(&rows));
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
    let pose = config.data.poses.encoding.per_joint() * sizes.joints;
    let dimensions = Dimensions { joints: sizes.joints, shape: sizes.shape_components, pose };
    let model = ClothCombo::new(&config.model, &dimensions, config.seed, &default_device());
    Ok(model.into_diagnostic()?.num_params())
}

/// What a run that starts says.
pub fn memory_line(m: &MemoryEstimate) -> String {
    let of_host = format!(
        "{} for the program, {} for garments, {} for prepared scenes and pictures",
        gibibytes(m.program),
        gibibytes(m.garments + m.operators),
        gibibytes(m.scenes + m.pictures)
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
