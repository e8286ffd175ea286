//! Contracts between the crates: one binary, because linking burn takes longer than most of these tests.

mod acceptance;
mod checkpoint;
mod clipping;
mod config_fuzz;
mod configs;
mod degenerate_cases;
mod device;
mod frozen;
mod graph;
mod intersections;
mod messy_garments;
mod other_bodies;
mod other_objects;
mod parallel_scenes;
mod placement;
mod resume;
mod score_oracle;
mod single_garment_losses;
mod streaming;
