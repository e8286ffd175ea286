//! Rotations as axis-angle vectors, unit quaternions `[w, x, y, z]` and 3×3 matrices (row-major, column vectors).

use clothcombo_physics::transform::Transform;
use clothcombo_physics::vec3::{cross, dot, norm, norm_squared};

/// A 3×3 matrix, rows first.
pub type Matrix3 = [[f64; 3]; 3];

/// The identity matrix.
pub const IDENTITY: Matrix3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Rodrigues' formula: rotation by `|r|` radians about `r`.
pub fn matrix_from_axis_angle(r: [f64; 3]) -> Matrix3 {
    let angle_squared = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    // sin(a)/a and (1 - cos a)/a² by series near zero, where the quotients lose digits.
    let (s, c) = if angle_squared < 1e-8 {
        (1.0 - angle_squared / 6.0, 0.5 - angle_squared / 24.0)
    } else {
        let angle = angle_squared.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / angle_squared)
    };
    let k = [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]];
    let mut m = IDENTITY;
    for i in 0..3 {
        for j in 0..3 {
            let k2: f64 = (0..3).map(|l| k[i][l] * k[l][j]).sum();
            m[i][j] += s * k[i][j] + c * k2;
        }
    }
    m
}

/// The axis-angle vector of a rotation matrix, angle in `[0, π]`.
pub fn axis_angle_from_matrix(m: &Matrix3) -> [f64; 3] {
    axis_angle_from_quaternion(quaternion_from_matrix(m))
}

/// Unit quaternion of an axis-angle vector.
pub fn quaternion_from_axis_angle(r: [f64; 3]) -> [f64; 4] {
    let angle = (r[0] * r[0] + r[1] * r[1] + r[2] * r[2]).sqrt();
    let s = if angle < 1e-6 { 0.5 - angle * angle / 48.0 } else { (0.5 * angle).sin() / angle };
    [(0.5 * angle).cos(), s * r[0], s * r[1], s * r[2]]
}

/// Axis-angle vector of a quaternion (normalised here), angle in `[0, π]`.
pub fn axis_angle_from_quaternion(q: [f64; 4]) -> [f64; 3] {
    let q = normalized_quaternion(if q[0] < 0.0 { q.map(|x| -x) } else { q });
    let s = (q[1] * q[1] + q[2] * q[2] + q[3] * q[3]).sqrt();
    let scale = if s < 1e-9 { 2.0 } else { 2.0 * s.atan2(q[0]) / s };
    [scale * q[1], scale * q[2], scale * q[3]]
}

/// Unit quaternion of a rotation matrix (Shepperd's method: divides by the largest component).
fn quaternion_from_matrix(m: &Matrix3) -> [f64; 4] {
    let trace = m[0][0] + m[1][1] + m[2][2];
    let squares = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (0..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    let q = match largest {
        0 => [1.0 + trace, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        1 => [m[2][1] - m[1][2], 1.0 + 2.0 * m[0][0] - trace, m[0][1] + m[1][0], m[0][2] + m[2][0]],
        2 => [m[0][2] - m[2][0], m[0][1] + m[1][0], 1.0 + 2.0 * m[1][1] - trace, m[1][2] + m[2][1]],
        _ => [m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], 1.0 + 2.0 * m[2][2] - trace],
    };
    normalized_quaternion(q)
}

/// Hamilton product: first rotate by `b`, then by `a`.
pub fn quaternion_product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The inverse of a unit quaternion.
pub fn quaternion_conjugate(q: [f64; 4]) -> [f64; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

/// The quaternion scaled to length one; the identity for a zero quaternion.
pub fn normalized_quaternion(q: [f64; 4]) -> [f64; 4] {
    let n = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if n > 0.0 { q.map(|x| x / n) } else { [1.0, 0.0, 0.0, 0.0] }
}

/// Matrix product `a·b`.
pub fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    let mut m = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    m
}

/// The transpose, which is the inverse of a rotation.
pub fn transpose(m: &Matrix3) -> Matrix3 {
    [[m[0][0], m[1][0], m[2][0]], [m[0][1], m[1][1], m[2][1]], [m[0][2], m[1][2], m[2][2]]]
}

/// Matrix times vector.
pub fn apply(m: &Matrix3, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The motion with this rotation that carries point `from` to point `to`.
pub fn rigid_motion(rotation: &Matrix3, from: [f64; 3], to: [f64; 3]) -> Transform {
    let turned = apply(rotation, from);
    std::array::from_fn(|a| {
        let [x, y, z] = rotation[a];
        [x, y, z, to[a] - turned[a]]
    })
}

/// The smallest rotation that turns direction `from` into direction `to`; the identity if either is zero.
pub fn between(from: [f64; 3], to: [f64; 3]) -> Matrix3 {
    let across = cross(from, to);
    let length = (norm_squared(from) * norm_squared(to)).sqrt();
    if length == 0.0 {
        return IDENTITY;
    }
    let sine = norm(across) / length;
    let angle = sine.atan2(dot(from, to) / length);
    let axis = if sine > 1e-12 {
        across.map(|x| x / (sine * length))
    } else {
        // Opposite directions: any axis across `from` will do.
        let least = (0..3).fold(0, |best, i| if from[i].abs() < from[best].abs() { i } else { best });
        let mut e = [0.0; 3];
        e[least] = 1.0;
        let axis = cross(from, e);
        axis.map(|x| x / norm(axis))
    };
    matrix_from_axis_angle(axis.map(|x| x * angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, RngExt, SeedableRng};

    fn random_axis_angle(rng: &mut impl Rng, largest: f64) -> [f64; 3] {
        loop {
            let r: [f64; 3] = std::array::from_fn(|_| rng.random_range(-largest..largest));
            if r.iter().map(|x| x * x).sum::<f64>().sqrt() < largest {
                return r;
            }
        }
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn conversions_are_inverse_to_each_other() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for scale in [3.1, 1.0, 1e-3, 1e-9] {
            for _ in 0..200 {
                let r = random_axis_angle(&mut rng, scale);
                let m = matrix_from_axis_angle(r);
                assert!(distance(&axis_angle_from_matrix(&m), &r) < 1e-9 * scale.max(1e-3));
                assert!(
                    distance(&axis_angle_from_quaternion(quaternion_from_axis_angle(r)), &r)
                        < 1e-11 * scale.max(1e-3)
                );
                assert!(
                    distance(product(&m, &transpose(&m)).as_flattened(), IDENTITY.as_flattened()) < 1e-13
                );
            }
        }
    }

    #[test]
    fn half_turns_are_exact() {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8]] {
            let r = axis.map(|x| x * std::f64::consts::PI);
            let back = matrix_from_axis_angle(axis_angle_from_matrix(&matrix_from_axis_angle(r)));
            assert!(distance(back.as_flattened(), matrix_from_axis_angle(r).as_flattened()) < 1e-12);
        }
    }

    #[test]
    fn quaternion_product_matches_matrix_product() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        for _ in 0..100 {
            let (a, b) = (random_axis_angle(&mut rng, 3.0), random_axis_angle(&mut rng, 3.0));
            let q = quaternion_product(quaternion_from_axis_angle(a), quaternion_from_axis_angle(b));
            let m = product(&matrix_from_axis_angle(a), &matrix_from_axis_angle(b));
            let from_q = matrix_from_axis_angle(axis_angle_from_quaternion(q));
            assert!(distance(from_q.as_flattened(), m.as_flattened()) < 1e-12);
        }
    }

    #[test]
    fn between_turns_one_direction_into_the_other() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut pairs: Vec<([f64; 3], [f64; 3])> =
            (0..100).map(|_| (random_axis_angle(&mut rng, 2.0), random_axis_angle(&mut rng, 2.0))).collect();
        pairs.push(([0.3, -0.2, 0.9], [-0.3, 0.2, -0.9]));
        pairs.push(([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]));
        for (a, b) in pairs {
            let unit = |v: [f64; 3]| v.map(|x| x / v.iter().map(|x| x * x).sum::<f64>().sqrt());
            let turned = apply(&between(a, b), unit(a));
            assert!(distance(&turned, &unit(b)) < 1e-10, "{a:?} {b:?}");
        }
    }
}
