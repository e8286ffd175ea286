//! Linear blend skinning of one point, and its inverse.

use clothcombo_physics::transform::{Transform, apply};
use clothcombo_physics::vec3::cross;

/// Weighted sum of bone transforms applied to `p`.
pub fn skin<'a>(p: [f64; 3], bones: impl Iterator<Item = (&'a Transform, f64)>) -> [f64; 3] {
    apply(&blend(bones), p)
}

/// The point that [`skin`] with these bones carries to `p`; `None` if they flatten space there.
pub fn unskin<'a>(p: [f64; 3], bones: impl Iterator<Item = (&'a Transform, f64)>) -> Option<[f64; 3]> {
    let m = blend(bones);
    let row = |a: usize| [m[a][0], m[a][1], m[a][2]];
    // The columns of the adjugate are the cross products of the rows.
    let columns = [cross(row(1), row(2)), cross(row(2), row(0)), cross(row(0), row(1))];
    let determinant: f64 = (0..3).map(|a| m[0][a] * columns[0][a]).sum();
    let q: [f64; 3] = std::array::from_fn(|a| p[a] - m[a][3]);
    (determinant.abs() > 1e-9)
        .then(|| std::array::from_fn(|a| (0..3).map(|b| columns[b][a] * q[b]).sum::<f64>() / determinant))
}

fn blend<'a>(bones: impl Iterator<Item = (&'a Transform, f64)>) -> Transform {
    let mut blended = [[0.0; 4]; 3];
    for (bone, w) in bones {
        for a in 0..3 {
            for b in 0..4 {
                blended[a][b] += w * bone[a][b];
            }
        }
    }
    blended
}
