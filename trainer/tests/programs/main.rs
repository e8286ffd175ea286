//! The programs as their users run them: one binary, because linking burn takes longer than most of these tests.

mod bad_input;
mod bench_certificate;
mod bench_error;
mod bench_stability;
mod bench_step;
mod check;
mod common;
mod device;
mod drape;
mod drape_folders;
mod drape_input;
mod eval;
mod fit;
mod generate;
mod import_programs;
mod incidents;
mod interrupt;
mod kill;
mod memory;
mod observability;
mod own_garments;
mod resolve;
mod run_safety;
mod score;
mod temporal_filter;
mod viewer;
