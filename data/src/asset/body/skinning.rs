//! Linear blend skinning of one point, and its inverse.

/// Weighted sum of bone transforms applied to `p`.
pub fn skin<'a>(p: [f64; 3], bones: impl Iterator<Item = (&'a [[f64; 4]; 3], f64)>) -> [f64; 3] {
    transform(&blend(bones), p)
}

/// The point that [`skin`] with these bones carries to `p`; `None` if they flatten space there.
pub fn unskin<'a>(p: [f64; 3], bones: impl Iterator<Item = (&'a [[f64; 4]; 3], f64)>) -> Option<[f64; 3]> {
    let m = blend(bones);
    let row = |a: usize| [m[a][0], m[a][1], m[a][2]];
    let cross = |u: [f64; 3], v: [f64; 3]| {
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    };
    // The columns of the adjugate are the cross products of the rows.
    let columns = [cross(row(1), row(2)), cross(row(2), row(0)), cross(row(0), row(1))];
    let determinant: f64 = (0..3).map(|a| m[0][a] * columns[0][a]).sum();
    let q: [f64; 3] = std::array::from_fn(|a| p[a] - m[a][3]);
    (determinant.abs() > 1e-9)
        .then(|| std::array::from_fn(|a| (0..3).map(|b| columns[b][a] * q[b]).sum::<f64>() / determinant))
}

fn blend<'a>(bones: impl Iterator<Item = (&'a [[f64; 4]; 3], f64)>) -> [[f64; 4]; 3] {
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

/// A 3×4 affine transform applied to a point.
pub fn transform(m: &[[f64; 4]; 3], p: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
}
