//! The compute devices a build can train on.

use burn::tensor::Device;
use clap::ValueEnum;

/// Backend names on the command line; each needs the Cargo feature of the same name.
#[derive(Clone, Copy, Debug, PartialEq, ValueEnum)]
pub enum Backend {
    /// burn's CPU backend (default).
    #[cfg(feature = "flex")]
    Flex,
    /// burn's older CPU backend on the ndarray crate.
    #[cfg(feature = "ndarray")]
    Ndarray,
    /// Any GPU through WebGPU.
    #[cfg(feature = "wgpu")]
    Wgpu,
    /// NVIDIA GPUs.
    #[cfg(feature = "cuda")]
    Cuda,
}

impl Backend {
    /// The backend used when none is named: the first compiled in.
    pub fn preferred() -> Self {
        Self::value_variants()[0]
    }

    /// The device, without automatic differentiation.
    pub fn device(self) -> Device {
        match self {
            #[cfg(feature = "flex")]
            Self::Flex => Device::flex(),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated)] // burn marks it as succeeded by flex; users may still choose it
            Self::Ndarray => Device::ndarray(),
            #[cfg(feature = "wgpu")]
            Self::Wgpu => Device::wgpu(burn::tensor::DeviceKind::DefaultDevice),
            #[cfg(feature = "cuda")]
            Self::Cuda => Device::cuda(0),
        }
    }
}

/// Whether `device` (with or without automatic differentiation) is this machine's processor, where several threads can
/// compute in parallel.
pub fn is_processor(device: &Device) -> bool {
    let device = device.clone().inner();
    let is = |backend: &Backend| match backend {
        #[cfg(feature = "flex")]
        Backend::Flex => backend.device() == device,
        #[cfg(feature = "ndarray")]
        Backend::Ndarray => backend.device() == device,
        #[cfg(any(feature = "wgpu", feature = "cuda"))]
        _ => false,
    };
    Backend::value_variants().iter().any(is)
}

#[cfg(not(any(feature = "flex", feature = "ndarray", feature = "wgpu", feature = "cuda")))]
compile_error!("choose at least one backend feature: flex, ndarray, wgpu or cuda");
