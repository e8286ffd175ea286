//! Strain: the Saint Venant–Kirchhoff membrane energy (paper, equation for L_s).
//!
//! `Σ area·thickness·(λ/2 tr(G)² + μ tr(G²))` over triangles, with Green's strain `G = ½(FᵀF − I)` and the deformation
//! gradient `F` from the rest triangle to the deformed one. A polynomial in the positions: inverted and collapsed triangles
//! need no special care.
//!
//! **Degenerate rest triangles.** `F` divides by the height of the rest triangle, so a needle is a spring of unbounded
//! stiffness. Training therefore takes its height as at least a ratio
//! ([`EnergySettings::needle_ratio`](super::EnergySettings::needle_ratio)) of its longest edge, and that edge as at least the
//! same ratio of the garment's median edge, while the volume stays the true one. To remain at rest in its rest shape all the
//! same, such a triangle measures `G = ½(FᵀF − F₀ᵀF₀)`, `F₀` being its `F` in the rest shape; for every other triangle
//! `F₀ᵀF₀ = I`. A ratio of 0 is the printed form. A triangle without area has no energy in either.

use super::elements::{Response, sum_elements};
use super::{CurvatureSink, GarmentState, GarmentTerm, Material, Weighted};
use crate::mesh::TriMesh;
use crate::real::Real;
use crate::rows::{CompressedRows, corners_at_vertices};
use crate::vec3::{add, add_scaled, dot, norm, scale, sub, to_f64};

/// The strain energy of one garment.
#[derive(Debug, Clone)]
pub struct Strain {
    mu: f64,
    lambda: f64,
    triangles: Vec<RestTriangle>,
    corners_at: CompressedRows<u32>,
}

/// A triangle with a smaller ratio of height to longest edge has no area: corners on a line round to heights of about 1e-16.
const NO_HEIGHT: f64 = 1e-12;

/// How much of the stiffness of tension its [curvature](GarmentTerm::curvature) has. Cloth that is pulled over a body
/// can slide around it: the stiffness of its tension against turning is cancelled by the curvature of the body under
/// it, which the contact's leaves out. All of it made the steps of the static solver five to ten times too short in the
/// end, none of it makes them too long at first (iterations to within 1 mJ of the minimum from skinning, median of 13
/// scenes: 29 with 1, 15 with 0.3, more than 40 with 0).
const TENSION_SHARE: f64 = 0.3;

/// A rest triangle in a frame whose first axis is its longest edge, corner 0 → corner 1.
#[derive(Debug, Clone, Copy)]
struct RestTriangle {
    /// The face's vertices, turned so that the longest edge comes first.
    corners: [u32; 3],
    /// Area × thickness (m³).
    volume: f64,
    /// The upper triangle `(0,0), (0,1), (1,1)` of the inverse of the 2×2 matrix of rest edges (1/m).
    inverse: [f64; 3],
    /// `F₀ᵀF₀`: entries 11, 12, 22.
    metric: [f64; 3],
}

impl RestTriangle {
    /// Taken to be no flatter than `ratio` of height to longest edge, which is taken for at least `shortest` (m).
    fn new(positions: &[[f64; 3]], face: [u32; 3], thickness: f64, [ratio, shortest]: [f64; 2]) -> Self {
        let length = |k: usize| norm(sub(positions[face[(k + 1) % 3] as usize], positions[face[k] as usize]));
        let lengths = [length(0), length(1), length(2)];
        let first = (0..3).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap_or(0);
        let corners = [0, 1, 2].map(|k| face[(first + k) % 3]);
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        let (base, side) = (sub(b, a), sub(c, a));
        let area = 0.5 * norm(crate::vec3::cross(base, side));

        let true_length = lengths[first];
        let along = if true_length > 0.0 { dot(side, base) / true_length } else { 0.0 };
        let true_height = if true_length > 0.0 { 2.0 * area / true_length } else { 0.0 };
        // Corners on a line have a height of rounding errors.
        let area = if true_height > NO_HEIGHT * true_length { area } else { 0.0 };
        let true_height = if area > 0.0 { true_height } else { 0.0 };
        let length = true_length.max(shortest);
        let height = true_height.max(ratio * length);

        let mut triangle = Self {
            corners,
            volume: area * thickness,
            // Where most of a mesh is points there is no length to measure by, and a point has no volume either.
            inverse: match height > 0.0 {
                true => [1.0 / length, -along / (length * height), 1.0 / height],
                false => [0.0; 3],
            },
            metric: [1.0, 0.0, 1.0],
        };
        if length > true_length || height > true_height {
            let [f1, f2] = triangle.deformation_gradient(base, side);
            triangle.metric = [dot(f1, f1), dot(f1, f2), dot(f2, f2)];
        }
        triangle
    }

    /// The two columns of `F` for deformed edges 0 → 1 and 0 → 2.
    #[inline(always)]
    fn deformation_gradient(&self, base: [f64; 3], side: [f64; 3]) -> [[f64; 3]; 2] {
        let [i00, i01, i11] = self.inverse;
        [scale(base, i00), add_scaled(scale(base, i01), i11, side)]
    }

    /// The two columns of `F` and the entries 11, 12, 22 of `G`.
    #[inline(always)]
    fn strain<T: Real>(&self, positions: &[[T; 3]]) -> ([[f64; 3]; 2], [f64; 3]) {
        let [a, b, c] = self.corners.map(|v| to_f64(positions[v as usize]));
        let [f1, f2] = self.deformation_gradient(sub(b, a), sub(c, a));
        let products = [dot(f1, f1), dot(f1, f2), dot(f2, f2)];
        ([f1, f2], std::array::from_fn(|k| 0.5 * (products[k] - self.metric[k])))
    }

    #[inline(always)]
    fn response<T: Real>(&self, positions: &[[T; 3]], mu: f64, lambda: f64) -> Response<T, 3> {
        let ([f1, f2], [g11, g12, g22]) = self.strain(positions);
        let trace = g11 + g22;
        let density = 0.5 * lambda * trace * trace + mu * (g11 * g11 + 2.0 * g12 * g12 + g22 * g22);

        // ∂E/∂F = volume·F·S with the second Piola–Kirchhoff stress S = λ tr(G) I + 2μ G; F is linear in the edges.
        let s11 = self.volume * (lambda * trace + 2.0 * mu * g11);
        let s12 = self.volume * 2.0 * mu * g12;
        let s22 = self.volume * (lambda * trace + 2.0 * mu * g22);
        let p1 = add_scaled(scale(f1, s11), s12, f2);
        let p2 = add_scaled(scale(f1, s12), s22, f2);
        let [i00, i01, i11] = self.inverse;
        let at_b = add_scaled(scale(p1, i00), i01, p2);
        let at_c = scale(p2, i11);
        let at_a = scale(add(at_b, at_c), -1.0);
        Response { energy: self.volume * density, gradient: [at_a, at_b, at_c].map(crate::vec3::from_f64) }
    }

    /// See [`GarmentTerm::curvature`] of [`Strain`].
    fn curvature<T: Real>(&self, positions: &[[T; 3]], mu: f64, lambda: f64, sink: &mut dyn CurvatureSink) {
        let ([f1, f2], [g11, g12, g22]) = self.strain(positions);
        let trace = g11 + g22;
        let stress = [lambda * trace + 2.0 * mu * g11, 2.0 * mu * g12, lambda * trace + 2.0 * mu * g22];
        let [s11, s12, s22] = positive_part(stress).map(|s| TENSION_SHARE * s);

        // Corner k moves column 1 of F by first[k] and column 2 by second[k] times its displacement.
        let [i00, i01, i11] = self.inverse;
        let (first, second) = ([-i00, i00, 0.0], [-i01 - i11, i01, i11]);
        let d11: [[f64; 3]; 3] = std::array::from_fn(|k| scale(f1, first[k]));
        let d22: [[f64; 3]; 3] = std::array::from_fn(|k| scale(f2, second[k]));
        let d12: [[f64; 3]; 3] =
            std::array::from_fn(|k| scale(add_scaled(scale(f2, first[k]), second[k], f1), 0.5));
        for k in 0..3 {
            for l in 0..=k {
                let tension = s11 * first[k] * first[l]
                    + s12 * (first[k] * second[l] + second[k] * first[l])
                    + s22 * second[k] * second[l];
                let (trace_k, trace_l) = (add(d11[k], d22[k]), add(d11[l], d22[l]));
                let block = std::array::from_fn(|r| {
                    std::array::from_fn(|s| {
                        let shear =
                            d11[k][r] * d11[l][s] + 2.0 * d12[k][r] * d12[l][s] + d22[k][r] * d22[l][s];
                        let elastic = lambda * trace_k[r] * trace_l[s] + 2.0 * mu * shear;
                        self.volume * (elastic + if r == s { tension } else { 0.0 })
                    })
                });
                sink.add(self.corners[k] as usize, self.corners[l] as usize, block);
            }
        }
    }
}

impl Strain {
    /// For a garment with rest shape `rest`; `needle_ratio` as in [`EnergySettings`](super::EnergySettings::needle_ratio).
    pub fn new(rest: &TriMesh, material: &Material, needle_ratio: f64) -> Self {
        let needle = [needle_ratio, needle_ratio * rest.median_edge_length()];
        let triangles: Vec<RestTriangle> = rest
            .faces()
            .iter()
            .map(|&face| RestTriangle::new(rest.positions(), face, material.thickness, needle))
            .collect();
        let corners: Vec<[u32; 3]> = triangles.iter().map(|t| t.corners).collect();
        let corners_at = corners_at_vertices(rest.vertex_count(), &corners);
        Self { mu: material.mu, lambda: material.lambda, triangles, corners_at }
    }

    /// Energy (J) at `positions` `[V, 3]` (m); adds its weighted gradient to `target`.
    pub fn evaluate<T: Real>(&self, positions: &[[T; 3]], target: Option<Weighted<'_, T>>) -> f64 {
        let element = |t: usize| self.triangles[t].response(positions, self.mu, self.lambda);
        sum_elements(self.triangles.len(), &self.corners_at, element, target)
    }
}

impl<T: Real> GarmentTerm<T> for Strain {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.posed, target)
    }

    /// Gauss–Newton in `G`, and a share ([`TENSION_SHARE`]) of the stress that pulls: what pushes (compression) has
    /// negative curvature.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        for triangle in &self.triangles {
            triangle.curvature(state.posed, self.mu, self.lambda, sink);
        }
    }
}

/// The symmetric 2×2 matrix `[a b; b c]` with its negative eigenvalues set to 0.
fn positive_part([a, b, c]: [f64; 3]) -> [f64; 3] {
    let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
    let radius = half.hypot(b);
    let (high, low) = (mean + radius, mean - radius);
    if low >= 0.0 {
        return [a, b, c];
    }
    if high <= 0.0 {
        return [0.0; 3];
    }
    // high·(A − low·I)/(high − low) keeps the eigenvector of `high` alone.
    let factor = high / (high - low);
    [factor * (a - low), factor * b, factor * (c - low)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::is_finite;

    #[test]
    fn a_mesh_of_points_and_one_triangle_has_the_energy_of_that() {
        let mut positions = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]];
        positions.resize(12, [0.3, 0.0, 0.0]);
        let faces = (0..4).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        let rest = TriMesh::new(positions.clone(), faces).unwrap();
        assert_eq!(rest.median_edge_length(), 0.0);
        let one = TriMesh::new(positions[..3].to_vec(), vec![[0, 1, 2]]).unwrap();
        positions[2] = [0.02, 0.15, 0.0];
        positions[7] = [0.3, 0.01, 0.0];
        let strain = |rest: &TriMesh| Strain::new(rest, &Material::default(), 1e-2);
        let mut gradient = vec![[0.0; 3]; 12];
        let target = Weighted { weight: 1.0, gradient: &mut gradient };
        let energy = strain(&rest).evaluate(&positions, Some(target));
        assert_eq!(energy, strain(&one).evaluate(&positions[..3], None));
        assert!(energy > 0.0 && gradient.iter().all(|g| is_finite(*g)));
    }

    #[test]
    fn without_a_needle_ratio_the_strain_is_the_printed_one() {
        // A needle whose height is a thousandth of its length, and a regular triangle.
        let rest_positions = vec![
            [0.0, 0.0, 0.0],
            [0.1, 0.0, 0.0],
            [0.04, 1e-4, 0.0],
            [0.2, 0.0, 0.0],
            [0.3, 0.0, 0.0],
            [0.2, 0.1, 0.0],
        ];
        let rest = TriMesh::new(rest_positions, vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let posed: Vec<[f64; 3]> = vec![
            [0.0, 0.0, 0.0],
            [0.11, 0.0, 0.01],
            [0.041, 3e-4, 2e-4],
            [0.2, 0.01, 0.0],
            [0.31, 0.0, 0.0],
            [0.2, 0.13, 0.02],
        ];
        let material = Material::default();
        // The paper's formula, triangle by triangle: F from the edges in the plane of the rest triangle.
        let printed = |[a, b, c]: [usize; 3]| {
            let p = rest.positions();
            let (x1, [x2, y2]) = (p[b][0] - p[a][0], [p[c][0] - p[a][0], p[c][1] - p[a][1]]);
            let column = |k: usize| {
                let (e1, e2) = (sub(posed[b], posed[a])[k], sub(posed[c], posed[a])[k]);
                [e1 / x1, (e2 - e1 * x2 / x1) / y2]
            };
            let f: Vec<[f64; 2]> = (0..3).map(column).collect();
            let product = |i: usize, j: usize| f.iter().map(|row| row[i] * row[j]).sum::<f64>();
            let [g11, g12, g22] =
                [0.5 * (product(0, 0) - 1.0), 0.5 * product(0, 1), 0.5 * (product(1, 1) - 1.0)];
            let trace = g11 + g22;
            let density = 0.5 * material.lambda * trace * trace
                + material.mu * (g11 * g11 + 2.0 * g12 * g12 + g22 * g22);
            0.5 * x1 * y2 * material.thickness * density
        };
        let expected = printed([0, 1, 2]) + printed([3, 4, 5]);
        let found = Strain::new(&rest, &material, 0.0).evaluate(&posed, None);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found:e} {expected:e}");
        let floored = Strain::new(&rest, &material, 1e-2).evaluate(&posed, None);
        assert!(floored < 0.5 * expected, "{floored} {expected}");
    }

    #[test]
    fn a_triangle_without_area_has_no_strain_in_the_printed_form_either() {
        // Corners on a line that do not round to one.
        let on_a_line = |share: f64| [0.1, 0.2, 0.3].map(|x| share * x);
        let rest = TriMesh::new([0.0, 1.0, 0.495].map(on_a_line).to_vec(), vec![[0, 1, 2]]).unwrap();
        let posed = [[0.0; 3], [0.2, 0.1, 0.0], [0.4, 0.0, 0.3]];
        let mut gradient = vec![[0.0; 3]; 3];
        let target = Weighted { weight: 1.0, gradient: &mut gradient };
        assert_eq!(Strain::new(&rest, &Material::default(), 0.0).evaluate(&posed, Some(target)), 0.0);
        assert_eq!(gradient, [[0.0; 3]; 3]);
    }
}
