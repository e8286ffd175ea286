//! A garment bound to the zero body: initial skin weights and shape displacements taken from the nearest body vertex.
//!
//! The paper (§Method, draping) takes the weights of the nearest body vertex. Taken raw they jump from leg to leg, so both
//! quantities may be smoothed over the garment by averaging with the one-ring.

use super::body::{Body, skin};
use super::category::Category;
use super::garment::Garment;
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::query::VertexIndex;

/// How a garment is bound.
#[derive(Clone, Debug, PartialEq)]
pub struct BindingSettings {
    /// Averaging steps for garments that follow one limb each.
    pub smoothing_iterations: usize,
    /// Averaging steps for skirts and dresses, which span both legs.
    pub skirt_smoothing_iterations: usize,
    /// Smooth at all, and take a trouser leg's weights from its own leg only; off is the paper's nearest vertex.
    pub smooth: bool,
    /// Take shape displacements as well; without them a garment starts at its rest positions on every body (the paper's form).
    pub shape_transfer: bool,
}

impl Default for BindingSettings {
    fn default() -> Self {
        Self { smoothing_iterations: 30, skirt_smoothing_iterations: 100, smooth: true, shape_transfer: true }
    }
}

/// What a garment vertex takes from the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Binding {
    /// `[V × J]` row-major, each row summing to one.
    pub skin_weights: Vec<f32>,
    /// `[V × 3 × K]` row-major, metres per unit of shape; empty without shape transfer. All K components of 4,300 garments of
    /// 8,000 vertices on a body with 300 would take 124 GB.
    pub shape_directions: Vec<f32>,
}

impl Binding {
    /// Binds a garment that lies on the zero body.
    pub fn new(garment: &Garment, body: &Body, settings: &BindingSettings) -> Self {
        let (joints, width) = (body.joint_count(), 3 * body.shape_count);
        let nearest = nearest_body_vertices(garment, body, settings.smooth);
        // Most joints (fingers, face) have no weight on a garment: smooth only the columns in use.
        let mut used: Vec<u16> =
            nearest.iter().flat_map(|v| body.skin_weights.row(*v).0.iter().copied()).collect();
        used.sort_unstable();
        used.dedup();
        let mut column_of = vec![usize::MAX; joints];
        used.iter().enumerate().for_each(|(c, j)| column_of[usize::from(*j)] = c);

        let shape_width = if settings.shape_transfer { width } else { 0 };
        let columns = used.len() + shape_width;
        let mut values = vec![0.0f32; nearest.len() * columns];
        for (row, v) in values.chunks_exact_mut(columns.max(1)).zip(&nearest) {
            for (j, w) in body.skin_weights.of_vertex(*v) {
                row[column_of[j]] += w;
            }
            row[used.len()..].copy_from_slice(&body.shape_directions[v * width..v * width + shape_width]);
        }
        if settings.smooth {
            let iterations = if garment.category.hangs_between_legs() {
                settings.skirt_smoothing_iterations
            } else {
                settings.smoothing_iterations
            };
            smooth(&mut values, columns, &Topology::new(&garment.rest), iterations);
        }

        let mut skin_weights = vec![0.0; nearest.len() * joints];
        let mut shape_directions = Vec::with_capacity(nearest.len() * shape_width);
        for (i, row) in values.chunks_exact(columns.max(1)).enumerate() {
            let sum: f32 = row[..used.len()].iter().sum();
            for (c, j) in used.iter().enumerate() {
                skin_weights[i * joints + usize::from(*j)] = row[c] / sum;
            }
            shape_directions.extend_from_slice(&row[used.len()..]);
        }
        Self { skin_weights, shape_directions }
    }

    /// The largest weight of every joint over the garment, `[J]`.
    pub fn largest_weights(&self, joints: usize) -> Vec<f32> {
        let mut largest = vec![0f32; joints];
        for row in self.skin_weights.chunks_exact(joints) {
            largest.iter_mut().zip(row).for_each(|(l, w)| *l = l.max(*w));
        }
        largest
    }

    /// Displacement of every garment vertex (m) for shape `beta` (a short one is continued with zeros); empty without shape
    /// transfer.
    pub fn shape_displacement(&self, beta: &[f64], shape_count: usize) -> Vec<[f64; 3]> {
        if shape_count == 0 {
            return Vec::new();
        }
        self.shape_directions
            .chunks_exact(3 * shape_count)
            .map(|rows| {
                std::array::from_fn(|a| {
                    let row = &rows[a * shape_count..(a + 1) * shape_count];
                    row.iter().zip(beta).map(|(d, b)| f64::from(*d) * b).sum()
                })
            })
            .collect()
    }

    /// Linear blend skinning of canonical `positions` `[V, 3]` (rest, or rest plus a displacement) by the bone transforms of
    /// a posed body ([`Body::posed`]), `[V, 3]` (m).
    pub fn skinned(&self, positions: &[[f64; 3]], bones: &[[[f64; 4]; 3]]) -> Vec<[f64; 3]> {
        let rows = self.skin_weights.chunks_exact(bones.len().max(1));
        positions
            .iter()
            .zip(rows)
            .map(|(p, row)| skin(*p, bones.iter().zip(row).map(|(bone, w)| (bone, f64::from(*w)))))
            .collect()
    }
}

/// Which side of the body a vertex of the lower body belongs to.
const LEG_JOINTS: [&[&str]; 2] = [
    &["left_hip", "left_knee", "left_ankle", "left_foot"],
    &["right_hip", "right_knee", "right_ankle", "right_foot"],
];

/// Nearest body vertex of each garment vertex; with `own_leg` a trouser leg looks only at its own leg (and the trunk): at the
/// inner thigh the other leg can be nearer.
pub(super) fn nearest_body_vertices(garment: &Garment, body: &Body, own_leg: bool) -> Vec<usize> {
    let points = garment.rest.positions();
    if garment.category != Category::Trousers || !own_leg {
        let all = VertexIndex::new(&body.template);
        return points.iter().map(|p| all.nearest(*p).0 as usize).collect();
    }
    let crotch_side = |leg: usize| {
        let names: Vec<usize> = LEG_JOINTS[leg].iter().filter_map(|n| body.joint(n)).collect();
        let of_leg = |v: &usize| {
            let of_leg = body.skin_weights.of_vertex(*v).filter(|(j, _)| names.contains(j));
            of_leg.map(|(_, w)| w).sum::<f32>() > 0.5
        };
        (0..body.vertex_count()).filter(of_leg).collect::<Vec<usize>>()
    };
    // Body without the other leg: [for left garment vertices, for right ones].
    let legs = [crotch_side(0), crotch_side(1)];
    let without_other: [(Vec<usize>, VertexIndex<f64>); 2] = std::array::from_fn(|side| {
        let mut keep = vec![true; body.vertex_count()];
        legs[1 - side].iter().for_each(|v| keep[*v] = false);
        let kept: Vec<usize> = (0..keep.len()).filter(|v| keep[*v]).collect();
        let positions: Vec<[f64; 3]> = kept.iter().map(|v| body.template[*v]).collect();
        (kept, VertexIndex::new(&positions))
    });
    points
        .iter()
        .map(|p| {
            let (kept, index) = &without_other[usize::from(p[0] < 0.0)];
            kept.get(index.nearest(*p).0 as usize).copied().unwrap_or(0)
        })
        .collect()
}

/// `iterations` times: every row moves half of the distance to the mean of its one-ring. Rows only mix along edges of
/// the garment.
pub(super) fn smooth(values: &mut Vec<f32>, columns: usize, topology: &Topology, iterations: usize) {
    let mut next = values.clone();
    for _ in 0..iterations {
        for (v, row) in next.chunks_exact_mut(columns.max(1)).enumerate() {
            let ring = topology.ring(v);
            let own = &values[v * columns..(v + 1) * columns];
            row.copy_from_slice(own);
            if ring.is_empty() {
                continue;
            }
            row.iter_mut().for_each(|x| *x *= 0.5);
            let share = 0.5 / ring.len() as f32;
            for n in ring {
                let other = &values[*n as usize * columns..(*n as usize + 1) * columns];
                row.iter_mut().zip(other).for_each(|(x, o)| *x += share * o);
            }
        }
        std::mem::swap(values, &mut next);
    }
}

#[cfg(test)]
mod tests {
    use super::super::pose::Pose;
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::TriMesh;
    use clothcombo_physics::mesh::shapes::{tube, union};

    /// A vertical tube around a point, from `top` down.
    fn tube_at(x: f64, z: f64, top: f64, height: f64, radius: f64) -> TriMesh {
        let mesh = tube(radius, height, 24, 12);
        let highest = mesh.positions().iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        let moved = mesh.positions().iter().map(|p| [p[0] + x, p[1] - highest + top, p[2] + z]).collect();
        mesh.with_positions(moved).unwrap()
    }

    #[test]
    fn weights_are_a_partition_of_unity_smoothed_or_not() {
        let body = mannequin();
        let skirt = Garment::new(Category::Skirt, tube_at(0.0, 0.0, 0.05, 0.5, 0.25));
        for smooth in [false, true] {
            let binding =
                Binding::new(&skirt, &body, &BindingSettings { smooth, ..BindingSettings::default() });
            for row in binding.skin_weights.chunks_exact(body.joint_count()) {
                assert!((row.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                assert!(row.iter().all(|w| *w >= 0.0));
            }
        }
    }

    #[test]
    fn a_garment_on_the_skin_moves_with_the_body() {
        let body = mannequin();
        // A garment that is a piece of the body's own surface has its weights and shape displacements.
        let shirt = Garment::new(Category::Top, body.zero_body());
        let plain = BindingSettings { smooth: false, ..BindingSettings::default() };
        let binding = Binding::new(&shirt, &body, &plain);
        let mut pose = Pose::t_pose(body.joint_count());
        pose.rotations[1] = [-0.9, 0.2, 0.1];
        pose.rotations[16] = [0.3, -0.2, -1.1];
        let beta = vec![0.7; body.shape_count];
        let posed = body.posed(&beta, &pose).unwrap();
        let moved = binding.shape_displacement(&beta, body.shape_count);
        let start: Vec<_> =
            body.template.iter().zip(moved).map(|(p, d)| std::array::from_fn(|a| p[a] + d[a])).collect();
        for (a, b) in binding.skinned(&start, &posed.bones).iter().zip(&posed.positions) {
            assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-5), "{a:?} {b:?}");
        }
    }

    #[test]
    fn without_smoothing_a_vertex_takes_the_nearest_body_vertex_as_it_is() {
        let body = mannequin();
        let shirt = Garment::new(Category::Top, tube_at(0.0, 0.0, 0.3, 0.25, 0.2));
        let plain = BindingSettings { smooth: false, ..BindingSettings::default() };
        let binding = Binding::new(&shirt, &body, &plain);
        let dense = body.skin_weights.to_dense(body.joint_count());
        let (j, k) = (body.joint_count(), body.shape_count);
        for (i, p) in shirt.rest.positions().iter().enumerate() {
            let distance = |q: &[f64; 3]| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f64>();
            let nearest = body.template.iter().map(&distance).fold(f64::MAX, f64::min);
            let fits = (0..body.vertex_count()).any(|v| {
                distance(&body.template[v]) == nearest
                    && binding.skin_weights[i * j..(i + 1) * j]
                        .iter()
                        .zip(&dense[v * j..])
                        .all(|(a, b)| (a - b).abs() < 1e-6)
                    && binding.shape_directions[i * 3 * k..(i + 1) * 3 * k]
                        == body.shape_directions[v * 3 * k..(v + 1) * 3 * k]
            });
            assert!(fits, "vertex {i}");
        }
        let untransferred = Binding::new(&shirt, &body, &BindingSettings { shape_transfer: false, ..plain });
        assert!(untransferred.shape_directions.is_empty(), "no array of zeros");
        assert!(untransferred.shape_displacement(&[1.0], k).is_empty());
        assert_eq!(untransferred.skin_weights, binding.skin_weights);
    }

    #[test]
    fn smoothing_evens_out_within_a_piece_and_does_not_reach_another() {
        let body = mannequin();
        let knee = body.joint_template[4];
        let left = tube_at(knee[0], knee[2], knee[1] + 0.15, 0.3, 0.09);
        let right = tube_at(-knee[0], knee[2], knee[1] + 0.15, 0.3, 0.09);
        let both = Garment::new(Category::Trousers, union(&[&left, &right]));
        let settings = BindingSettings { smoothing_iterations: 500, ..BindingSettings::default() };
        let binding = Binding::new(&both, &body, &settings);
        let alone = Binding::new(&Garment::new(Category::Trousers, left.clone()), &body, &settings);
        let n = left.vertex_count() * body.joint_count();
        assert_eq!(binding.skin_weights[..n], alone.skin_weights);
        // Each leg keeps its own leg, even after many iterations.
        for (i, row) in binding.skin_weights.chunks_exact(body.joint_count()).enumerate() {
            let other = if i < left.vertex_count() { [2, 5, 8, 11] } else { [1, 4, 7, 10] };
            assert!(other.iter().map(|j| row[*j]).sum::<f32>() < 1e-3);
        }
        // Smoother: the largest difference along an edge drops.
        let roughness = |b: &Binding| {
            let j = body.joint_count();
            Topology::new(&left)
                .edges
                .iter()
                .flat_map(|[a, c]| (0..j).map(move |q| (*a as usize * j + q, *c as usize * j + q)))
                .map(|(a, c)| (b.skin_weights[a] - b.skin_weights[c]).abs())
                .fold(0.0, f32::max)
        };
        let raw = Binding::new(
            &Garment::new(Category::Trousers, left.clone()),
            &body,
            &BindingSettings { smooth: false, ..settings.clone() },
        );
        assert!(roughness(&alone) < 0.5 * roughness(&raw));
    }

    #[test]
    fn shape_displacement_is_linear_in_beta() {
        let body = mannequin();
        let top = Garment::new(Category::Top, tube_at(0.0, 0.0, 0.3, 0.2, 0.2));
        let binding = Binding::new(&top, &body, &BindingSettings::default());
        let k = body.shape_count;
        let one = binding.shape_displacement(&[1.0, 0.5], k);
        let two = binding.shape_displacement(&[2.0, 1.0], k);
        assert_eq!(one.len(), top.rest.vertex_count());
        assert!(one.iter().flatten().any(|x| x.abs() > 1e-4));
        for (a, b) in one.iter().flatten().zip(two.iter().flatten()) {
            assert!((2.0 * a - b).abs() < 1e-9);
        }
    }
}
