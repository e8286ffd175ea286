//! What `--device` may say, and the device that it means on this machine.

use super::default_device;
use burn::tensor::Device;
use miette::{Report, miette};
use std::fmt;
use std::str::FromStr;

/// A device as a user names it. All forms exist in every build; [`open`](Self::open) says what a build lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A GPU where the build and the machine have one, else the processor.
    #[default]
    Auto,
    /// The processor, by burn's own backend.
    Flex,
    /// The processor, by burn's older backend on the ndarray crate.
    Ndarray,
    /// An adapter of WebGPU (on Linux: of Vulkan) by its number among all, hardware first; without a number the first.
    Wgpu(Option<usize>),
    /// An NVIDIA GPU by CUDA's number; without one number 0.
    Cuda(Option<usize>),
}

impl DeviceChoice {
    /// One device for every backend of this build, the processor first.
    pub fn of_this_build() -> Vec<Self> {
        let all = [Self::Flex, Self::Ndarray, Self::Wgpu(None), Self::Cuda(None)];
        all.into_iter().filter(|choice| choice.is_in_this_build()).collect()
    }

    /// The Cargo feature it needs; `Auto` needs none.
    pub fn feature(self) -> Option<&'static str> {
        match self {
            Self::Auto => None,
            Self::Flex => Some("flex"),
            Self::Ndarray => Some("ndarray"),
            Self::Wgpu(_) => Some("wgpu"),
            Self::Cuda(_) => Some("cuda"),
        }
    }

    fn is_in_this_build(self) -> bool {
        match self {
            Self::Auto => true,
            Self::Flex => cfg!(feature = "flex"),
            Self::Ndarray => cfg!(feature = "ndarray"),
            Self::Wgpu(_) => cfg!(feature = "wgpu"),
            Self::Cuda(_) => cfg!(feature = "cuda"),
        }
    }

    /// The device, without automatic differentiation. A GPU is opened now, so that one that does not work is known before
    /// anything is computed.
    ///
    /// # Errors
    /// When this build lacks the backend, or the machine the device, or the device cannot be opened.
    pub fn open(self) -> Result<Device, Report> {
        match self {
            Self::Auto => open_best(),
            #[cfg(feature = "flex")]
            Self::Flex => Ok(Device::flex()),
            #[cfg(feature = "ndarray")]
            Self::Ndarray => Ok(super::ndarray()),
            #[cfg(feature = "wgpu")]
            Self::Wgpu(index) => super::wgpu::open(index),
            #[cfg(feature = "cuda")]
            Self::Cuda(index) => super::cuda::open(index),
            #[allow(unreachable_patterns)] // where all backends are compiled in
            _ => {
                let feature = self.feature().unwrap_or_default();
                Err(miette!(
                    help = format!("build it: cargo build --release --workspace --bins --features {feature}"),
                    "--device {self}: this build has no Cargo feature `{feature}`"
                ))
            }
        }
    }
}

/// The first GPU that opens, else the processor; in a build without that, whatever adapter there is.
fn open_best() -> Result<Device, Report> {
    #[cfg(feature = "cuda")]
    if let Some(device) = or_warn(super::cuda::open_hardware()) {
        return Ok(device);
    }
    #[cfg(feature = "wgpu")]
    if let Some(device) = or_warn(super::wgpu::open_hardware()) {
        return Ok(device);
    }
    match DeviceChoice::of_this_build().first() {
        Some(gpu @ (DeviceChoice::Wgpu(_) | DeviceChoice::Cuda(_))) => gpu.open(),
        _ => Ok(default_device()),
    }
}

/// The device, or none with a warning where a GPU that is there does not open.
#[cfg(any(feature = "wgpu", feature = "cuda"))]
fn or_warn(opened: Option<Result<Device, Report>>) -> Option<Device> {
    opened?.map_err(|error| tracing::warn!("passed over: {error}")).ok()
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?} is no device; say auto, flex, ndarray, wgpu, wgpu:N, cuda or cuda:N, with N from 0"
            )
        };
        let (backend, number) = match text.split_once(':') {
            Some((backend, number)) => {
                // `parse` alone takes a sign.
                let digits = number.bytes().all(|b| b.is_ascii_digit());
                (backend, Some(number.parse().ok().filter(|_| digits).ok_or_else(wrong)?))
            }
            None => (text, None),
        };
        match (backend, number) {
            ("auto", None) => Ok(Self::Auto),
            ("flex", None) => Ok(Self::Flex),
            ("ndarray", None) => Ok(Self::Ndarray),
            ("wgpu", number) => Ok(Self::Wgpu(number)),
            ("cuda", number) => Ok(Self::Cuda(number)),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.feature().unwrap_or("auto"))?;
        match self {
            Self::Wgpu(Some(number)) | Self::Cuda(Some(number)) => write!(f, ":{number}"),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{is_processor, name};
    use super::*;

    #[test]
    fn device_spelling_is_read_and_written_alike() {
        for (text, choice) in [
            ("auto", DeviceChoice::Auto),
            ("flex", DeviceChoice::Flex),
            ("ndarray", DeviceChoice::Ndarray),
            ("wgpu", DeviceChoice::Wgpu(None)),
            ("wgpu:0", DeviceChoice::Wgpu(Some(0))),
            ("cuda", DeviceChoice::Cuda(None)),
            ("cuda:12", DeviceChoice::Cuda(Some(12))),
        ] {
            assert_eq!(text.parse(), Ok(choice));
            assert_eq!(choice.to_string(), text);
        }
        for wrong in [
            "", "gpu", "WGPU", "wgpu:", "wgpu:x", "wgpu:-1", "wgpu:+1", "cuda:1:2", "flex:0", "auto:0",
            "wgpu 1",
        ] {
            let error = wrong.parse::<DeviceChoice>().unwrap_err().to_string();
            for form in ["auto", "flex", "ndarray", "wgpu:N", "cuda:N"] {
                assert!(error.contains(form), "{error}");
            }
        }
    }

    #[test]
    fn device_that_the_build_lacks_is_an_error_with_the_feature_and_the_command() {
        let all = [
            DeviceChoice::Flex,
            DeviceChoice::Ndarray,
            DeviceChoice::Wgpu(Some(3)),
            DeviceChoice::Cuda(None),
        ];
        for choice in all.into_iter().filter(|choice| !DeviceChoice::of_this_build().contains(choice)) {
            // One that is compiled in, with a number.
            if choice.is_in_this_build() {
                continue;
            }
            let report = choice.open().unwrap_err();
            let feature = choice.feature().unwrap();
            let said = format!("{report} {}", report.help().unwrap());
            assert!(said.contains(&format!("--device {choice}")) && said.contains("Cargo feature"), "{said}");
            assert!(
                said.contains(&format!("cargo build --release --workspace --bins --features {feature}")),
                "{said}"
            );
        }
    }

    #[test]
    #[cfg(all(feature = "flex", not(any(feature = "wgpu", feature = "cuda"))))]
    fn device_auto_is_the_processor_in_a_build_without_gpus() {
        let device = DeviceChoice::default().open().unwrap();
        assert!(device == default_device() && is_processor(&device));
        assert_eq!(name(&device), "processor (flex)");
    }

    #[test]
    #[cfg(feature = "ndarray")]
    fn device_ndarray_is_a_processor() {
        let device = DeviceChoice::Ndarray.open().unwrap();
        assert!(is_processor(&device));
        assert_eq!(name(&device), "processor (ndarray)");
    }

    #[test]
    #[cfg(feature = "wgpu")]
    fn device_wgpu_is_no_processor_and_a_number_too_large_lists_the_adapters() {
        let Ok(device) = DeviceChoice::Wgpu(None).open() else { return }; // no adapter here
        assert!(!is_processor(&device));
        assert!(name(&device).contains("(wgpu:0, "), "{}", name(&device));
        assert!(DeviceChoice::Wgpu(Some(0)).open().unwrap() == device);
        let report = DeviceChoice::Wgpu(Some(99)).open().unwrap_err();
        let said = format!("{report} {}", report.help().unwrap());
        assert!(said.contains("--device wgpu:99") && said.contains("wgpu:0"), "{said}");
    }
}
