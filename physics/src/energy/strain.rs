//! Strain: the Saint Venant–Kirchhoff membrane energy (paper, equation for L_s).
//!
//! `Σ area·thickness·(λ/2 tr(G)² + μ tr(G²))` over triangles, with Green's strain `G = ½(FᵀF − I)` and the deformation
//! gradient `F` from the rest triangle to the deformed one. A polynomial in the positions: inverted and collapsed triangles
//! need no special care.
//!
//! **Degenerate rest triangles.** `F` divides by the height of the rest triangle, so a needle would be a spring of
//! unbounded stiffness. Its height is therefore taken as at least [`NEEDLE_RATIO`] of its longest edge, and that edge as at
//! least [`NEEDLE_RATIO`] of the garment's median edge, while the volume stays the true one: a triangle without area has no
//! energy. To remain at rest in its rest shape all the same, such a triangle measures `G = ½(FᵀF − F₀ᵀF₀)`, `F₀` being
//! its `F` in the rest shape; for every other triangle `F₀ᵀF₀ = I`.

use super::elements::{Incidence, Response, sum_elements};
use super::{CurvatureSink, GarmentState, GarmentTerm, Material, Weighted};
use crate::mesh::TriMesh;
use crate::real::Real;
use crate::vec3::{add, add_scaled, dot, norm, scale, sub, to_f64};

/// Rest triangles flatter than this ratio of height to longest edge are measured as if they had it.
pub const NEEDLE_RATIO: f64 = 1e-2;

/// The strain energy of one garment.
#[derive(Debug, Clone)]
pub struct Strain {
    mu: f64,
    lambda: f64,
    triangles: Vec<RestTriangle>,
    incidence: Incidence,
}

/// A rest triangle in a frame whose first axis is its longest edge, corner 0 → corner 1.
#[derive(Debug, Clone, Copy)]
struct RestTriangle {
    /// The face's vertices, turned so that the longest edge comes first.
    corners: [u32; 3],
    /// Area × thickness [m³].
    volume: f64,
    /// The upper triangle `(0,0), (0,1), (1,1)` of the inverse of the 2×2 matrix of rest edges [1/m].
    inverse: [f64; 3],
    /// `F₀ᵀF₀`: entries 11, 12, 22.
    metric: [f64; 3],
}

impl RestTriangle {
    fn new(positions: &[[f64; 3]], face: [u32; 3], thickness: f64, median_edge: f64) -> Self {
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
        let length = true_length.max(NEEDLE_RATIO * median_edge);
        let height = true_height.max(NEEDLE_RATIO * length);

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

    #[inline(always)]
    fn response<T: Real>(&self, positions: &[[T; 3]], mu: f64, lambda: f64) -> Response<T, 3> {
        let [a, b, c] = self.corners.map(|v| to_f64(positions[v as usize]));
        let [f1, f2] = self.deformation_gradient(sub(b, a), sub(c, a));
        let g11 = 0.5 * (dot(f1, f1) - self.metric[0]);
        let g12 = 0.5 * (dot(f1, f2) - self.metric[1]);
        let g22 = 0.5 * (dot(f2, f2) - self.metric[2]);
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
}

impl RestTriangle {
    /// See [`GarmentTerm::curvature`] of [`Strain`].
    fn curvature<T: Real>(&self, positions: &[[T; 3]], mu: f64, lambda: f64, sink: &mut dyn CurvatureSink) {
        let [a, b, c] = self.corners.map(|v| to_f64(positions[v as usize]));
        let [f1, f2] = self.deformation_gradient(sub(b, a), sub(c, a));
        let g11 = 0.5 * (dot(f1, f1) - self.metric[0]);
        let g12 = 0.5 * (dot(f1, f2) - self.metric[1]);
        let g22 = 0.5 * (dot(f2, f2) - self.metric[2]);
        let trace = g11 + g22;
        let stress = [lambda * trace + 2.0 * mu * g11, 2.0 * mu * g12, lambda * trace + 2.0 * mu * g22];
        let [s11, s12, s22] = positive_part(stress);

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
    /// Prepares the energy of a garment with rest shape `rest`.
    pub fn new(rest: &TriMesh, material: &Material) -> Self {
        Self::with_median_edge(rest, material, rest.median_edge_length())
    }

    pub(super) fn with_median_edge(rest: &TriMesh, material: &Material, median_edge: f64) -> Self {
        let triangles: Vec<RestTriangle> = rest
            .faces()
            .iter()
            .map(|&face| RestTriangle::new(rest.positions(), face, material.thickness, median_edge))
            .collect();
        let corners: Vec<[u32; 3]> = triangles.iter().map(|t| t.corners).collect();
        let incidence = Incidence::new(rest.vertex_count(), &corners);
        Self { mu: material.mu, lambda: material.lambda, triangles, incidence }
    }

    /// Energy [J] at `positions` `[V, 3]` [m]; adds its weighted gradient to `target`.
    pub fn evaluate<T: Real>(&self, positions: &[[T; 3]], target: Option<Weighted<'_, T>>) -> f64 {
        let element = |t: usize| self.triangles[t].response(positions, self.mu, self.lambda);
        sum_elements(self.triangles.len(), &self.incidence, element, target)
    }
}

impl<T: Real> GarmentTerm<T> for Strain {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.posed, target)
    }

    /// Gauss–Newton in `G`, and the part of the stress that pulls: what pushes (compression) has negative curvature.
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
        let strain = |rest: &TriMesh| Strain::new(rest, &Material::default());
        let mut gradient = vec![[0.0; 3]; 12];
        let target = Weighted { weight: 1.0, gradient: &mut gradient };
        let energy = strain(&rest).evaluate(&positions, Some(target));
        assert_eq!(energy, strain(&one).evaluate(&positions[..3], None));
        assert!(energy > 0.0 && gradient.iter().all(|g| is_finite(*g)));
    }
}
