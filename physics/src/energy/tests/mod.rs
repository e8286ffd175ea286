//! What all energies must hold. Every test here walks [`super::Term::ALL`] or names the terms it is about.

mod brute_force;
mod curvature;
mod determinism;
mod finite_differences;
mod invariance;
mod materials;
pub(crate) mod scenes;
