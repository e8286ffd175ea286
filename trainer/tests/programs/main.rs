//! The programs as their users run them: one binary, because linking burn takes longer than most of these tests.

mod bad_input;
mod bench_stability;
mod bench_step;
mod caches;
mod check;
mod common;
mod data_check;
mod device;
mod drape;
mod drape_folders;
mod drape_input;
mod eval;
mod fit;
mod from_body;
mod garment_files;
mod generate;
mod import_programs;
mod incidents;
mod interrupt;
mod kill;
#[cfg(target_os = "linux")]
mod limits;
mod materials;
mod memory;
mod observability;
mod outputs;
mod own_garments;
mod own_motions;
mod resolve;
mod resume_changes;
mod run_safety;
mod score;
mod temporal_filter;
mod viewer;
