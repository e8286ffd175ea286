//! Whether garments are draped together or each alone.

use crate::dataset::PreparedScene;
use clothcombo_model::Mode;
use clothcombo_physics::energy::SceneEnergy;

/// Whether the garments of a scene interact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerInteraction {
    /// Every garment is draped as a single garment.
    SingleGarments,
    /// All garments are draped together.
    Together,
}

impl LayerInteraction {
    /// How far the forward pass goes.
    pub fn mode(self) -> Mode {
        match self {
            Self::SingleGarments => Mode::Single,
            Self::Together => Mode::Layered,
        }
    }

    /// The energy of `scene` on its first body, with the layer losses of the pairs that interact.
    pub fn energy(self, scene: &PreparedScene) -> SceneEnergy<f32> {
        let energy = &scene.bodies[0].energy;
        match self {
            Self::SingleGarments => energy.without_layers(),
            Self::Together => (**energy).clone(),
        }
    }
}
