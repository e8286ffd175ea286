//! Bending: a hinge at every interior edge (paper, equation for L_b).
//!
//! `Σ k/2·α²`, α being the unsigned angle between the normals of the two triangles, 0 when they are coplanar. It comes from
//! `atan2`, whose gradient is finite and right at every angle, 0 included, where `acos` of a dot product has none; the
//! gradient is the classical one of the dihedral angle (Bridson et al. 2003; Grinspun et al. 2003). The triangles are
//! oriented by the hinge and not by the faces, so that a flipped face does not bend.
//!
//! **At α = π** (one triangle folded flat onto the other) the energy is continuous but not smooth: unfolding to either side
//! lowers it. The gradient there is that of one side.
//!
//! **Degenerate triangles** have no normal, and near them the angle turns arbitrarily fast: in a compressed fold, where
//! triangles collapse, a step of a micrometre turned a hinge over, forces of hundreds of newtons stood against each
//! other, and no descent settled. Each hinge is therefore scaled by `φ(s²/τ²)` for both of its triangles, `φ(t) = t²(6
//! − 8t + 3t²)` below 1 and 1 above, `s` being twice the deformed area and τ a twentieth of its rest value (at least
//! 1e-3 squared median edges). Both ends of φ are flat: the angle jumps where the area vanishes. A triangle that keeps
//! a twentieth of its area, and is not a speck beside the others of its mesh, has the printed energy, one without area
//! none, and the gradient is bounded and the exact derivative everywhere.

use super::curvature::outer;
use super::elements::{Response, sum_elements};
use super::{CurvatureSink, GarmentState, GarmentTerm, Weighted};
use crate::mesh::{Hinge, TriMesh};
use crate::real::Real;
use crate::rows::{CompressedRows, corners_at_vertices};
use crate::vec3::{
    add, add_scaled, cross, dot, from_f64, neg, norm, norm_squared, normalized, scale, sub, to_f64,
};

/// τ in units of twice the rest area.
pub const HINGE_COLLAPSE_RATIO: f64 = 0.05;

/// Smallest τ in units of the squared median edge.
pub const HINGE_COLLAPSE_FLOOR: f64 = 1e-3;

/// The bending energy of one garment.
#[derive(Debug, Clone)]
pub struct Bending {
    stiffness: f64,
    /// Edge start, edge end, opposite vertex of the first face, of the second.
    hinges: Vec<[u32; 4]>,
    /// τ² of the two triangles of each hinge (m⁴).
    collapse_squared: Vec<[f64; 2]>,
    corners_at: CompressedRows<u32>,
}

impl Bending {
    /// Prepares the energy of a garment with rest shape `rest` and its `hinges`; `stiffness` (J/rad²).
    pub fn new(rest: &TriMesh, hinges: &[Hinge], stiffness: f64) -> Self {
        let median_edge = rest.median_edge_length();
        let floor = HINGE_COLLAPSE_FLOOR * median_edge * median_edge;
        let collapse =
            |face: u32| (HINGE_COLLAPSE_RATIO * 2.0 * rest.face_area(face as usize)).max(floor).powi(2);
        let collapse_squared = hinges.iter().map(|h| h.faces.map(collapse)).collect();
        let hinges: Vec<[u32; 4]> =
            hinges.iter().map(|h| [h.edge[0], h.edge[1], h.opposite[0], h.opposite[1]]).collect();
        let corners_at = corners_at_vertices(rest.vertex_count(), &hinges);
        Self { stiffness, hinges, collapse_squared, corners_at }
    }

    /// Energy (J) at `positions` `[V, 3]` (m); adds its weighted gradient to `target`.
    pub fn evaluate<T: Real>(&self, positions: &[[T; 3]], target: Option<Weighted<'_, T>>) -> f64 {
        let element = |h: usize| {
            let corners = self.hinges[h].map(|v| to_f64(positions[v as usize]));
            let (energy, gradient) = hinge(corners, self.collapse_squared[h], self.stiffness);
            Response { energy, gradient: gradient.map(from_f64) }
        };
        sum_elements(self.hinges.len(), &self.corners_at, element, target)
    }
}

impl<T: Real> GarmentTerm<T> for Bending {
    fn evaluate(&self, state: &GarmentState<'_, T>, target: Option<Weighted<'_, T>>) -> f64 {
        self.evaluate(state.posed, target)
    }

    /// Gauss–Newton: `k φ ∇α ∇αᵀ`, without the second derivative of the angle, which has either sign.
    fn curvature(&self, state: &GarmentState<'_, T>, sink: &mut dyn CurvatureSink) {
        for (hinge, tau) in self.hinges.iter().zip(&self.collapse_squared) {
            let gradient = scaled_angle_gradient(hinge.map(|v| to_f64(state.posed[v as usize])), *tau);
            for k in 0..4 {
                for l in 0..=k {
                    let block = outer(self.stiffness, gradient[k], gradient[l]);
                    sink.add(hinge[k] as usize, hinge[l] as usize, block);
                }
            }
        }
    }
}

/// How much of its hinges a triangle of twice the area `s` has left.
struct Fade {
    /// `φ(s²/τ²)`.
    share: f64,
    /// `φ/s²`, finite at no area.
    over_square: f64,
    /// `dφ/d(s²)`.
    slope: f64,
}

impl Fade {
    #[inline(always)]
    fn new(square: f64, tau_squared: f64) -> Self {
        if square >= tau_squared {
            // Of a garment so small that even τ² vanished, nothing bends.
            let (share, over_square) = if square > 0.0 { (1.0, 1.0 / square) } else { (0.0, 0.0) };
            return Self { share, over_square, slope: 0.0 };
        }
        let t = square / tau_squared;
        Self {
            share: t * t * (6.0 - t * (8.0 - 3.0 * t)),
            over_square: t * (6.0 - t * (8.0 - 3.0 * t)) / tau_squared,
            slope: 12.0 * t * (1.0 - t).powi(2) / tau_squared,
        }
    }
}

/// `√φ ∂α/∂(a, b, c, d)`, φ being the scale of the hinge's energy.
fn scaled_angle_gradient([a, b, c, d]: [[f64; 3]; 4], [tau1, tau2]: [f64; 2]) -> [[f64; 3]; 4] {
    let (edge, to_c, to_d) = (sub(b, a), sub(c, a), sub(d, a));
    let (n1, n2) = (cross(edge, to_c), cross(to_d, edge));
    let (length, direction) = (norm(edge), normalized(edge));
    let (fade1, fade2) = (Fade::new(norm_squared(n1), tau1), Fade::new(norm_squared(n2), tau2));
    // √φ n/s² = n/s √(φ/s²), which has no division by a vanishing area.
    let at_c = scale(normalized(n1), -(fade1.over_square * fade2.share).sqrt());
    let at_d = scale(normalized(n2), -(fade2.over_square * fade1.share).sqrt());
    let (g_c, g_d) = (scale(at_c, length), scale(at_d, length));
    let g_b = neg(add_scaled(scale(at_c, dot(to_c, direction)), dot(to_d, direction), at_d));
    let g_a = neg(add(g_b, add(g_c, g_d)));
    [g_a, g_b, g_c, g_d]
}

/// Energy and gradient of the triangles `(a, b, c)` and `(b, a, d)` about the edge `a b`.
#[inline(always)]
fn hinge([a, b, c, d]: [[f64; 3]; 4], [tau1, tau2]: [f64; 2], stiffness: f64) -> (f64, [[f64; 3]; 4]) {
    let (edge, to_c, to_d) = (sub(b, a), sub(c, a), sub(d, a));
    let (n1, n2) = (cross(edge, to_c), cross(to_d, edge));
    let length = norm(edge);
    let direction = normalized(edge);
    // n1 × n2 = −(n1·to_d) edge, so this is atan2 of the sine and the cosine, both times |n1||n2|. Signed: valleys < 0.
    let angle = (-length * dot(n1, to_d)).atan2(dot(n1, n2));

    let (fade1, fade2) = (Fade::new(norm_squared(n1), tau1), Fade::new(norm_squared(n2), tau2));
    let plain = 0.5 * stiffness * angle * angle;

    // ∂α/∂c = −|edge| n1/|n1|², ∂α/∂d likewise, and the ends of the edge balance force and torque.
    let moment = stiffness * angle;
    let at_c = scale(n1, -moment * fade2.share * fade1.over_square);
    let at_d = scale(n2, -moment * fade1.share * fade2.over_square);
    let (along_c, along_d) = (dot(to_c, direction), dot(to_d, direction));
    let mut g_c = scale(at_c, length);
    let mut g_d = scale(at_d, length);
    let mut g_b = neg(add_scaled(scale(at_c, along_c), along_d, at_d));
    // The scales change with the areas.
    let w1 = scale(n1, 2.0 * plain * fade2.share * fade1.slope);
    let w2 = scale(n2, 2.0 * plain * fade1.share * fade2.slope);
    g_c = add(g_c, cross(w1, edge));
    g_d = add(g_d, cross(edge, w2));
    g_b = add(g_b, add(cross(to_c, w1), cross(w2, to_d)));
    let g_a = neg(add(g_b, add(g_c, g_d)));
    (plain * fade1.share * fade2.share, [g_a, g_b, g_c, g_d])
}
