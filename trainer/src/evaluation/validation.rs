//! The fixed validation scenes, scored for every method.

use super::scene_evaluation::{drape_by, evaluate};
use super::score::{SceneScore, method_score, score_scene};
use crate::config::{Config, LossesConfig};
use crate::dataset::{
    Dataset, DatasetError, PreparedScene, SceneSample, ValidationGroup, prepare, sample_validation,
};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use crate::run::validation::{GroupReport, Method, ValidationReport};

/// All validation scenes, as samples: they are prepared when they are scored, so that a large dataset need not be in memory.
pub struct ValidationSet {
    groups: Vec<(ValidationGroup, Vec<SceneSample>)>,
    losses: LossesConfig,
    shape_transfer: bool,
}

impl ValidationSet {
    /// Samples the scenes of `config`; losses have their final weights.
    pub fn new(dataset: &Dataset, config: &Config) -> Self {
        let groups = ValidationGroup::ALL.map(|group| {
            (group, sample_validation(dataset, config.validation_seed(), &config.validation, group))
        });
        Self {
            groups: groups.into_iter().filter(|(_, scenes)| !scenes.is_empty()).collect(),
            losses: config.losses.clone(),
            shape_transfer: config.start.shape_transfer,
        }
    }

    /// The scenes of `group`.
    pub fn samples(&self, group: ValidationGroup) -> &[SceneSample] {
        self.groups.iter().find(|(g, _)| *g == group).map_or(&[], |(_, samples)| samples)
    }

    /// The skinning that the networks start from.
    pub fn skinning(&self) -> Method {
        if self.shape_transfer { Method::LbsWithShapeTransfer } else { Method::Lbs }
    }

    /// Prepares a scene with the losses' final weights.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn prepare(&self, dataset: &Dataset, sample: &SceneSample) -> Result<PreparedScene, DatasetError> {
        prepare(dataset, &self.losses, sample.clone(), 1.0)
    }

    /// Scores skinning and `networks` on every scene.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn score(&self, dataset: &Dataset, networks: &Networks) -> Result<ValidationReport, DrapeError> {
        let group_report = |(group, samples): &(ValidationGroup, Vec<SceneSample>)| {
            let mut methods = vec![Method::Lbs];
            if self.shape_transfer {
                methods.push(Method::LbsWithShapeTransfer);
            }
            if *group == ValidationGroup::Layered {
                methods.push(Method::SingleGarments);
            }
            methods.push(Method::Network);
            let score = |scene: &PreparedScene, drapes: &[Draped]| -> Vec<SceneScore> {
                let body = scene.exact_body();
                drapes.iter().map(|draped| score_scene(scene, &body, draped)).collect()
            };
            let scores = evaluate(
                samples,
                |sample| self.prepare(dataset, sample),
                |scene| drape_by(networks, &methods, scene),
                score,
            )?;
            let method = |(m, method): (usize, &Method)| {
                let scores: Vec<SceneScore> = scores.iter().map(|scores| scores[m].clone()).collect();
                method_score(method.name(), &scores)
            };
            let methods = methods.iter().enumerate().map(method).collect();
            Ok(GroupReport { group: group.name(), scenes: samples.len(), methods })
        };
        let groups = self.groups.iter().map(group_report).collect::<Result<_, DrapeError>>()?;
        Ok(ValidationReport { groups })
    }
}
