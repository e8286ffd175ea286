//! The degree of self-collision of the paper's ablation study: "similar to the repulsive loss, but applied only to the
//! vertices where penetration occurs".

use crate::energy::{EnergySettings, repulsion::Repulsion};
use crate::mesh::Topology;

/// `(1/N) Σ −log d²` (d in metres) over unordered pairs of vertices that no edge joins, are closer than `radius` (m), and both
/// belong to triangles that intersect another triangle of the garment. N counts all vertices of the garment, as in the
/// repulsion; 0 without a self-intersection.
///
/// `pairs` are the intersecting ones of the `faces` of the garment at `positions` (m), `topology` is that of the garment.
pub fn self_collision(
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
    pairs: &[(u32, u32)],
    topology: &Topology,
    radius: f64,
) -> f64 {
    if pairs.is_empty() {
        return 0.0;
    }
    // A vertex that is not finite repels nothing.
    let mut penetrating = vec![[f64::NAN; 3]; positions.len()];
    for vertex in pairs.iter().flat_map(|&(a, b)| [a, b]).flat_map(|face| faces[face as usize]) {
        penetrating[vertex as usize] = positions[vertex as usize];
    }
    let settings = EnergySettings { repulsion_radius: radius, ..EnergySettings::default() };
    Repulsion::new(topology).evaluate(&penetrating, &settings, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;
    use crate::query::triangle_tree::self_triangle_pairs;

    /// Two triangles that pierce each other at right angles, and a third one beside them; no edge joins two of them.
    const POSITIONS: [[f64; 3]; 9] = [
        [0.0, 0.0, 0.0],
        [0.06, 0.0, 0.0],
        [0.0, 0.06, 0.0],
        [0.02, 0.02, -0.02],
        [0.02, 0.02, 0.03],
        [0.03, 0.01, 0.03],
        [0.0, 0.0, 0.05],
        [0.01, 0.0, 0.05],
        [0.0, 0.01, 0.05],
    ];
    const FACES: [[u32; 3]; 3] = [[0, 1, 2], [3, 4, 5], [6, 7, 8]];

    fn degree(positions: &[[f64; 3]]) -> (usize, f64) {
        let mesh = TriMesh::new(POSITIONS.to_vec(), FACES.to_vec()).unwrap();
        let pairs = self_triangle_pairs(positions, &FACES);
        (pairs.len(), self_collision(positions, &FACES, &pairs, &Topology::new(&mesh), 0.1))
    }

    #[test]
    fn pairs_of_penetrating_vertices_count_as_in_the_repulsion() {
        let (count, found) = degree(&POSITIONS);
        assert_eq!(count, 1);
        // Corners of one triangle are joined by edges; what is left are the nine pairs between the first two.
        let squared = |a: usize, b: usize| -> f64 {
            (0..3).map(|axis| (POSITIONS[a][axis] - POSITIONS[b][axis]).powi(2)).sum()
        };
        let pairs = (0..3).flat_map(|a| (3..6).map(move |b| squared(a, b)));
        let expected = pairs.filter(|d| *d < 0.01).map(|d| -d.ln()).sum::<f64>() / 9.0;
        assert!(expected > 3.0 && (found - expected).abs() < 1e-12 * expected, "{found} {expected}");
    }

    #[test]
    fn near_vertices_without_an_intersection_count_nothing() {
        // The second triangle is lifted off the first one: all nine vertices are still close to each other.
        let lifted = POSITIONS.map(|[x, y, z]| [x, y, if z < 0.0 { 0.01 } else { z }]);
        assert_eq!(degree(&lifted), (0, 0.0));
    }
}
