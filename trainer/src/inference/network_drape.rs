//! An outfit on one body, skinned and draped by the networks, brought to where the body stands.

use super::bodies::{BodyState, check_body_mesh};
use super::drape::round;
use super::draper::Draper;
use super::networks::drape_on;
use super::on_body::OnBody;
use super::outfit::Outfit;
use super::phase_times::{PhaseTimes, elapsed};
use super::tensor_store::body_tensors;
use crate::dataset::{BodySample, PreparedScene, SceneSample};
use clothcombo_data::asset::rotation::{Matrix3, apply, matrix_from_axis_angle};
use clothcombo_model::Mode;
use clothcombo_physics::contact::resolve::PathSample;
use clothcombo_physics::query::Surface;
use clothcombo_physics::transform::Transform;
use clothcombo_physics::vec3::add;
use miette::{IntoDiagnostic, Report};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// An outfit skinned on one body; garments packed inner → outer.
pub(super) struct SkinnedOutfit {
    /// The scene that networks see: the body facing +z, at the origin.
    pub scene: PreparedScene,
    /// The body where it stands.
    pub surface: Arc<Surface<f64>>,
    /// Where it faces: angle about the vertical from +z towards +x (radians).
    pub heading: f64,
    /// Turns the scene to face there.
    turn: Matrix3,
    /// Blended skinning transform of every vertex, canonical → posed.
    pub transforms: Vec<Transform>,
    /// Linear blend skinning of the start state (m).
    pub skinned: Vec<[f64; 3]>,
}

impl SkinnedOutfit {
    /// A sample of the continuation path from the T-pose.
    pub fn sample(&self, outfit: &Outfit) -> PathSample {
        self.sample_of(outfit, &self.skinned)
    }

    fn sample_of(&self, outfit: &Outfit, packed: &[[f64; 3]]) -> PathSample {
        PathSample {
            body: self.surface.clone(),
            draped: outfit.to_parts(packed),
            transforms: self.transforms.clone(),
        }
    }
}

/// An outfit on one body before any post-process; garments packed inner → outer.
pub(super) struct NetworkDrape {
    /// The outfit before the networks.
    pub start: SkinnedOutfit,
    /// Positions after the networks (m).
    pub network: Vec<[f64; 3]>,
    /// Time for the body and the networks (ms).
    pub milliseconds: PhaseTimes,
}

impl NetworkDrape {
    /// A sample of the continuation path from one frame of a motion to the next.
    pub fn sample(&self, outfit: &Outfit) -> PathSample {
        self.start.sample_of(outfit, &self.network)
    }
}

impl Draper {
    /// Poses the body and skins `outfit` on it.
    pub(super) fn skinned_outfit(&self, outfit: &Outfit, body: &BodyState) -> Result<SkinnedOutfit, Report> {
        let (shape, posed) = self.posed(body)?;
        let mut surface = match &body.surface {
            Some(given) => {
                check_body_mesh(self.body(), "the posed body", given)?;
                given.clone()
            }
            None => posed.positions.iter().map(|p| add(*p, body.place)).collect(),
        };
        round(&mut surface);
        let surface = Arc::new(Surface::new(surface, self.body().faces.clone()));
        let (facing, heading) = body.pose.without_heading();
        let (facing, yaw) = match self.trained.config.data.poses.remove_heading {
            true => (facing, heading),
            false => (body.pose.clone(), 0.0),
        };
        let scene = self.scene(outfit, BodySample { shape, pose: facing });
        // The body may be turned about the vertical: the scene turns with it.
        let turn = matrix_from_axis_angle([0.0, yaw, 0.0]);
        let transforms: Vec<Transform> =
            scene.skinning_transforms().iter().map(|t| turned(&turn, t, body.place)).collect();
        let skinned = scene.skinned_start(&transforms);
        Ok(SkinnedOutfit { scene, surface, heading, turn, transforms, skinned })
    }

    /// Poses the body and lets the networks drape `outfit` on it.
    pub(super) fn network_drape(&self, outfit: &Outfit, body: &BodyState) -> Result<NetworkDrape, Report> {
        let clock = Instant::now();
        let start = self.skinned_outfit(outfit, body)?;
        let scene = &start.scene;
        let (tensors, start_tensor) =
            body_tensors(&scene.bodies[0], &self.dimensions(), &self.settings.device).into_diagnostic()?;
        let posing = elapsed(clock);

        let (outfit_tensors, embeddings) = (&outfit.tensors, &outfit.embeddings);
        let on_body =
            OnBody { scene, outfit: outfit_tensors, embeddings, body: &tensors, start: start_tensor };
        let (draped, times) = drape_on(&self.model, &on_body, Mode::Layered);

        let turned = |p: &[f32; 3]| add(apply(&start.turn, p.map(f64::from)), body.place);
        let network: Vec<[f64; 3]> = draped.posed.iter().map(turned).collect();
        outfit.check_finite(&network)?;
        let ms = |time: Duration| 1e3 * time.as_secs_f64();
        let milliseconds = PhaseTimes {
            posing,
            networks: ms(times.forward),
            acceptance: ms(times.acceptance),
            ..PhaseTimes::default()
        };
        Ok(NetworkDrape { start, network, milliseconds })
    }

    fn scene(&self, outfit: &Outfit, body: BodySample) -> PreparedScene {
        let shape = body.shape.clone();
        let sample = SceneSample {
            garments: (0..outfit.garments.len()).collect(),
            below: Vec::new(),
            bodies: vec![body],
            repulsion_sample: 0,
        };
        let mut scene = self.scene_builder().build(sample, &outfit.arrangement, 1.0);
        let seen = self.shape_space.seen(self.body(), &shape, self.trained.state.shape_count);
        scene.bodies[0].shape = seen.into_iter().map(|b| b as f32).collect();
        scene
    }
}

/// `turn` after `transform`, then a move to `place`.
fn turned(turn: &Matrix3, transform: &Transform, place: [f64; 3]) -> Transform {
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let value: f64 = (0..3).map(|k| turn[r][k] * transform[k][c]).sum();
            if c == 3 { value + place[r] } else { value }
        })
    })
}
