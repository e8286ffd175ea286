//! GPUs, and programs that stand for one, as a machine offers them.

use super::DeviceError;
use std::fmt;

/// What an adapter is, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
// CUDA knows graphics cards only.
#[cfg_attr(not(feature = "wgpu"), allow(dead_code))]
pub(super) enum AdapterKind {
    /// A graphics card.
    Discrete,
    /// A GPU beside the processor's cores.
    Integrated,
    /// A GPU that a virtual machine shares.
    Virtual,
    /// One whose driver does not say what it is.
    Other,
    /// A program on the processor, such as Mesa's lavapipe.
    Software,
}

impl AdapterKind {
    /// Whether `--device auto` may take it.
    #[cfg_attr(not(feature = "wgpu"), allow(dead_code))]
    pub(super) fn is_hardware(self) -> bool {
        matches!(self, Self::Discrete | Self::Integrated)
    }
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "unknown kind",
            Self::Software => "software, on the processor",
        })
    }
}

/// An adapter of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Adapter {
    /// What chooses it, such as `wgpu:0`.
    pub(super) choice: String,
    /// What its driver calls it.
    pub(super) name: String,
    /// What it is.
    pub(super) kind: AdapterKind,
}

impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "--device {}: {} ({})", self.choice, self.name, self.kind)
    }
}

/// The number of the adapter that is asked for, of `count`; `listed` describes them where there is none of that number.
///
/// # Errors
/// When there is no adapter, or none of that number.
pub(super) fn numbered(
    backend: &str,
    index: Option<usize>,
    count: usize,
    hint: &'static str,
    listed: impl FnOnce() -> Vec<Adapter>,
) -> Result<usize, DeviceError> {
    let device = index.map_or_else(|| backend.to_owned(), |index| format!("{backend}:{index}"));
    match index.unwrap_or(0) {
        _ if count == 0 => Err(DeviceError::NoAdapter { device, hint }),
        index if index < count => Ok(index),
        _ => {
            let list = listed().iter().map(|adapter| format!("\n{adapter}")).collect();
            Err(DeviceError::NoSuchAdapter { device, list })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::Report;

    fn two() -> Vec<Adapter> {
        let adapter =
            |choice: &str, name: &str, kind| Adapter { choice: choice.into(), name: name.into(), kind };
        vec![
            adapter("wgpu:0", "NVIDIA H100 80GB HBM3", AdapterKind::Discrete),
            adapter("wgpu:1", "llvmpipe", AdapterKind::Software),
        ]
    }

    #[test]
    fn device_number_beyond_the_last_adapter_lists_them_with_name_and_kind() {
        assert_eq!(numbered("wgpu", None, 2, "", two).unwrap(), 0);
        assert_eq!(numbered("wgpu", Some(1), 2, "", two).unwrap(), 1);
        let report = Report::from(numbered("wgpu", Some(2), 2, "", two).unwrap_err());
        assert_eq!(report.to_string(), "--device wgpu:2: there is no adapter of that number");
        assert_eq!(
            report.help().unwrap().to_string(),
            "found here:\n--device wgpu:0: NVIDIA H100 80GB HBM3 (discrete GPU)\n\
             --device wgpu:1: llvmpipe (software, on the processor)"
        );
    }

    #[test]
    fn device_of_a_machine_without_adapters_is_an_error_that_says_what_to_install() {
        let report = Report::from(numbered("wgpu", None, 0, "install a driver", Vec::new).unwrap_err());
        assert_eq!(report.to_string(), "--device wgpu: no adapter was found");
        assert_eq!(report.help().unwrap().to_string(), "install a driver");
    }

    #[test]
    fn device_kinds_are_ordered_with_software_last_and_only_real_gpus_are_taken_unasked() {
        use AdapterKind::*;
        let mut kinds = [Software, Other, Virtual, Integrated, Discrete];
        kinds.sort();
        assert_eq!(kinds, [Discrete, Integrated, Virtual, Other, Software]);
        assert_eq!(kinds.map(AdapterKind::is_hardware), [true, true, false, false, false]);
    }
}
