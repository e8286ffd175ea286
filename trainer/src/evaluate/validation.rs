//! The fixed validation scenes: prepared once, scored for every method.

use super::report::{GroupReport, MethodScore, ValidationReport};
use super::score::{Draped, SceneScore, score_scene};
use crate::config::Config;
use crate::drape::Networks;
use crate::scene::{Library, PreparedScene, ValidationGroup, draw_validation, prepare};
use clothcombo_model::ModelError;
use clothcombo_physics::query::Surface;
use rayon::prelude::*;

/// What is compared on a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Linear blend skinning of the rest garment, the paper's baseline: nothing learned, body shape ignored.
    RestSkinning,
    /// Linear blend skinning of the start state (with shape transfer): what the networks start from.
    StartSkinning,
    /// The networks without untangling: every garment alone.
    Single,
    /// All networks.
    Network,
}

impl Method {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::RestSkinning => "LBS of rest",
            Self::StartSkinning => "LBS",
            Self::Single => "single drape",
            Self::Network => "network",
        }
    }
}

/// A prepared scene and its body in f64, ready for exact distances.
struct ValidationScene {
    scene: PreparedScene,
    body: Surface<f64>,
}

/// All validation scenes.
pub struct ValidationSet {
    groups: Vec<(ValidationGroup, Vec<ValidationScene>)>,
    shape_transfer: bool,
}

impl ValidationSet {
    /// Draws and prepares the scenes of `config`; losses have their final weights.
    pub fn new(library: &Library, config: &Config) -> Self {
        let prepared = |group| {
            draw_validation(library, config.seed, &config.validation, group)
                .into_par_iter()
                .map(|draw| {
                    let scene = prepare(library, &config.losses, draw, 1.0);
                    let body = &scene.bodies[0].energy.body;
                    let positions = body.positions.iter().map(|p| p.map(f64::from)).collect();
                    let body = Surface::new(positions, body.faces.clone());
                    ValidationScene { scene, body }
                })
                .collect::<Vec<_>>()
        };
        let groups = ValidationGroup::ALL.map(|group| (group, prepared(group)));
        Self {
            groups: groups.into_iter().filter(|(_, scenes)| !scenes.is_empty()).collect(),
            shape_transfer: config.start.shape_transfer,
        }
    }

    /// The scenes of `group`.
    pub fn scenes(&self, group: ValidationGroup) -> Vec<&PreparedScene> {
        let of_group = self.groups.iter().filter(|(g, _)| *g == group);
        of_group.flat_map(|(_, scenes)| scenes.iter().map(|s| &s.scene)).collect()
    }

    /// Scores skinning and `networks` on every scene.
    ///
    /// # Errors
    /// When a scene cannot be draped.
    pub fn score(&self, library: &Library, networks: &Networks) -> Result<ValidationReport, ModelError> {
        let groups = self.groups.iter().map(|(group, scenes)| {
            let mut methods = vec![Method::StartSkinning];
            if self.shape_transfer {
                methods.insert(0, Method::RestSkinning);
            }
            if *group == ValidationGroup::Layered {
                methods.push(Method::Single);
            }
            methods.push(Method::Network);
            score_group(library, networks, *group, scenes, &methods)
        });
        Ok(ValidationReport { groups: groups.collect::<Result<_, _>>()? })
    }
}

fn score_group(
    library: &Library,
    networks: &Networks,
    group: ValidationGroup,
    scenes: &[ValidationScene],
    methods: &[Method],
) -> Result<GroupReport, ModelError> {
    let mut scores: Vec<Vec<SceneScore>> = vec![Vec::with_capacity(scenes.len()); methods.len()];
    for ValidationScene { scene, body } in scenes {
        let network = networks.drape(scene)?;
        for (method, scores) in methods.iter().zip(&mut scores) {
            let draped: &Draped = match method {
                Method::RestSkinning => &networks.skin_rest(scene)?,
                Method::StartSkinning => &networks.skin(scene)?,
                Method::Single => &network.single,
                Method::Network => &network.layered,
            };
            scores.push(score_scene(library, scene, body, draped));
        }
    }
    let methods = methods.iter().zip(&scores).map(|(m, s)| MethodScore::new(m.name(), s)).collect();
    Ok(GroupReport { group: group.name(), scenes: scenes.len(), methods })
}
