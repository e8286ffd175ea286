//! Contracts between the crates: one binary, because linking burn takes longer than most of these tests.

mod alone;
mod checkpoint;
mod clipping;
mod config_fuzz;
mod configs;
mod corrections;
mod degenerate_cases;
mod graph;
mod intersections;
mod messy_garments;
mod resume;
mod scenes_at_once;
mod score_oracle;
mod streaming;
