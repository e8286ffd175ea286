//! Shape and pose of a body from a posed mesh of its vertices and the same body in T-pose.
//!
//! The shape is the linear least-squares solution on the T-pose, or on the posed mesh in turns with the pose where
//! there is none. The bones are found by block coordinate descent on the distance to linear blend skinning: one bone
//! after the other gets the rotation and translation that fit best what the others leave of its vertices. The rotation
//! of a covariance is taken by the iteration of Müller, Bender, Chentanez and Macklin, "A robust method to extract the
//! rotational part of deformations" (MIG 2016).

use super::body::{Body, BodyError};
use super::normal_equations::NormalEquations;
use super::pose::Pose;
use super::rotation::{
    Matrix3, axis_angle_from_matrix, matrix_from_axis_angle, product, rigid_motion, transpose,
};
use clothcombo_physics::transform::{self, Transform};
use clothcombo_physics::vec3::{add, add_scaled, cross, dot, norm, scale, sub};

/// A mesh whose vertices are farther from the recovered body than this on average is no pose of it (m).
const LARGEST_MEAN_DISTANCE: f64 = 0.03;
/// Rounds over all bones.
const BONE_ROUNDS: usize = 30;
/// Rounds of pose and shape where the shape is not known.
const POSED_SHAPE_ROUNDS: usize = 6;
/// Bones have no say on vertices they carry less of than this.
const LEAST_WEIGHT: f64 = 0.05;
/// Weight of small shape numbers against close vertices (m²): decides only what the vertices leave open.
const RIDGE: f64 = 1e-7;

/// A body recovered from its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct RecoveredBody {
    /// Shape parameters β `[K]`.
    pub shape: Vec<f64>,
    /// Pose θ `[J]`.
    pub pose: Pose,
    /// Where its pelvis stands (m).
    pub place: [f64; 3],
    /// Mean distance of the recovered vertices to the given ones (m).
    pub mean_distance: f64,
}

/// What is known of the shape of a body.
#[derive(Clone, Copy, Debug)]
pub enum KnownShape<'a> {
    /// The body in T-pose `[V, 3]` (m), anywhere.
    TPose(&'a [[f64; 3]]),
    /// Its shape parameters β.
    Parameters(&'a [f64]),
    /// Nothing: found from the posed mesh, in turns with the pose.
    Unknown,
}

/// Recovers shape and pose from `posed` `[V, 3]` (m).
///
/// # Errors
/// [`BodyError`] if a mesh is not of this body's vertices, or no pose of the body.
pub fn recover_body(body: &Body, known: KnownShape, posed: &[[f64; 3]]) -> Result<RecoveredBody, BodyError> {
    check(body, "posed", posed)?;
    let shape = match known {
        KnownShape::TPose(rest) => {
            check(body, "T-pose", rest)?;
            fitted_shape(body, rest)
        }
        KnownShape::Parameters(shape) => shape.to_vec(),
        KnownShape::Unknown => shape_of_posed(body, posed)?,
    };
    let pose = fitted_pose(body, &shape, posed)?;
    let model = body.posed(&shape, &pose)?.positions;
    let count = model.len().max(1) as f64;
    let sum = posed.iter().zip(&model).fold([0.0; 3], |sum, (p, m)| add(sum, sub(*p, *m)));
    let place = scale(sum, 1.0 / count);
    let distances = posed.iter().zip(&model).map(|(p, m)| norm(sub(sub(*p, *m), place)));
    let mean_distance = distances.sum::<f64>() / count;
    match mean_distance <= LARGEST_MEAN_DISTANCE {
        true => Ok(RecoveredBody { shape, pose, place, mean_distance }),
        false => Err(BodyError(format!(
            "no pose of body '{}' comes near it: the vertices stay {:.0} mm away on average",
            body.name,
            1e3 * mean_distance
        ))),
    }
}

fn check(body: &Body, which: &str, positions: &[[f64; 3]]) -> Result<(), BodyError> {
    let (found, expected) = (positions.len(), body.vertex_count());
    if found != expected {
        let body = &body.name;
        return Err(BodyError(format!(
            "the {which} mesh has {found} vertices, body '{body}' has {expected}"
        )));
    }
    match positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(vertex) => Err(BodyError(format!("vertex {vertex} of the {which} mesh is not finite"))),
        None => Ok(()),
    }
}

fn fitted_pose(body: &Body, shape: &[f64], posed: &[[f64; 3]]) -> Result<Pose, BodyError> {
    let bones = fitted_bones(body, &body.shaped(shape)?.positions, posed);
    let local = |j: usize| match body.parents[j] {
        Some(parent) => product(&transpose(&rotation(&bones[parent])), &rotation(&bones[j])),
        None => rotation(&bones[j]),
    };
    Ok(Pose { rotations: (0..body.joint_count()).map(|j| axis_angle_from_matrix(&local(j))).collect() })
}

fn rotation(bone: &Transform) -> Matrix3 {
    bone.map(|[x, y, z, _]| [x, y, z])
}

/// The shape of a posed mesh. For given rotations the posed vertices are linear in the shape: pose and shape are fitted in turns.
fn shape_of_posed(body: &Body, posed: &[[f64; 3]]) -> Result<Vec<f64>, BodyError> {
    let k = body.shape_count;
    let mut shape = vec![0.0; k];
    for _ in 0..if k == 0 { 0 } else { POSED_SHAPE_ROUNDS } {
        let pose = fitted_pose(body, &shape, posed)?;
        let start = body.posed(&[], &pose)?.positions;
        let mut directions = vec![0f32; 3 * k * start.len()];
        for component in 0..k {
            let mut unit = vec![0.0; k];
            unit[component] = 1.0;
            let moved = body.posed(&unit, &pose)?.positions;
            for (i, (m, s)) in moved.as_flattened().iter().zip(start.as_flattened()).enumerate() {
                directions[i * k + component] = (m - s) as f32;
            }
        }
        shape = linear_shape(&start, &directions, k, posed);
    }
    Ok(shape)
}

/// The shape whose body lies closest to `rest`, wherever that stands.
fn fitted_shape(body: &Body, rest: &[[f64; 3]]) -> Vec<f64> {
    linear_shape(&body.template, &body.shape_directions, body.shape_count, rest)
}

/// The k shape numbers for which `template` plus `directions` `[V × 3 × k]` lies closest to `rest`, wherever that stands.
fn linear_shape(template: &[[f64; 3]], directions: &[f32], k: usize, rest: &[[f64; 3]]) -> Vec<f64> {
    if k == 0 {
        return Vec::new();
    }
    // Unknowns: K shape numbers and a translation. Rows: coordinates.
    let mut equations = NormalEquations::new(k + 3);
    let mut row = vec![0.0; k + 3];
    for (v, (p, t)) in rest.iter().zip(template).enumerate() {
        for a in 0..3 {
            let of_coordinate = &directions[(3 * v + a) * k..(3 * v + a + 1) * k];
            row[..k].iter_mut().zip(of_coordinate).for_each(|(r, d)| *r = f64::from(*d));
            (0..3).for_each(|b| row[k + b] = if a == b { 1.0 } else { 0.0 });
            equations.add(&row, p[a] - t[a]);
        }
    }
    let mut solution = equations.solution(|_| RIDGE).unwrap_or_else(|| vec![0.0; k]);
    solution.truncate(k);
    solution
}

/// Bones of linear blend skinning that carry `shaped` closest to `posed`.
fn fitted_bones(body: &Body, shaped: &[[f64; 3]], posed: &[[f64; 3]]) -> Vec<Transform> {
    let mut vertices: Vec<Vec<(usize, f64)>> = vec![Vec::new(); body.joint_count()];
    for v in 0..shaped.len() {
        for (j, w) in body.skin_weights.of_vertex(v).filter(|(_, w)| f64::from(*w) > LEAST_WEIGHT) {
            vertices[j].push((v, f64::from(w)));
        }
    }
    let mut bones: Vec<Transform> = Vec::with_capacity(body.joint_count());
    for j in 0..body.joint_count() {
        let parent = body.parents[j].map_or(transform::IDENTITY, |p| bones[p]);
        let mostly = vertices[j].iter().map(|&(v, w)| (shaped[v], posed[v], w.powi(4)));
        bones.push(closest_motion(mostly, &parent));
    }
    let mut skinned: Vec<[f64; 3]> = vec![[0.0; 3]; shaped.len()];
    for (v, s) in skinned.iter_mut().enumerate() {
        for (j, w) in body.skin_weights.of_vertex(v) {
            *s = add_scaled(*s, f64::from(w), transform::apply(&bones[j], shaped[v]));
        }
    }
    for _ in 0..BONE_ROUNDS {
        for j in 0..bones.len() {
            if vertices[j].is_empty() {
                // Nothing shows how it is turned: it goes with its parent.
                if let Some(parent) = body.parents[j] {
                    bones[j] = bones[parent];
                }
                continue;
            }
            let old = bones[j];
            // What the other bones leave, as if this one carried the vertex alone.
            let wanted = vertices[j].iter().map(|&(v, w)| {
                let own = transform::apply(&old, shaped[v]);
                (shaped[v], add_scaled(own, 1.0 / w, sub(posed[v], skinned[v])), w * w)
            });
            let new = closest_motion(wanted, &old);
            for &(v, w) in &vertices[j] {
                let [now, before] = [new, old].map(|bone| transform::apply(&bone, shaped[v]));
                let moved = sub(now, before);
                skinned[v] = add_scaled(skinned[v], w, moved);
            }
            bones[j] = new;
        }
    }
    bones
}

/// The rigid motion that carries weighted (from, to) points closest; `start` without points.
fn closest_motion(
    points: impl Iterator<Item = ([f64; 3], [f64; 3], f64)> + Clone,
    start: &Transform,
) -> Transform {
    let mut total = 0.0;
    let (mut from, mut to) = ([0.0; 3], [0.0; 3]);
    for (p, q, w) in points.clone() {
        total += w;
        from = add_scaled(from, w, p);
        to = add_scaled(to, w, q);
    }
    if total <= 0.0 {
        return *start;
    }
    (from, to) = (scale(from, 1.0 / total), scale(to, 1.0 / total));
    let mut covariance = [[0.0; 3]; 3];
    for (p, q, w) in points {
        let (p, q) = (sub(p, from), sub(q, to));
        for r in 0..3 {
            for c in 0..3 {
                covariance[r][c] += w * q[r] * p[c];
            }
        }
    }
    rigid_motion(&closest_rotation(&covariance, rotation(start)), from, to)
}

/// The rotation R with the largest tr(RᵀA), from a start.
fn closest_rotation(a: &Matrix3, mut rotation: Matrix3) -> Matrix3 {
    let column = |m: &Matrix3, c: usize| [m[0][c], m[1][c], m[2][c]];
    for _ in 0..50 {
        let (mut turn, mut along) = ([0.0; 3], 0.0);
        for c in 0..3 {
            let (r, a) = (column(&rotation, c), column(a, c));
            turn = add(turn, cross(r, a));
            along += dot(r, a);
        }
        let step = scale(turn, 1.0 / (along.abs() + 1e-15));
        let length = norm(step);
        if length < 1e-12 || !length.is_finite() {
            break;
        }
        rotation = product(&matrix_from_axis_angle(step), &rotation);
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::{PoseSampler, mannequin};
    use rand::SeedableRng;

    fn scene(seed: u64) -> (Body, Vec<f64>, Pose) {
        let body = mannequin();
        let shape = (0..body.shape_count).map(|k| if k % 2 == 0 { 1.2 } else { -0.7 }).collect();
        let mut pose = PoseSampler.sample(&mut rand_chacha::ChaCha8Rng::seed_from_u64(seed));
        pose.rotations[0] = [0.2, 1.9, -0.1];
        (body, shape, pose)
    }

    #[test]
    fn a_body_with_its_t_pose_comes_back() {
        for seed in 0..3 {
            let (body, shape, pose) = scene(seed);
            let moved = |p: &[[f64; 3]], by: [f64; 3]| p.iter().map(|x| add(*x, by)).collect::<Vec<_>>();
            let rest = moved(&body.shaped(&shape).unwrap().positions, [0.5, 1.0, 0.0]);
            let posed = moved(&body.posed(&shape, &pose).unwrap().positions, [3.0, 0.9, -2.0]);
            let found = recover_body(&body, KnownShape::TPose(&rest), &posed).unwrap();
            for (a, b) in found.shape.iter().zip(&shape) {
                assert!((a - b).abs() < 1e-3, "{:?}", found.shape);
            }
            assert!(found.mean_distance < 2e-3, "{}", found.mean_distance);
            assert!(norm(sub(found.place, [3.0, 0.9, -2.0])) < 5e-3, "{:?}", found.place);
        }
    }

    #[test]
    fn with_a_known_shape_the_surface_is_met_within_millimetres() {
        let (body, shape, pose) = scene(5);
        let posed = body.posed(&shape, &pose).unwrap().positions;
        let found = recover_body(&body, KnownShape::Parameters(&shape), &posed).unwrap();
        assert!(found.mean_distance < 2e-3 && found.shape == shape, "{}", found.mean_distance);
    }

    #[test]
    fn shape_and_pose_are_found_from_the_posed_mesh_alone() {
        let (body, shape, pose) = scene(7);
        let posed = body.posed(&shape, &pose).unwrap().positions;
        let found = recover_body(&body, KnownShape::Unknown, &posed).unwrap();
        assert!(found.mean_distance < 3e-3, "{}", found.mean_distance);
        for (a, b) in found.shape.iter().zip(&shape) {
            assert!((a - b).abs() < 0.1, "{:?}", found.shape);
        }
    }

    #[test]
    fn other_meshes_are_refused() {
        let body = mannequin();
        let far: Vec<[f64; 3]> = body.template.iter().map(|p| scale(*p, 4.0)).collect();
        let message = recover_body(&body, KnownShape::Parameters(&[]), &far).unwrap_err().to_string();
        assert!(message.contains("no pose of body 'mannequin' comes near it"), "{message}");
        let few = &body.template[1..];
        let message = recover_body(&body, KnownShape::Parameters(&[]), few).unwrap_err().to_string();
        assert!(message.contains("posed mesh has") && message.contains("mannequin"), "{message}");
        let mut broken = body.template.clone();
        broken[7][0] = f64::NAN;
        let message =
            recover_body(&body, KnownShape::TPose(&broken), &body.template).unwrap_err().to_string();
        assert!(message.contains("vertex 7 of the T-pose mesh"), "{message}");
    }
}
