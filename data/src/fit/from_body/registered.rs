//! From a mesh of a person to the zero body, once the target's model is registered to it.

use super::icp::Similarity;
use super::same_model::SameModel;
use super::{Cloth, gaps, gaps_to};
use crate::asset::Body;
use clothcombo_physics::Surface;
use std::sync::Arc;

/// A mesh of a person, and the target's model in its shape and pose.
pub(super) struct Registered {
    /// The mesh (m), y up.
    pub positions: Vec<[f64; 3]>,
    pub faces: Arc<[[u32; 3]]>,
    /// From there to the model.
    pub motion: Similarity,
    pub model: SameModel,
    /// Shape of the model.
    pub shape: Vec<f64>,
    /// Median distance of the surfaces (mm).
    pub alignment_mm: f64,
}

/// A garment at rest on the zero body, with and without its distances to the skin restored (m).
pub(super) struct CarriedCloth {
    pub positions: Vec<[f64; 3]>,
    /// Where the registration alone puts it.
    pub unrestored: Vec<[f64; 3]>,
}

impl Registered {
    /// The surface on which the garment was made (m).
    pub fn surface(&self) -> (Vec<[f64; 3]>, Arc<[[u32; 3]]>) {
        (self.positions.clone(), self.faces.clone())
    }

    /// Carries cloth on `source`, its surface, to the zero body of `body`: by the registration, then by the distances
    /// to the skin, then back through pose and shape of the model.
    ///
    /// # Errors
    /// When no mesh is left, or the pose cannot be undone.
    pub fn carry(&self, cloth: &Cloth, source: &Surface<f64>, body: &Body) -> Result<CarriedCloth, String> {
        let rest = |positions: &[[f64; 3]]| self.model.carry(&Cloth { positions, ..*cloth }, body);
        let mut moved: Vec<[f64; 3]> = cloth.positions.iter().map(|p| self.motion.apply(*p)).collect();
        let unrestored = rest(&moved)?;
        let own: Vec<f64> =
            gaps_to(cloth.positions, source).into_iter().map(|gap| self.motion.scale * gap).collect();
        let (positions, faces) = self.model.surface(body);
        gaps::restore(&mut moved, cloth.faces, &own, &Surface::new(positions, faces));
        Ok(CarriedCloth { positions: rest(&moved)?, unrestored })
    }
}
