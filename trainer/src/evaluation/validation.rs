//! The fixed validation scenes, scored for every method.

use super::score::{SceneScore, method_score, score_scene};
use crate::config::{Config, LossesConfig};
use crate::dataset::GARMENTS_AT_ONCE;
use crate::dataset::{
    Dataset, DatasetError, PreparedScene, SceneSample, ValidationGroup, prepare, sample_validation,
};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use crate::run::validation::{GroupReport, Method, ValidationReport};
use rayon::prelude::*;

/// All validation scenes, as draws: they are prepared when they are scored, so that a large wardrobe need not be in memory.
pub struct ValidationSet {
    groups: Vec<(ValidationGroup, Vec<SceneSample>)>,
    losses: LossesConfig,
    shape_transfer: bool,
}

/// How many of these scenes are prepared at a time.
fn at_once(draws: &[SceneSample]) -> usize {
    let most = draws.iter().map(|draw| draw.garments.len()).max().unwrap_or(1);
    (GARMENTS_AT_ONCE / most.max(1)).max(1)
}

impl ValidationSet {
    /// Draws the scenes of `config`; losses have their final weights.
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
    pub fn draws(&self, group: ValidationGroup) -> &[SceneSample] {
        self.groups.iter().find(|(g, _)| *g == group).map_or(&[], |(_, draws)| draws)
    }

    /// Prepares a scene with the losses' final weights.
    ///
    /// # Errors
    /// When a garment cannot be read.
    pub fn prepare(&self, dataset: &Dataset, draw: &SceneSample) -> Result<PreparedScene, DatasetError> {
        prepare(dataset, &self.losses, draw.clone(), 1.0)
    }

    /// Scores skinning and `networks` on every scene.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn score(&self, dataset: &Dataset, networks: &Networks) -> Result<ValidationReport, DrapeError> {
        let groups = self.groups.iter().map(|(group, draws)| {
            let mut methods = vec![Method::StartSkinning];
            if self.shape_transfer {
                methods.insert(0, Method::RestSkinning);
            }
            if *group == ValidationGroup::Layered {
                methods.push(Method::Single);
            }
            methods.push(Method::Network);
            self.score_group(dataset, networks, *group, draws, &methods)
        });
        Ok(ValidationReport { groups: groups.collect::<Result<_, _>>()? })
    }

    fn score_group(
        &self,
        dataset: &Dataset,
        networks: &Networks,
        group: ValidationGroup,
        draws: &[SceneSample],
        methods: &[Method],
    ) -> Result<GroupReport, DrapeError> {
        let mut scores: Vec<Vec<SceneScore>> = vec![Vec::with_capacity(draws.len()); methods.len()];
        for chunk in draws.chunks(at_once(draws)) {
            let scenes: Vec<_> = chunk.par_iter().map(|draw| self.prepare(dataset, draw)).collect();
            for scene in scenes {
                let scene = scene?;
                let body = scene.exact_body();
                for (method, scores) in methods.iter().zip(&mut scores) {
                    let draped: &Draped = match method {
                        Method::RestSkinning => &networks.skin_rest(&scene)?,
                        Method::StartSkinning => &networks.skin(&scene)?,
                        Method::Single => &networks.drape_single_garments(&scene)?,
                        Method::Network => &networks.drape(&scene)?,
                    };
                    scores.push(score_scene(&scene, &body, draped));
                }
            }
        }
        let methods = methods.iter().zip(&scores).map(|(m, s)| method_score(m.name(), s)).collect();
        Ok(GroupReport { group: group.name(), scenes: draws.len(), methods })
    }
}
