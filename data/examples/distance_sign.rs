//! How often the sign of a distance to a posed body is wrong, and what the two distances cost.
//!
//! ```text
//! distance_sign [BODY.npz [POSES = 20]]
//! ```
//! Points near the surface are classified by the winding number of the body, which knows no closest point and no normal;
//! against it stand the two signed distances a run can choose from ([`Distance`]). Where the body overlaps itself (an arm
//! pressed into the torso) part of its surface lies inside it, and no distance to the nearest piece of surface can have the
//! right sign: points there are counted apart. Without a body it takes the mannequin. The poses are the T-pose, sampled ones,
//! and some that fold the body into itself.

use clothcombo_data::asset::{BODY_JOINT_COUNT, Body, BodyError, BodyFileSettings, Pose};
use clothcombo_data::generate::pose::folded_poses;
use clothcombo_data::generate::{PoseSampler, mannequin};
use clothcombo_physics::Surface;
use clothcombo_physics::query::{Distance, winding_numbers};
use clothcombo_physics::vec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Points per pose.
const POINTS: usize = 2000;
/// Largest distance of a point from the surface (m).
const BAND: f64 = 0.05;
/// Points this far under a piece of surface (m) are asked whether it is the body's outside: less than a finger's thickness,
/// far more than rounding.
const PROBE_DEPTH: f64 = 1e-3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let body = match arguments.first() {
        Some(file) => Body::load(Path::new(file), &BodyFileSettings { shape_components: usize::MAX })?,
        None => mannequin(),
    };
    let count: usize = arguments.get(1).map_or(Ok(20), |n| n.parse())?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let sampler = PoseSampler;
    let sampled = (0..count).map(|_| sampler.sample(&mut rng)).collect();
    let mut groups = vec![("T-pose", vec![Pose::t_pose(BODY_JOINT_COUNT)]), ("sampled poses", sampled)];
    groups.extend(folded_poses().into_iter().map(|(name, pose)| (name, vec![pose])));

    println!("Wrong signs: share / share farther than 2 mm from the surface / farthest (mm).\n");
    println!(
        "| poses | surface | points | nearest vertex | closest point | ms per 1,000: vertex | ms per 1,000: point |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|");
    let mut seed = 0;
    for (name, poses) in groups {
        let mut parts = Vec::with_capacity(poses.len());
        for pose in &poses {
            parts.push(sign_errors(&body, pose, seed)?);
            seed += 1;
        }
        print_rows(name, &SignErrors::sum(&parts));
    }
    Ok(())
}

fn print_rows(name: &str, errors: &SignErrors) {
    let cells = |region: &RegionErrors, signs: &WrongSigns| {
        let share = |count: usize| 100.0 * count as f64 / region.points.max(1) as f64;
        format!(
            "{:.3} % / {:.3} % / {:.1}",
            share(signs.wrong),
            share(signs.wrong_beyond_2mm),
            1e3 * signs.farthest
        )
    };
    for (surface, region) in [("apart", &errors.apart), ("overlapping", &errors.overlapping)] {
        if region.points > 0 {
            println!(
                "| {name} ({}) | {surface} | {} | {} | {} | {:.3} | {:.3} |",
                errors.poses,
                region.points,
                cells(region, &region.nearest_vertex),
                cells(region, &region.closest_point),
                errors.nearest_vertex_ms,
                errors.closest_point_ms
            );
        }
    }
}

/// Wrong signs of one distance.
#[derive(Clone, Copy, Debug, Default)]
struct WrongSigns {
    /// Points with the wrong sign.
    wrong: usize,
    /// Those of them that are farther than 2 mm, the collision margin of the paper, from the surface.
    wrong_beyond_2mm: usize,
    /// Largest distance from the surface at which the sign was wrong (m).
    farthest: f64,
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
#[derive(Clone, Copy, Debug, Default)]
struct RegionErrors {
    /// Points looked at.
    points: usize,
    /// Those inside the body.
    inside: usize,
    /// Of the offset from the nearest vertex along its normal.
    nearest_vertex: WrongSigns,
    /// Of the distance to the closest surface point, signed by its pseudo-normal.
    closest_point: WrongSigns,
}

/// Wrong signs over some poses, and what the two distances cost.
#[derive(Clone, Copy, Debug, Default)]
struct SignErrors {
    /// Poses looked at.
    poses: usize,
    /// Near surface that is the body's outside.
    apart: RegionErrors,
    /// Near surface that lies inside another part of the body or is turned inside out, or inside two parts at once.
    overlapping: RegionErrors,
    /// Mean time of 1,000 nearest-vertex queries, on one thread (ms).
    nearest_vertex_ms: f64,
    /// Mean time of 1,000 closest-point queries, on one thread (ms).
    closest_point_ms: f64,
}

impl SignErrors {
    /// All of `parts` together.
    fn sum(parts: &[Self]) -> Self {
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

/// Counts wrong signs around the mean-shaped `body` in `pose`, in the scalar of training.
fn sign_errors(body: &Body, pose: &Pose, seed: u64) -> Result<SignErrors, BodyError> {
    let positions: Vec<[f32; 3]> =
        body.posed(&[], pose)?.positions.iter().map(|p| vec3::from_f64(*p)).collect();
    let faces = &body.faces;
    // The oracle sees exactly the surface and the points that the queries see.
    let exact: Vec<[f64; 3]> = positions.iter().map(|p| p.map(f64::from)).collect();
    let surface = Surface::<f32>::new(positions, faces.clone());
    let points = points_near(&exact, faces, seed);
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
    Ok(errors)
}

/// Points over and under the surface, uniform over its area and over the distance along the face's normal.
fn points_near(positions: &[[f64; 3]], faces: &[[u32; 3]], seed: u64) -> Vec<[f32; 3]> {
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
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..POINTS)
        .map(|_| {
            let sampled = rng.random::<f64>() * area;
            let face = cumulative.partition_point(|&sum| sum <= sampled).min(faces.len() - 1);
            let [a, b, c] = corners(&faces[face]);
            let (edge, side) = (vec3::sub(b, a), vec3::sub(c, a));
            let (mut u, mut v) = (rng.random::<f64>(), rng.random::<f64>());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let on = vec3::add_scaled(vec3::add_scaled(a, u, edge), v, side);
            let normal = vec3::normalized(vec3::cross(edge, side));
            let away = BAND * (2.0 * rng.random::<f64>() - 1.0);
            vec3::from_f64(vec3::add_scaled(on, away, normal))
        })
        .collect()
}
