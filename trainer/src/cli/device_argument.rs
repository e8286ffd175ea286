//! `--device`, the same for every verb that runs networks.

use crate::cli::verbosity::print_status;
use crate::system::device::{DeviceChoice, HAS_GPU_BACKEND, name};
use burn::tensor::Device;
use clap::Args;
use miette::Report;

/// Where networks run.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct DeviceArgument {
    /// Compute device: auto, flex, ndarray, wgpu[:N] or cuda[:N]. auto is a GPU where this build can use one, else the processor;
    /// N counts from 0, hardware before software
    #[arg(long = "device", value_name = "DEVICE", default_value_t)]
    choice: DeviceChoice,
}

impl DeviceArgument {
    /// Opens the device, without automatic differentiation, and says which it is.
    ///
    /// # Errors
    /// When this build or machine has none such.
    pub(crate) fn open(self) -> Result<Device, Report> {
        let device = self.choice.open()?;
        let line = format!("device: {}", name(&device));
        match (self.choice, HAS_GPU_BACKEND) {
            // It could be no other.
            (DeviceChoice::Auto, false) => tracing::info!("{line}"),
            _ => print_status(&line),
        }
        Ok(device)
    }
}
