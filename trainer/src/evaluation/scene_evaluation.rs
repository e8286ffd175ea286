//! The loop of every evaluation: prepare a scene, drape it by several methods, measure the drapes.

use crate::dataset::{DatasetError, GARMENTS_AT_ONCE, PreparedScene, SceneSample};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::tensor_store::DrapeError;
use crate::run::validation::Method;
use rayon::prelude::*;

/// What `measure` finds on every scene. Scenes are prepared a few at a time, so that a large dataset need not be in memory.
///
/// # Errors
/// When a garment cannot be read, or the first error of `drape`.
pub fn evaluate<M: Send>(
    samples: &[SceneSample],
    prepare: impl Fn(&SceneSample) -> Result<PreparedScene, DatasetError> + Sync,
    mut drape: impl FnMut(&PreparedScene) -> Result<Vec<Draped>, DrapeError>,
    measure: impl Fn(&PreparedScene, &[Draped]) -> M + Sync,
) -> Result<Vec<M>, DrapeError> {
    let most = samples.iter().map(|sample| sample.garments.len()).max().unwrap_or(1);
    let mut measured = Vec::with_capacity(samples.len());
    for chunk in samples.chunks((GARMENTS_AT_ONCE / most.max(1)).max(1)) {
        let scenes: Vec<_> = chunk.par_iter().map(&prepare).collect();
        let scenes = scenes.into_iter().collect::<Result<Vec<_>, _>>()?;
        let drapes = scenes.iter().map(&mut drape).collect::<Result<Vec<_>, _>>()?;
        measured.par_extend(scenes.par_iter().zip(&drapes).map(|(scene, drapes)| measure(scene, drapes)));
    }
    Ok(measured)
}

/// The drapes of `scene` by `methods`.
///
/// # Errors
/// When a garment cannot be read, or the scene's numbers are not finite.
pub fn drape_by(
    networks: &Networks<'_>,
    methods: &[Method],
    scene: &PreparedScene,
) -> Result<Vec<Draped>, DrapeError> {
    let drape = |method: &Method| match method {
        Method::Lbs => networks.skin_rest(scene),
        Method::LbsWithShapeTransfer => networks.skin(scene),
        Method::SingleGarments => networks.drape_single_garments(scene),
        Method::Network => networks.drape(scene),
    };
    methods.iter().map(drape).collect()
}
