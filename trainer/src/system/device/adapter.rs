//! GPUs, and programs that stand for one, as a machine offers them.

use miette::{Report, miette};
use std::fmt::{self, Display};

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

/// The adapter that is asked for by its number among `kinds`, or the first, as `open` opens it. `name` is what an open one is
/// called.
///
/// # Errors
/// When there is no adapter, or none of that number, which lists those that are there; and those of `open`.
pub(super) fn open_numbered<D>(
    backend: &str,
    index: Option<usize>,
    kinds: &[AdapterKind],
    hint: &'static str,
    open: impl Fn(usize) -> Result<D, Report>,
    name: impl Fn(&D) -> String,
) -> Result<D, Report> {
    let device = index.map_or_else(|| backend.to_owned(), |index| format!("{backend}:{index}"));
    match index.unwrap_or(0) {
        _ if kinds.is_empty() => Err(miette!(help = hint, "--device {device}: no adapter was found")),
        index if index < kinds.len() => open(index),
        _ => {
            let line = |(index, kind): (usize, &AdapterKind)| {
                let name = open(index).map_or_else(|error| error.to_string(), |opened| name(&opened));
                // Without the number and the API at its end.
                let name = name.split(&format!(" ({backend}:")).next().unwrap_or_default();
                format!("\n--device {backend}:{index}: {name} ({kind})")
            };
            let list: String = kinds.iter().enumerate().map(line).collect();
            Err(miette!(
                help = format!("found here:{list}"),
                "--device {device}: there is no adapter of that number"
            ))
        }
    }
}

/// An adapter that is there but does not work.
#[cfg_attr(not(any(feature = "wgpu", feature = "cuda")), allow(dead_code))]
pub(super) fn cannot_open(backend: &str, index: usize, reason: impl Display) -> Report {
    miette!(
        help = "check its driver; `--device flex` computes on the processor",
        "--device {backend}:{index} cannot be opened: {reason}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: [AdapterKind; 2] = [AdapterKind::Discrete, AdapterKind::Software];

    fn numbered(index: Option<usize>, kinds: &[AdapterKind]) -> Result<&'static str, Report> {
        let names = ["NVIDIA H100 80GB HBM3 (wgpu:0, Vulkan)", "llvmpipe (wgpu:1, Vulkan)"];
        let name = |name: &&str| (*name).to_owned();
        open_numbered("wgpu", index, kinds, "install a driver", |index| Ok(names[index]), name)
    }

    #[test]
    fn device_number_beyond_the_last_adapter_lists_them_with_name_and_kind() {
        assert!(numbered(None, &TWO).unwrap().starts_with("NVIDIA"));
        assert!(numbered(Some(1), &TWO).unwrap().starts_with("llvmpipe"));
        let report = numbered(Some(2), &TWO).unwrap_err();
        assert_eq!(report.to_string(), "--device wgpu:2: there is no adapter of that number");
        assert_eq!(
            report.help().unwrap().to_string(),
            "found here:\n--device wgpu:0: NVIDIA H100 80GB HBM3 (discrete GPU)\n\
             --device wgpu:1: llvmpipe (software, on the processor)"
        );
    }

    #[test]
    fn device_of_a_machine_without_adapters_is_an_error_that_says_what_to_install() {
        let report = numbered(None, &[]).unwrap_err();
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
