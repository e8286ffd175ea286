//! NVIDIA's GPUs, as CUDA numbers them.

use super::adapter::{AdapterKind, cannot_open, open_numbered};
use super::{Opened, name, opened_name, remember};
use burn::tensor::{Device, DeviceType};
use miette::Report;
use std::panic::{AssertUnwindSafe, catch_unwind};

const CUDA_HINT: &str =
    "install NVIDIA's driver and check CUDA_VISIBLE_DEVICES, or compute on the processor with --device flex";

/// GPU number `index`, or the first.
///
/// # Errors
/// When there is none, or it cannot be opened.
pub(super) fn open(index: Option<usize>) -> Result<Device, Report> {
    let kinds = vec![AdapterKind::Discrete; Device::enumerate(DeviceType::Cuda).len()];
    open_numbered("cuda", index, &kinds, CUDA_HINT, open_gpu, name)
}

/// The first GPU if there is one, for `--device auto`.
pub(super) fn open_hardware() -> Option<Result<Device, Report>> {
    (!Device::enumerate(DeviceType::Cuda).is_empty()).then(|| open_gpu(0))
}

fn open_gpu(index: usize) -> Result<Device, Report> {
    let device = Device::cuda(index);
    if opened_name(&device).is_some() {
        return Ok(device);
    }
    // The driver's refusal is a panic of burn's.
    let identity = catch_unwind(AssertUnwindSafe(|| device.identity()))
        .map_err(|_| cannot_open("cuda", index, "the driver refuses it"))?;
    let name = identity.map(|identity| identity.name).unwrap_or_default();
    let name = format!("{name} (cuda:{index})");
    remember(Opened { device: device.clone(), name, largest_buffer: None });
    Ok(device)
}
