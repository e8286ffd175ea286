//! From a body of another model: joint by joint, then by the distances to the skin.

use super::bones::{Skeleton, similarities};
use super::source::SourceModel;
use super::{Cloth, bound, gaps, gaps_to, median, one_shape_body};
use crate::asset::Body;
use crate::asset::body::skin;
use clothcombo_physics::Surface;
use std::sync::Arc;

/// Another model in T-pose, and the way of its bones to the target's.
pub(super) struct OtherModel {
    /// Without shapes; its template is the shaped body.
    body: Body,
    bones: Vec<[[f64; 4]; 3]>,
}

impl OtherModel {
    /// # Errors
    /// When the joints cannot be matched.
    pub fn new(model: &SourceModel, target: &Body) -> Result<Self, String> {
        let body = one_shape_body(&model.body, model.positions.clone(), model.joints.clone(), None)?;
        let bones = similarities(&Skeleton::of(&body), &Skeleton::of(target))?;
        Ok(Self { body, bones })
    }

    /// The surface on which the garment was made (m).
    pub fn surface(&self) -> (Vec<[f64; 3]>, Arc<[[u32; 3]]>) {
        (self.body.template.clone(), self.body.faces.clone())
    }

    /// Carries cloth on `source`, its surface, to the zero body of `target`; and the median distance of the surfaces
    /// after the bones were matched (mm).
    ///
    /// # Errors
    /// When no mesh is left.
    pub fn carry(
        &self,
        cloth: &Cloth,
        source: &Surface<f64>,
        target: &Body,
    ) -> Result<(Vec<[f64; 3]>, f64), String> {
        let surface = Surface::from_mesh(&target.zero_body());
        let skinned: Vec<[f64; 3]> = (0..self.body.vertex_count())
            .map(|v| {
                let (joints, weights) = self.body.skin_weights.row(v);
                let bones =
                    joints.iter().zip(weights).map(|(j, w)| (&self.bones[usize::from(*j)], f64::from(*w)));
                skin(self.body.template[v], bones)
            })
            .collect();
        let mut distances: Vec<f64> = gaps_to(&skinned, &surface).into_iter().map(f64::abs).collect();
        let binding = bound(cloth, cloth.positions.to_vec(), &self.body, target)?;
        let mut carried = binding.skinned(cloth.positions, &self.bones);
        gaps::restore(&mut carried, cloth.faces, &gaps_to(cloth.positions, source), &surface);
        Ok((carried, 1e3 * median(&mut distances)))
    }
}
