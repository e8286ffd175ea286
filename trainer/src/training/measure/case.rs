//! A synthetic training run of a given size, on built-in data.

use crate::config::{Config, ConfigError, Trains, parse};
use serde::Serialize;
use std::path::Path;

/// Sizes of a run to measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Case {
    /// Vertices per garment, about.
    pub vertices: usize,
    /// Garments of every scene.
    pub layers: usize,
    /// Width of all networks; that of S is at most 128.
    pub width: usize,
    /// DiffusionNet blocks.
    #[serde(skip)]
    pub blocks: usize,
    /// Laplacian eigenpairs per garment.
    pub eigen_count: usize,
    /// Bodies per step.
    pub bodies: usize,
    /// Which networks learn.
    #[serde(skip)]
    pub trains: Trains,
}

impl Case {
    /// Networks of `width`. From 256 on they have the paper's depth and eigenpairs (512: all its sizes), below those of
    /// `configs/open.toml`.
    pub fn new(width: usize, layers: usize, vertices: usize) -> Self {
        let (blocks, eigen_count) = match width {
            0..=64 => (4, 48),
            65..=255 => (4, 64),
            _ => (8, 128),
        };
        Self { vertices, layers, width, blocks, eigen_count, bodies: 1, trains: Trains::All }
    }

    /// The configuration: generated garments on the built-in body, all losses over all pairs of vertices, as printed in the
    /// paper. `overrides` (`a.b=value`) change it as they change a file.
    ///
    /// # Errors
    /// Names the size that is out of range, or the override that is wrong.
    pub fn config(&self, overrides: &[String]) -> Result<Config, ConfigError> {
        let Self { vertices, layers, width, blocks, eigen_count, bodies, trains } = *self;
        let skinning_width = width.min(128);
        // Quoted, as TOML has it too.
        let trains = serde_json::json!(trains);
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
            trains = {trains}
            steps = 1000000
            layers = [{layers}, {layers}]
            bodies = {bodies}
            "#
        );
        parse(&text, Path::new("the synthetic run"), overrides)
    }

    /// The sizes of `config`, which is the configuration of this case with overrides.
    pub fn of_config(self, config: &Config) -> Self {
        let stage = &config.stages[0];
        Self {
            layers: stage.layers[1],
            width: config.model.width,
            blocks: config.model.diffusion_blocks,
            eigen_count: config.model.eigen_count,
            bodies: stage.bodies,
            trains: stage.trains,
            ..self
        }
    }

    /// Its sizes as text.
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
        let config = case.config(&[]).expect("valid");
        assert_eq!(
            (config.model.width, config.model.eigen_count, config.stages[0].layers),
            (128, 64, [3, 3])
        );
        let few = Case { vertices: 3, ..case }.config(&[]).expect_err("too few vertices");
        assert!(few.to_string().contains("data.garments[0].generate"), "{few}");
        let other = case
            .config(&["model.width=16".into(), "losses.repulsion.per_vertex=false".into()])
            .expect("valid");
        assert_eq!(case.of_config(&other), Case { width: 16, ..case });
        assert!(!other.losses.repulsion.per_vertex);
        assert!(case.config(&["losses.strian.weight=1".into()]).is_err());
    }
}
