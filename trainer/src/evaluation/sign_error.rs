//! How often the sign of a distance to a posed body is wrong.
//!
//! Points near the surface are classified by the winding number of the body, which knows no closest point and no normal;
//! against it stand the two signed distances a run can choose from ([`Distance`]). Where the body overlaps itself (an arm
//! pressed into the torso) part of its surface lies inside it, and no distance to the nearest piece of surface can have the
//! right sign: points there are counted apart.

use clothcombo_data::asset::skeleton::joint_index;
use clothcombo_data::asset::{Body, BodyError, Pose};
use clothcombo_physics::Surface;
use clothcombo_physics::query::{Distance, winding_numbers};
use clothcombo_physics::vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// Points this far under a piece of surface (m) are asked whether it is the body's outside: less than a finger's thickness,
/// far more than rounding.
const PROBE_DEPTH: f64 = 1e-3;

/// Where the points lie and how many there are.
#[derive(Clone, Copy, Debug)]
pub struct SignErrorSettings {
    /// Points per pose.
    pub points: usize,
    /// Largest distance from the surface (m).
    pub band: f64,
    /// Seed of the points; pose `i` uses `seed + i`.
    pub seed: u64,
}

impl Default for SignErrorSettings {
    fn default() -> Self {
        Self { points: 2000, band: 0.05, seed: 0 }
    }
}

/// Wrong signs of one distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct WrongSigns {
    /// Points with the wrong sign.
    pub wrong: usize,
    /// Those of them that are farther than 2 mm, the collision margin of the paper, from the surface.
    pub wrong_beyond_2mm: usize,
    /// Largest distance from the surface at which the sign was wrong (m).
    pub farthest: f64,
}

impl WrongSigns {
    fn count(&mut self, is_wrong: bool, distance: f64) {
        if is_wrong {
            self.wrong += 1;
            self.wrong_beyond_2mm += usize::from(distance > 0.002);
            self.farthest = self.farthest.max(distance);
        }
    }

    fn add(&mut self, other: &Self) {
        self.wrong += other.wrong;
        self.wrong_beyond_2mm += other.wrong_beyond_2mm;
        self.farthest = self.farthest.max(other.farthest);
    }
}

/// Points of one kind of region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RegionErrors {
    /// Points looked at.
    pub points: usize,
    /// Those inside the body.
    pub inside: usize,
    /// Of the offset from the nearest vertex along its normal.
    pub nearest_vertex: WrongSigns,
    /// Of the distance to the closest surface point, signed by its pseudo-normal.
    pub closest_point: WrongSigns,
}

/// Wrong signs over some poses, and what the two distances cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct SignErrors {
    /// Poses looked at.
    pub poses: usize,
    /// Near surface that is the body's outside.
    pub apart: RegionErrors,
    /// Near surface that lies inside another part of the body or is turned inside out, or inside two parts at once.
    pub overlapping: RegionErrors,
    /// Mean time of 1,000 nearest-vertex queries, on one thread (ms).
    pub nearest_vertex_ms: f64,
    /// Mean time of 1,000 closest-point queries, on one thread (ms).
    pub closest_point_ms: f64,
}

impl SignErrors {
    /// All of `parts` together.
    pub fn sum(parts: &[Self]) -> Self {
        let mut sum = Self::default();
        for part in parts {
            for (sum, part) in [(&mut sum.apart, &part.apart), (&mut sum.overlapping, &part.overlapping)] {
                sum.points += part.points;
                sum.inside += part.inside;
                sum.nearest_vertex.add(&part.nearest_vertex);
                sum.closest_point.add(&part.closest_point);
            }
            sum.poses += part.poses;
            sum.nearest_vertex_ms += part.nearest_vertex_ms / parts.len() as f64;
            sum.closest_point_ms += part.closest_point_ms / parts.len() as f64;
        }
        sum
    }
}

/// Poses that fold a body into itself, each with its name.
pub fn hard_poses() -> Vec<(&'static str, Pose)> {
    // Degrees for the left side; the right side is its mirror image.
    let both_sides = |turns: &[(&str, [f64; 3])]| {
        let mut pose = Pose::t_pose(clothcombo_data::asset::BODY_JOINT_COUNT);
        for (name, degrees) in turns {
            let [x, y, z] = degrees.map(f64::to_radians);
            if let Some(joint) = joint_index(name) {
                pose.rotations[joint] = [x, y, z];
            }
            if let Some(joint) = name.strip_prefix("left_").and_then(|n| joint_index(&format!("right_{n}"))) {
                pose.rotations[joint] = [x, -y, -z];
            }
        }
        pose
    };
    vec![
        ("knees bent 150°", both_sides(&[("left_knee", [150.0, 0.0, 0.0])])),
        ("elbows bent 150°", both_sides(&[("left_elbow", [0.0, -150.0, 0.0])])),
        ("arms pressed into the torso", both_sides(&[("left_shoulder", [0.0, 0.0, -95.0])])),
        (
            "sitting",
            both_sides(&[
                ("left_hip", [-100.0, 0.0, 0.0]),
                ("left_knee", [100.0, 0.0, 0.0]),
                ("left_shoulder", [0.0, 0.0, -70.0]),
            ]),
        ),
        (
            "crouching",
            both_sides(&[
                ("left_hip", [-130.0, 0.0, 0.0]),
                ("left_knee", [150.0, 0.0, 0.0]),
                ("spine1", [25.0, 0.0, 0.0]),
                ("spine2", [25.0, 0.0, 0.0]),
                ("left_shoulder", [0.0, -80.0, 0.0]),
            ]),
        ),
    ]
}

/// Counts wrong signs around the mean-shaped `body` in `pose`.
///
/// # Errors
/// [`BodyError`] if the pose has more joints than the body.
pub fn sign_errors(body: &Body, pose: &Pose, settings: &SignErrorSettings) -> Result<SignErrors, BodyError> {
    let positions = body.posed(&[], pose)?.positions;
    let faces = body.zero_body().faces().to_vec();
    Ok(surface_sign_errors(positions.iter().map(|p| vec3::from_f64(*p)).collect(), &faces, settings))
}

/// The same for any closed surface, in the scalar of training.
fn surface_sign_errors(
    positions: Vec<[f32; 3]>,
    faces: &[[u32; 3]],
    settings: &SignErrorSettings,
) -> SignErrors {
    // The oracle sees exactly the surface and the points that the queries see.
    let exact: Vec<[f64; 3]> = positions.iter().map(|p| p.map(f64::from)).collect();
    let surface = Surface::<f32>::new(positions, Arc::from(faces));
    let points = points_near(&exact, faces, settings);
    let mut errors = SignErrors { poses: 1, ..SignErrors::default() };
    let timed = |distance| {
        surface.gap(points[0], distance); // Trees are built at first use.
        let start = Instant::now();
        let gaps: Vec<f32> = points.iter().map(|p| surface.gap(*p, distance).gap).collect();
        (gaps, start.elapsed().as_secs_f64() * 1e6 / points.len() as f64)
    };
    let (nearest, nearest_ms) = timed(Distance::NearestVertex);
    let (closest, closest_ms) = timed(Distance::ClosestPoint);
    (errors.nearest_vertex_ms, errors.closest_point_ms) = (nearest_ms, closest_ms);

    let here: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
    let turns = winding_numbers(&exact, faces, &here);
    let below = |position: [f64; 3], normal: [f64; 3]| vec3::add_scaled(position, -PROBE_DEPTH, normal);
    let under_vertex: Vec<[f64; 3]> = points
        .iter()
        .map(|p| {
            let v = surface.nearest_vertex(*p) as usize;
            below(exact[v], surface.normals[v].map(f64::from))
        })
        .collect();
    let under_surface: Vec<[f64; 3]> = points
        .iter()
        .zip(&here)
        .map(|(p, here)| surface.project(*p).map_or(*here, |found| below(found.position, found.normal)))
        .collect();
    let under_vertex = winding_numbers(&exact, faces, &under_vertex);
    let under_surface = winding_numbers(&exact, faces, &under_surface);
    for i in 0..points.len() {
        let is_inside = turns[i] > 0.5;
        // Right under a proper piece of outside the body is entered exactly once.
        let is_outside = |under: f64| (under - 1.0).abs() < 0.5;
        let overlaps = turns[i] > 1.5 || !is_outside(under_vertex[i]) || !is_outside(under_surface[i]);
        let region = if overlaps { &mut errors.overlapping } else { &mut errors.apart };
        let distance = f64::from(closest[i].abs());
        region.points += 1;
        region.inside += usize::from(is_inside);
        region.nearest_vertex.count((nearest[i] < 0.0) != is_inside, distance);
        region.closest_point.count((closest[i] < 0.0) != is_inside, distance);
    }
    errors
}

/// Points over and under the surface, uniform over its area and over the distance along the face's normal.
fn points_near(positions: &[[f64; 3]], faces: &[[u32; 3]], settings: &SignErrorSettings) -> Vec<[f32; 3]> {
    let corners = |face: &[u32; 3]| face.map(|v| positions[v as usize]);
    let mut area = 0.0;
    let cumulative: Vec<f64> = faces
        .iter()
        .map(|face| {
            let [a, b, c] = corners(face);
            area += vec3::norm(vec3::cross(vec3::sub(b, a), vec3::sub(c, a)));
            area
        })
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    (0..settings.points)
        .map(|_| {
            let drawn = rng.random::<f64>() * area;
            let face = cumulative.partition_point(|&sum| sum <= drawn).min(faces.len() - 1);
            let [a, b, c] = corners(&faces[face]);
            let (edge, side) = (vec3::sub(b, a), vec3::sub(c, a));
            let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let on = vec3::add_scaled(vec3::add_scaled(a, u, edge), v, side);
            let normal = vec3::normalized(vec3::cross(edge, side));
            let away = settings.band * (2.0 * rng.random::<f64>() - 1.0);
            vec3::from_f64(vec3::add_scaled(on, away, normal))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::generate::mannequin;
    use clothcombo_physics::mesh::shapes;

    const SETTINGS: SignErrorSettings = SignErrorSettings { points: 400, band: 0.05, seed: 3 };

    fn narrowed(positions: &[[f64; 3]]) -> Vec<[f32; 3]> {
        positions.iter().map(|p| vec3::from_f64(*p)).collect()
    }

    #[test]
    fn a_fine_sphere_has_the_right_sign_and_a_coarse_one_only_by_closest_point() {
        let fine = shapes::icosphere(0.5, 5);
        let errors = surface_sign_errors(narrowed(fine.positions()), fine.faces(), &SETTINGS);
        assert_eq!((errors.apart.points, errors.overlapping.points), (400, 0));
        assert!((100..300).contains(&errors.apart.inside));
        assert_eq!(errors.apart.closest_point.wrong, 0);
        assert!(errors.apart.nearest_vertex.wrong < 8);
        // A flat plate: above its middle the nearest vertex is at the rim, whose normal lies sideways.
        let plate = shapes::mapped(&shapes::icosphere(0.5, 1), |[x, y, z]| [x, 0.05 * y, z]);
        let errors = surface_sign_errors(narrowed(plate.positions()), plate.faces(), &SETTINGS);
        assert_eq!(errors.apart.closest_point.wrong, 0);
        assert!(errors.apart.nearest_vertex.wrong > 10, "{errors:?}");
    }

    #[test]
    fn overlapping_spheres_are_told_apart() {
        let sphere = shapes::icosphere(0.5, 3);
        let shifted = shapes::mapped(&sphere, |[x, y, z]| [x + 0.6, y, z]);
        let both = shapes::union(&[&sphere, &shifted]);
        let errors = surface_sign_errors(narrowed(both.positions()), both.faces(), &SETTINGS);
        assert_eq!(errors.apart.closest_point.wrong, 0);
        // Just outside one sphere's surface and deep inside the other.
        assert!(errors.overlapping.closest_point.wrong > 10, "{errors:?}");
    }

    #[test]
    fn the_mannequin_in_every_hard_pose() {
        let body = mannequin();
        let settings = SignErrorSettings { points: 50, ..SETTINGS };
        let parts: Vec<SignErrors> =
            hard_poses().iter().map(|(_, pose)| sign_errors(&body, pose, &settings).unwrap()).collect();
        let sum = SignErrors::sum(&parts);
        assert_eq!(sum.poses, parts.len());
        assert_eq!(sum.apart.points + sum.overlapping.points, 50 * parts.len());
        assert!(sum.overlapping.points > 0 && sum.nearest_vertex_ms > 0.0);
        for (_, pose) in hard_poses() {
            let mirrored = pose.mirrored();
            for (a, b) in pose.rotations.iter().zip(&mirrored.rotations) {
                assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-12), "both sides alike");
            }
        }
    }
}
