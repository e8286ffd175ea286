//! Trains the networks: `clothcombo-train --config configs/smoke.toml`.

use clothcombo_trainer::system::limits::{SystemMemory, report_limits};
use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: SystemMemory = SystemMemory;

fn main() -> ExitCode {
    report_limits();
    clothcombo_trainer::system::allocator::keep_freed_memory();
    clothcombo_trainer::system::device::prefer_processor();
    clothcombo_trainer::cli::train::main()
}
