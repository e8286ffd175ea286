//! Records of DiffusionNet's operators.

use super::{ArrayCache, CacheError, Key, KeyBuilder};
use clothcombo_physics::mesh::TriMesh;
use clothcombo_physics::operators::SurfaceOperators;

/// The key of a mesh: its positions and faces.
pub fn mesh_key(mesh: &TriMesh) -> Key {
    KeyBuilder::new("mesh").array(mesh.positions().as_flattened()).array(mesh.faces().as_flattened()).finish()
}

/// The key of the operators of a mesh with `eigen_count` eigenvectors.
pub fn operators_key(mesh: Key, eigen_count: usize) -> Key {
    KeyBuilder::new("operators").key(mesh).number(eigen_count as u64).finish()
}

/// Stores operators.
///
/// # Errors
/// [`CacheError`] when the folder is full or cannot be written to.
pub fn put_operators(cache: &ArrayCache, key: Key, operators: &SurfaceOperators) -> Result<(), CacheError> {
    cache.put(
        key,
        &[
            ("mass", operators.mass.as_slice().into()),
            ("eigenvalues", operators.eigenvalues.as_slice().into()),
            ("eigenvectors", operators.eigenvectors.as_slice().into()),
            ("gradient_x_basis", operators.gradient_x_basis.as_slice().into()),
            ("gradient_y_basis", operators.gradient_y_basis.as_slice().into()),
        ],
    )
}

/// Reads operators; `None` if they are not stored.
pub fn get_operators(cache: &ArrayCache, key: Key) -> Option<SurfaceOperators> {
    cache.get(key, |record| {
        let mass = record.array("mass")?.to_vec();
        let eigenvalues = record.array("eigenvalues")?.to_vec();
        Ok(SurfaceOperators {
            vertex_count: mass.len(),
            eigen_count: eigenvalues.len(),
            mass,
            eigenvalues,
            eigenvectors: record.array("eigenvectors")?.to_vec(),
            gradient_x_basis: record.array("gradient_x_basis")?.to_vec(),
            gradient_y_basis: record.array("gradient_y_basis")?.to_vec(),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes;

    #[test]
    fn operators_come_back_bit_for_bit_and_any_change_of_the_mesh_is_another_key() {
        let mesh = shapes::irregular_grid(0.3, 0.5, 9, 14, 0.3, 3);
        let operators = SurfaceOperators::new(&mesh, 12).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let cache = ArrayCache::open(folder.path(), 1 << 24).unwrap();
        let key = operators_key(mesh_key(&mesh), 12);
        assert!(get_operators(&cache, key).is_none());
        put_operators(&cache, key, &operators).unwrap();
        assert_eq!(get_operators(&cache, key), Some(operators));

        let mut moved = mesh.positions().to_vec();
        moved[5][1] = moved[5][1].next_up();
        let moved = mesh.with_positions(moved).unwrap();
        assert_ne!(operators_key(mesh_key(&moved), 12), key);
        assert_ne!(operators_key(mesh_key(&mesh), 13), key);
    }
}
