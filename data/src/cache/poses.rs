//! Records of poses of the body joints.

use super::{ArrayCache, CacheError, Key};
use crate::asset::{BODY_JOINT_COUNT, Pose};

/// Stores poses of the body joints.
///
/// # Errors
/// [`CacheError`] when the folder is full or cannot be written to.
pub fn put_poses(cache: &ArrayCache, key: Key, poses: &[Pose]) -> Result<(), CacheError> {
    let rotations: Vec<f64> =
        poses.iter().flat_map(|pose| (0..BODY_JOINT_COUNT).flat_map(|joint| pose.rotation(joint))).collect();
    cache.put(key, &[("rotations", rotations.as_slice().into())])
}

/// Reads poses; `None` if they are not stored.
pub fn get_poses(cache: &ArrayCache, key: Key) -> Option<Vec<Pose>> {
    let rotations = cache.get(key, |record| Ok(record.array::<f64>("rotations")?.to_vec()))?;
    let joints = rotations.as_chunks::<3>().0;
    Some(joints.chunks_exact(BODY_JOINT_COUNT).map(|joints| Pose { rotations: joints.to_vec() }).collect())
}
