//! From a mesh of a person to the zero body, once both are registered.

use super::icp::Similarity;
use super::{Cloth, gaps, gaps_to};
use crate::asset::Body;
use crate::fit::arm_pose::ArmPose;
use clothcombo_physics::Surface;
use std::sync::Arc;

/// A mesh of a person, registered to the zero body with its arms lowered as the mesh holds them.
pub(super) struct Registered {
    /// The mesh (m), y up.
    pub positions: Vec<[f64; 3]>,
    pub faces: Arc<[[u32; 3]]>,
    /// From there to the target.
    pub motion: Similarity,
    pub arms: ArmPose,
    /// Median distance of the surfaces (mm).
    pub alignment_mm: f64,
}

impl Registered {
    /// The surface on which the garment was made (m).
    pub fn surface(&self) -> (Vec<[f64; 3]>, Arc<[[u32; 3]]>) {
        (self.positions.clone(), self.faces.clone())
    }

    /// Carries cloth on `source`, its surface, to the zero body of `body`: by the registration, then by the distances to the skin, then
    /// the arms up. Beside it the garment as the registration alone would have it.
    ///
    /// # Errors
    /// When no mesh is left, or the arms cannot be raised.
    #[allow(clippy::type_complexity)]
    pub fn carry(
        &self,
        cloth: &Cloth,
        source: &Surface<f64>,
        body: &Body,
    ) -> Result<(Vec<[f64; 3]>, Vec<[f64; 3]>), String> {
        let raised =
            |positions: &[[f64; 3]]| self.arms.to_t_pose(positions, cloth.faces, cloth.category, body);
        let mut moved: Vec<[f64; 3]> = cloth.positions.iter().map(|p| self.motion.apply(*p)).collect();
        let base = raised(&moved)?;
        let own = gaps_to(cloth.positions, source)
            .into_iter()
            .map(|gap| self.motion.scale * gap)
            .collect::<Vec<_>>();
        gaps::restore(&mut moved, cloth.faces, &own, &self.arms.surface);
        Ok((raised(&moved)?, base))
    }
}
