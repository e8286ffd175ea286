//! Records of garments bound to a body: the rest mesh, its skin weights and shape displacements.

use super::{ArrayCache, CacheError, Key, KeyBuilder};
use crate::asset::{Binding, BindingSettings, Body, Category};
use clothcombo_physics::mesh::TriMesh;

/// The key of everything about a body that a binding looks at.
pub fn body_key(body: &Body) -> Key {
    let mut key = KeyBuilder::new("body")
        .array(body.template.as_flattened())
        .array(body.faces.as_flattened())
        .array(&body.shape_directions)
        .number(body.shape_count as u64);
    for name in &body.joint_names {
        key = key.text(name);
    }
    for vertex in 0..body.vertex_count() {
        let (joints, weights) = body.skin_weights.row(vertex);
        key = key.array(joints).array(weights);
    }
    key.finish()
}

/// The key of a mesh of `category` bound to a body with `settings`.
pub fn binding_key(mesh: Key, body: Key, category: Category, settings: &BindingSettings) -> Key {
    let BindingSettings { smoothing_iterations, skirt_smoothing_iterations, smooth, shape_transfer } =
        *settings;
    // The number changes with what a record holds: since 3 there are no shape displacements without shape transfer.
    KeyBuilder::new("binding 3")
        .key(mesh)
        .key(body)
        .text(category.name())
        .number(smoothing_iterations as u64)
        .number(skirt_smoothing_iterations as u64)
        .number(u64::from(smooth))
        .number(u64::from(shape_transfer))
        .finish()
}

/// Stores a mesh and its binding to a body of `joints` joints.
///
/// # Errors
/// [`CacheError`] when the folder is full or cannot be written to.
pub fn put_binding(
    cache: &ArrayCache,
    key: Key,
    rest: &TriMesh,
    binding: &Binding,
    joints: usize,
) -> Result<(), CacheError> {
    // Most columns (fingers, face) are zero: only those in use are stored.
    let largest = binding.largest_weights(joints);
    let used: Vec<u32> = (0..joints).filter(|&j| largest[j] > 0.0).map(|j| j as u32).collect();
    let columns = |row: &[f32]| used.iter().map(|&j| row[j as usize]).collect::<Vec<_>>();
    let weights: Vec<f32> = binding.skin_weights.chunks_exact(joints).flat_map(columns).collect();
    cache.put(
        key,
        &[
            ("positions", rest.positions().as_flattened().into()),
            ("faces", rest.faces().as_flattened().into()),
            ("joints", used.as_slice().into()),
            ("largest_weights", largest.as_slice().into()),
            ("skin_weights", weights.as_slice().into()),
            ("shape_directions", binding.shape_directions.as_slice().into()),
        ],
    )
}

/// Reads a mesh and its binding to a body of `joints` joints; `None` if they are not stored.
pub fn get_binding(cache: &ArrayCache, key: Key, joints: usize) -> Option<(TriMesh, Binding)> {
    let (positions, faces, used, weights, shape_directions) = cache.get(key, |record| {
        Ok((
            record.array("positions")?.as_chunks::<3>().0.to_vec(),
            record.array("faces")?.as_chunks::<3>().0.to_vec(),
            record.array::<u32>("joints")?.to_vec(),
            record.array::<f32>("skin_weights")?.to_vec(),
            record.array("shape_directions")?.to_vec(),
        ))
    })?;
    // The bytes are those that were stored, and the key holds the body: anything else is another program's record.
    if used.iter().any(|&j| j as usize >= joints)
        || weights.len() != positions.len() * used.len()
        || !shape_directions.len().is_multiple_of(3 * positions.len().max(1))
    {
        return None;
    }
    let mut skin_weights = vec![0.0; positions.len() * joints];
    for (row, stored) in skin_weights.chunks_exact_mut(joints).zip(weights.chunks_exact(used.len().max(1))) {
        used.iter().zip(stored).for_each(|(&j, w)| row[j as usize] = *w);
    }
    let rest = TriMesh::new(positions, faces).ok()?;
    Some((rest, Binding { skin_weights, shape_directions }))
}

/// The largest weight of every joint on a stored garment; `None` if it is not stored.
pub fn get_largest_weights(cache: &ArrayCache, key: Key) -> Option<Vec<f32>> {
    cache.get(key, |record| Ok(record.array("largest_weights")?.to_vec()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::garment::generated;
    use crate::generate::mannequin;

    #[test]
    fn a_bound_garment_comes_back_bit_for_bit() {
        let body = mannequin();
        let garment = generated(&body, Category::Top, 3, 400);
        let how = BindingSettings::default();
        let binding = Binding::new(&garment, &body, &how);
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 24).unwrap();
        let mesh = super::super::mesh_key(&garment.rest);
        let key = binding_key(mesh, body_key(&body), garment.category, &how);
        put_binding(&cache, key, &garment.rest, &binding, body.joint_count()).unwrap();
        let (rest, found) = get_binding(&cache, key, body.joint_count()).unwrap();
        assert_eq!((rest.positions(), rest.faces()), (garment.rest.positions(), garment.rest.faces()));
        assert_eq!(found, binding);
        assert_eq!(get_largest_weights(&cache, key), Some(binding.largest_weights(body.joint_count())));

        let plain = BindingSettings { smooth: false, ..how };
        assert_ne!(binding_key(mesh, body_key(&body), garment.category, &plain), key);
    }
}
