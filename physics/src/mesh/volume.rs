//! Closed surfaces and what they enclose.

use super::TriMesh;
use crate::vec3::{cross, dot, sub};

/// Whether every edge has two faces, or another even number.
pub fn is_closed(faces: &[[u32; 3]]) -> bool {
    let mut edges: Vec<[u32; 2]> = faces
        .iter()
        .flat_map(|f| (0..3).map(|k| [f[k].min(f[(k + 1) % 3]), f[k].max(f[(k + 1) % 3])]))
        .collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
}

/// Volume that a closed surface encloses (m³): negative if its faces look inwards.
pub fn signed_volume(mesh: &TriMesh) -> f64 {
    // Near the surface, so that little cancels.
    let origin = mesh.bounds().0;
    let six_fold = |face: usize| {
        let [a, b, c] = mesh.corners(face).map(|p| sub(p, origin));
        dot(a, cross(b, c))
    };
    (0..mesh.face_count()).map(six_fold).sum::<f64>() / 6.0
}

/// Whether `mesh` is closed and its faces, as a whole, look inwards. One that is not closed has no inside.
pub fn is_inside_out(mesh: &TriMesh) -> bool {
    is_closed(mesh.faces()) && signed_volume(mesh) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_ball_encloses_its_volume_and_inside_out_the_negative_of_it() {
        let ball = shapes::mapped(&shapes::icosphere(0.5, 5), |p| [p[0] + 9.0, p[1], p[2] - 7.0]);
        let expected = std::f64::consts::PI / 6.0;
        assert!(is_closed(ball.faces()));
        assert!((signed_volume(&ball) / expected - 1.0).abs() < 2e-3);
        assert!((signed_volume(&ball.turned()) + signed_volume(&ball)).abs() < 1e-12);
        assert!(!is_inside_out(&ball) && is_inside_out(&ball.turned()));
        assert!(
            !is_inside_out(&shapes::tube(0.1, 0.1, 8, 2))
                && !is_inside_out(&shapes::tube(0.1, 0.1, 8, 2).turned())
        );
        assert!(!is_closed(&ball.faces()[1..]) && !is_closed(shapes::tube(0.1, 0.1, 8, 2).faces()));
    }
}
