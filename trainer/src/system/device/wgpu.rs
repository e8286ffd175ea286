//! The adapters of WebGPU, all of the one graphics API that burn settles on: on Linux Vulkan where it has any.

use super::adapter::{AdapterKind, cannot_open, open_numbered};
use super::{Opened, name, opened_name, remember};
use burn::tensor::wgpu::WgpuInitError;
use burn::tensor::{Device, DeviceKind, DeviceType};
use miette::Report;

const WGPU_HINT: &str = "install the GPU's Vulkan driver and the Vulkan loader (Debian: libvulkan1; mesa-vulkan-drivers for AMD and \
     Intel GPUs and for an adapter in software), or compute on the processor with --device flex";

/// An adapter, as burn selects it.
type Selector = (AdapterKind, DeviceKind);

/// All adapters in the order of their numbers, hardware first. Opens none.
fn selectors() -> Vec<Selector> {
    let found = Device::enumerate(DeviceType::Wgpu);
    // burn numbers the adapters of every kind from 0, and the adapters in software not at all.
    let of_kind = |kind: AdapterKind, selector: fn(usize) -> DeviceKind| {
        let selectors = (0..found.len()).map(selector);
        let is_there = |selector: &DeviceKind| found.contains(&Device::wgpu(selector.clone()));
        selectors.take_while(is_there).map(move |selector| (kind, selector)).collect::<Vec<_>>()
    };
    let mut all = of_kind(AdapterKind::Discrete, DeviceKind::DiscreteGpu);
    all.extend(of_kind(AdapterKind::Integrated, DeviceKind::IntegratedGpu));
    all.extend(of_kind(AdapterKind::Virtual, DeviceKind::VirtualGpu));
    if found.contains(&Device::wgpu(DeviceKind::Cpu)) {
        all.push((AdapterKind::Software, DeviceKind::Cpu));
    }
    if all.is_empty() && !found.is_empty() {
        // burn has no selector for adapters that do not say what they are; its default is the best of them.
        all.push((AdapterKind::Other, DeviceKind::DefaultDevice));
    }
    all
}

/// The adapter number `index`, or the first.
///
/// # Errors
/// When there is none, or it cannot be opened.
pub(super) fn open(index: Option<usize>) -> Result<Device, Report> {
    let selectors = selectors();
    let kinds: Vec<AdapterKind> = selectors.iter().map(|(kind, _)| *kind).collect();
    let open = |index: usize| open_selected(index, &selectors[index].1);
    open_numbered("wgpu", index, &kinds, WGPU_HINT, open, name)
}

/// The first adapter if it is a GPU, for `--device auto`.
pub(super) fn open_hardware() -> Option<Result<Device, Report>> {
    let selectors = selectors();
    let (kind, selector) = selectors.first()?;
    kind.is_hardware().then(|| open_selected(0, selector))
}

fn open_selected(index: usize, selector: &DeviceKind) -> Result<Device, Report> {
    let device = Device::wgpu(selector.clone());
    if opened_name(&device).is_some() {
        return Ok(device);
    }
    let (name, largest_buffer) = match Device::wgpu_options().device_kind(selector.clone()).init_with_setup()
    {
        Ok((_, setup)) => {
            let adapter = setup.adapter.get_info();
            let api = format!("{:?}", adapter.backend);
            // What burn falls back to without a driver of the other APIs: slow, and never tried.
            if api == "Gl" {
                let reason = format!("{} is there through OpenGL only; {WGPU_HINT}", adapter.name);
                return Err(cannot_open("wgpu", index, reason));
            }
            let limits = setup.device.limits();
            let largest = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
            (format!("{} (wgpu:{index}, {api})", adapter.name), Some(largest))
        }
        // A tensor has opened it before.
        Err(WgpuInitError::Registration { .. }) => {
            let identity = device.identity().map(|identity| identity.name);
            (format!("{} (wgpu:{index})", identity.unwrap_or_default()), None)
        }
        Err(error) => return Err(cannot_open("wgpu", index, error)),
    };
    remember(Opened { device: device.clone(), name, largest_buffer });
    Ok(device)
}
