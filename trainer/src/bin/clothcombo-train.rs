//! Trains the networks: `clothcombo-train --config configs/smoke.toml`.

use std::process::ExitCode;

fn main() -> ExitCode {
    clothcombo_trainer::system::allocator::keep_freed_memory();
    clothcombo_trainer::system::device::prefer_processor();
    clothcombo_trainer::cli::train::main()
}
