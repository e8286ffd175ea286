//! A made-up training run of a given size, on built-in data.

use crate::config::{Config, Trains};
use miette::{IntoDiagnostic, Report, miette};

/// Sizes of a run to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// Vertices per garment, about.
    pub vertices: usize,
    /// Garments of every scene.
    pub layers: usize,
    /// Width of all networks but S, whose is at most 128.
    pub width: usize,
    /// DiffusionNet blocks.
    pub blocks: usize,
    /// Laplacian eigenpairs per garment.
    pub eigen_count: usize,
    /// Bodies per step.
    pub bodies: usize,
    /// Which networks learn.
    pub trains: Trains,
}

impl Case {
    /// Networks of `width` with the depth and the eigenpairs that go with it: from 256 on the paper's (512: all its sizes),
    /// below those of `configs/open.toml`.
    pub fn new(width: usize, layers: usize, vertices: usize) -> Self {
        let (blocks, eigen_count) = match width {
            0..=64 => (4, 48),
            65..=255 => (4, 64),
            _ => (8, 128),
        };
        Self { vertices, layers, width, blocks, eigen_count, bodies: 1, trains: Trains::All }
    }

    /// The run: generated garments on the built-in body, all losses over all pairs of vertices, as printed in the paper.
    ///
    /// # Errors
    /// A size out of range, named.
    pub fn config(&self) -> Result<Config, Report> {
        let Self { vertices, layers, width, blocks, eigen_count, bodies, trains } = *self;
        let skinning_width = width.min(128);
        let trains = match trains {
            Trains::Single => "single",
            Trains::Untangling => "untangling",
            Trains::All => "all",
            Trains::Corrections => "corrections",
        };
        // Garments that reach the same parts of the body come first, so that even two layers touch.
        let text = format!(
            r#"
            seed = 1
            [data]
            max_vertices = 1000000
            poses = {{ max_self_intersection = 10.0 }}
            [[data.garments]]
            generate = {{ count = {layers}, seed = 11, vertices = {vertices}, categories = ["t_shirt", "dress", "open_shirt", "trousers", "skirt", "top"] }}
            [model]
            width = {width}
            embedding = {width}
            diffusion_blocks = {blocks}
            diffusion_width = {width}
            eigen_count = {eigen_count}
            siren_width = {width}
            skinning_width = {skinning_width}
            [losses]
            repulsion = {{ subset = 0 }}
            [[stages]]
            name = "measured"
            trains = "{trains}"
            steps = 1000000
            layers = [{layers}, {layers}]
            bodies = {bodies}
            "#
        );
        let config: Config = toml::from_str(&text).into_diagnostic()?;
        match config.problem() {
            None => Ok(config),
            Some((place, what, hint)) => Err(miette!(help = hint, "{place} {what}")),
        }
    }

    /// What it is, in a few words.
    pub fn name(&self) -> String {
        let Self { vertices, layers, width, eigen_count, bodies, .. } = self;
        let several = if *bodies > 1 { format!(", {bodies} bodies") } else { String::new() };
        format!("width {width}, k {eigen_count}, M = {layers}, {vertices} vertices{several}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_is_a_valid_run_and_a_size_out_of_range_is_named() {
        let case = Case::new(128, 3, 2000);
        let config = case.config().expect("valid");
        assert_eq!(
            (config.model.width, config.model.eigen_count, config.stages[0].layers),
            (128, 64, [3, 3])
        );
        let few = Case { vertices: 3, ..case }.config().expect_err("too few vertices");
        assert!(few.to_string().contains("data.garments[0].generate"), "{few}");
    }
}
