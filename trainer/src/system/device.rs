//! The compute devices: what `--device` may name, which of them this build and machine have, what they are called.
//!
//! ```text
//! DeviceChoice ──open──▶ burn's Device ──name──▶ "NVIDIA H100 80GB HBM3 (wgpu:0, Vulkan)"
//! ```

#[cfg(any(feature = "wgpu", feature = "cuda", test))]
mod adapter;
mod choice;
#[cfg(feature = "cuda")]
mod cuda;
#[cfg(feature = "wgpu")]
mod wgpu;

pub use choice::DeviceChoice;

use burn::tensor::Device;
use miette::{Report, miette};
use std::sync::Mutex;

/// Whether this build can use a GPU at all.
pub const HAS_GPU_BACKEND: bool = cfg!(any(feature = "wgpu", feature = "cuda"));

/// What burn's usual backend for the processor is called.
pub const FLEX: &str = "processor (flex)";

/// A GPU that was opened: burn tells nothing of one that it has not opened itself.
struct Opened {
    device: Device,
    name: String,
    /// Largest memory that a kernel can be given at once (bytes), where the device has such a limit.
    largest_buffer: Option<u64>,
}

static OPENED: Mutex<Vec<Opened>> = Mutex::new(Vec::new());

/// The device of everything that names none: the processor, or in a build without it the GPU that burn takes first. It has
/// no automatic differentiation.
#[allow(unreachable_code)]
pub fn default_device() -> Device {
    #[cfg(feature = "flex")]
    return Device::flex();
    #[cfg(feature = "ndarray")]
    return ndarray();
    #[cfg(feature = "cuda")]
    return Device::cuda(0);
    #[cfg(feature = "wgpu")]
    return Device::wgpu(burn::tensor::DeviceKind::DefaultDevice);
}

#[cfg(feature = "ndarray")]
#[allow(deprecated)] // burn marks it as succeeded by flex; users may still choose it
fn ndarray() -> Device {
    Device::ndarray()
}

/// Scenes of a step that are computed at once: on a processor as many as there are threads; on a GPU two, so that the
/// host computes the energies of one while the device computes the networks of the other.
pub fn scenes_at_once(is_processor: bool) -> usize {
    if is_processor { rayon::current_num_threads() } else { 2 }
}

/// Whether `device` (with or without automatic differentiation) is this machine's processor, where several threads can
/// compute in parallel. A software adapter of `wgpu` is not: it is driven like a GPU.
pub fn is_processor(device: &Device) -> bool {
    processor_backend(device).is_some()
}

/// The backend that computes on the processor, if `device` is it.
fn processor_backend(device: &Device) -> Option<&'static str> {
    let device = device.clone().inner();
    #[cfg(feature = "flex")]
    if device == Device::flex() {
        return Some("flex");
    }
    #[cfg(feature = "ndarray")]
    if device == ndarray() {
        return Some("ndarray");
    }
    let _ = device;
    None
}

/// What `device` is called in logs and reports, such as `processor (flex)` or `NVIDIA H100 80GB HBM3 (wgpu:0, Vulkan)`. A GPU
/// has its name from [`DeviceChoice::open`]; opened in another way, it goes by burn's.
pub fn name(device: &Device) -> String {
    match processor_backend(device) {
        Some(backend) => format!("processor ({backend})"),
        None => {
            opened_name(&device.clone().inner()).unwrap_or_else(|| format!("{:?}", device.clone().inner()))
        }
    }
}

/// What `read` finds of a GPU that was opened.
fn opened<T>(device: &Device, read: impl FnOnce(&Opened) -> T) -> Option<T> {
    let all = OPENED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    all.iter().find(|opened| opened.device == *device).map(read)
}

fn opened_name(device: &Device) -> Option<String> {
    opened(device, |opened| opened.name.clone())
}

#[cfg(any(feature = "wgpu", feature = "cuda"))]
fn remember(opened: Opened) {
    OPENED.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).push(opened);
}

/// Refuses what needs a tensor of more `bytes` than a kernel on `device` (with or without automatic differentiation) can read.
///
/// # Errors
/// When it does.
pub fn check_largest(device: &Device, bytes: u64) -> Result<(), Report> {
    let device = device.clone().inner();
    match opened(&device, |opened| opened.largest_buffer).flatten() {
        Some(limit) if bytes > limit => Err(miette!(
            help = "fewer garments per outfit (layers) or vertices, a smaller model.siren_width, or --device flex",
            "the largest outfit needs a tensor of {} MiB, and {} grants {} MiB at once",
            bytes.div_ceil(1 << 20),
            name(&device),
            limit >> 20
        )),
        _ => Ok(()),
    }
}

/// Keeps burn from opening a GPU for a run on the processor: it reads Adam's moments on its own default device, which in a
/// build with GPUs is one of them. The moments move to their parameters' device at the next step, whatever that is.
///
/// To be called first of all in a program, while it has one thread.
pub fn prefer_processor() {
    let processor = match () {
        () if cfg!(feature = "flex") => "flex",
        () if cfg!(feature = "ndarray") => "ndarray",
        () => return,
    };
    if HAS_GPU_BACKEND && std::env::var_os("BURN_DEVICE").is_none() {
        // SAFETY: no other thread reads the environment, since there is none yet.
        unsafe { std::env::set_var("BURN_DEVICE", processor) };
    }
}

#[cfg(not(any(feature = "flex", feature = "ndarray", feature = "wgpu", feature = "cuda")))]
compile_error!("choose at least one backend feature: flex, ndarray, wgpu or cuda");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(feature = "flex")]
    fn device_of_the_processor_is_known_with_and_without_automatic_differentiation() {
        let device = default_device();
        assert!(is_processor(&device) && is_processor(&device.clone().autodiff()));
        assert_eq!(name(&device.autodiff()), "processor (flex)");
    }
}
