//! How large the gradient of each term can be at a vertex, whatever the shape: the invariant behind "bounded".
//!
//! Every bound is a closed formula in the size of the scene and the constants of the regularisation, derived from the
//! triangle inequality; none divides by a deformed length, area or distance, so that no degenerate shape can make it infinite.
//! They are worst cases and often loose. `ℓ` is the longest deformed edge around the vertex, `D` the largest distance of
//! a vertex from what it is measured against.
//!
//! | term | bound on `|∂E/∂x_v|` | why |
//! |---|---|---|
//! | strain | `Σ_T 2V·S·(λ√2 + 2μ)·(S² + M)·√3/h` | `‖P‖ ≤ ‖F‖·‖S‖`, with `‖F‖ ≤ S = √6·ℓ/h`, and `h` the height of the rest triangle, which the regularisation keeps above a ratio of its longest edge (without it there is no bound); `M` is the norm of the rest metric |
//! | bending | `Σ_H 58·k·ℓ/τ` | `|∂α/∂c|·φ ≤ 1.1·ℓ/τ` and `|∂φ/∂c| ≤ 2.2·ℓ/τ` for `φ = t²(6 − 8t + 3t²)`, `t = s²/τ²` below τ, `α ≤ π`; the ends of the edge carry up to four times that |
//! | gravity | `m_v·g` | it is that everywhere |
//! | body collision | `3(ε + D)²·s` | unit normals, `d ≥ −D`; `s` is what of the contact points a vertex has, 1 where they are the vertices |
//! | repulsion | `2(N − 1)·factor/δ` | a pair pulls with at most `2/δ`; over `N` vertices the default is below `2/δ` for any garment |
//! | holding | `2·max|y − y_ref|·|r|` | a parabola along the row `r` that reads the height off; `|r| = 1` on canonical positions |
//! | layer collision, nearest vertex | `3M(ε + D)²·(1 + 3·n·ℓ·D/τ)` | `M` outer vertices at most share an inner one, whose normal turns by at most `ℓ/τ` per face |
//! | layer collision, closest point | none | the share of a triangle at the border changes within its deformed height |
//! | layer distance | `3M(r + D)²` | `d_inner < r`, `d_outer ≥ −D`, `M` vertices at most per bucket |

use super::bending;
use super::garment_term::HeightRow;
use super::{
    ContactPoints, ContactSamples, EnergySettings, LayerContact, Material, SceneEnergy, Term,
    layer_collision, repulsion,
};
use crate::mesh::{Topology, TriMesh};
use crate::real::Real;
use crate::vec3::{distance_squared, norm, sub, to_f64};

/// Room for rounding in `f32`.
const BOUND_ROUNDING: f64 = 1.001;

/// A bound on every entry of the gradient of `term` (weight 1) in `scene`, whose garments have the rest shapes `rest`,
/// at `posed` and `canonical` (`[ΣV, 3]` (m)); see the module for the formulas. Infinite where there is none, NaN if a
/// position is not finite.
///
/// # Panics
/// If `rest` has not one mesh per garment, or the positions are not those of the scene.
pub fn gradient_bound<T: Real>(
    scene: &SceneEnergy<T>,
    rest: &[&TriMesh],
    term: Term,
    posed: &[[T; 3]],
    canonical: &[[T; 3]],
) -> f64 {
    assert_eq!(rest.len(), scene.garments.len(), "one rest mesh per garment");
    let wide = |positions: &[[T; 3]]| positions.iter().map(|p| to_f64(*p)).collect();
    let parts = scene.garments.iter().zip(rest).zip(scene.ranges());
    let deformed = parts.map(|((garment, mesh), range)| Deformed {
        rest: mesh,
        median_edge: mesh.median_edge_length(),
        posed: wide(&posed[range.clone()]),
        canonical: wide(&canonical[range]),
        reference: wide(&garment.holding_reference),
        pull_back: garment.pull_back.as_deref(),
        contact_points: garment.energies.contact_points(),
        thickness_below: garment.most_thickness(),
        material: *garment.energies.material(),
    });
    let garments: Vec<Deformed<'_>> = deformed.collect();
    let settings = &scene.settings;
    let of_garments = |bound: &dyn Fn(&Deformed<'_>) -> f64| garments.iter().map(bound).fold(0.0, f64::max);
    let to_body = |g: &Deformed<'_>| {
        let distance = |p: &[f64; 3]| {
            let p = crate::vec3::from_f64::<T>(*p);
            let nearest = scene.body.positions.get(scene.body.nearest_vertex(p) as usize);
            nearest.map_or(0.0, |q| distance_squared(to_f64(p), to_f64(*q)).sqrt())
        };
        let points = g.contact_points.at(&g.posed, settings.body_samples);
        points.iter().map(distance).fold(0.0, f64::max) + g.thickness_below
    };
    // A garment may be the inner one of some pairs and the outer one of others: their gradients add up.
    let over_pairs = |bound: &dyn Fn(&Deformed<'_>, &Deformed<'_>) -> f64| {
        scene.layers.iter().map(|pair| bound(&garments[pair.inner], &garments[pair.outer])).sum::<f64>()
    };
    let bound = match term {
        Term::Strain => of_garments(&|g| g.strain(settings)),
        Term::Bending => of_garments(&|g| g.bending()),
        Term::Gravity => of_garments(&|g| g.gravity(settings)),
        Term::BodyCollision => of_garments(&|g| {
            g.contact_share(settings.body_samples)
                * 3.0
                * (settings.body_margin(g.material.thickness) + to_body(g)).powi(2)
        }),
        Term::Repulsion => of_garments(&|g| {
            let count = g.rest.vertex_count() as f64;
            let factor = if settings.repulsion_normalised { 1.0 / count } else { 1.0 };
            2.0 * (count - 1.0) * factor / repulsion::CONTACT_DISTANCE
        }),
        Term::Holding => of_garments(&|g| g.holding()),
        Term::LayerCollision if settings.layer_contact == LayerContact::ClosestPoint => f64::INFINITY,
        Term::LayerCollision => over_pairs(&|inner, outer| inner.layer_collision(outer, settings)),
        Term::LayerDistance => {
            let depths: Vec<f64> = garments.iter().map(to_body).collect();
            let deepest = depths.iter().fold(0.0, |m: f64, d| m.max(*d));
            let reach = settings.layer_distance_radius + deepest;
            over_pairs(&|inner, outer| 3.0 * inner.posed.len().max(outer.posed.len()) as f64 * reach * reach)
        }
    };
    BOUND_ROUNDING * bound
}

/// A garment at rest and deformed.
struct Deformed<'a> {
    rest: &'a TriMesh,
    median_edge: f64,
    posed: Vec<[f64; 3]>,
    canonical: Vec<[f64; 3]>,
    reference: Vec<[f64; 3]>,
    pull_back: Option<&'a [HeightRow]>,
    contact_points: &'a ContactPoints,
    thickness_below: f64,
    material: Material,
}

impl Deformed<'_> {
    fn distance(&self, a: u32, b: u32) -> f64 {
        norm(sub(self.posed[a as usize], self.posed[b as usize]))
    }

    /// The most that a vertex has of the contact points around it, in those that a vertex stands for on average.
    fn contact_share(&self, samples: ContactSamples) -> f64 {
        let points = self.contact_points;
        let mut shares = vec![0.0; self.rest.vertex_count()];
        for point in 0..points.count(samples) {
            let corners = points.corners(point);
            corners.iter().for_each(|v| shares[v] += points.share(samples) * corners.weight());
        }
        shares.into_iter().fold(0.0, f64::max)
    }

    /// Longest deformed edge of a face.
    fn longest(&self, face: u32) -> f64 {
        let [a, b, c] = self.rest.faces()[face as usize];
        self.distance(a, b).max(self.distance(b, c)).max(self.distance(c, a))
    }

    /// The largest sum over the elements at one vertex.
    fn largest_sum<const N: usize>(&self, elements: impl Iterator<Item = ([u32; N], f64)>) -> f64 {
        let mut sums = vec![0.0; self.rest.vertex_count()];
        for (vertices, bound) in elements {
            vertices.iter().for_each(|v| sums[*v as usize] += bound);
        }
        sums.into_iter().fold(0.0, f64::max)
    }

    fn strain(&self, settings: &EnergySettings) -> f64 {
        let material = &self.material;
        let stiffness = material.lambda * 2f64.sqrt() + 2.0 * material.mu;
        let faces = self.rest.faces().iter().enumerate().map(|(f, face)| {
            let [a, b, c] = self.rest.corners(f);
            let length = norm(sub(b, a)).max(norm(sub(c, b))).max(norm(sub(a, c)));
            let area = self.rest.face_area(f);
            if area == 0.0 {
                return (*face, 0.0);
            }
            let regular = length.max(settings.needle_ratio * self.median_edge);
            let true_height = if length > 0.0 { 2.0 * area / length } else { 0.0 };
            let height = true_height.max(settings.needle_ratio * regular);
            let stretch = 6f64.sqrt() * self.longest(f as u32) / height;
            let metric = 6f64.sqrt() * length / height;
            let strain = stretch * stretch + metric * metric + 2.0;
            let volume = area * material.thickness;
            (*face, 2.0 * volume * stretch * stiffness * strain * 3f64.sqrt() / height)
        });
        self.largest_sum(faces)
    }

    fn bending(&self) -> f64 {
        let floor = bending::HINGE_COLLAPSE_FLOOR * self.median_edge * self.median_edge;
        let collapse =
            |f: u32| (bending::HINGE_COLLAPSE_RATIO * 2.0 * self.rest.face_area(f as usize)).max(floor);
        let topology = Topology::new(self.rest);
        let hinges = topology.hinges.iter().map(|h| {
            let length = self.longest(h.faces[0]).max(self.longest(h.faces[1]));
            let collapse = collapse(h.faces[0]).min(collapse(h.faces[1]));
            let bound = 58.0 * self.material.bending_stiffness * length / collapse;
            ([h.edge[0], h.edge[1], h.opposite[0], h.opposite[1]], bound)
        });
        self.largest_sum(hinges)
    }

    fn gravity(&self, settings: &EnergySettings) -> f64 {
        let weight = self.material.thickness * self.material.density * settings.gravity_acceleration;
        let faces = self.rest.faces().iter().enumerate();
        self.largest_sum(faces.map(|(f, face)| (*face, self.rest.face_area(f) * weight / 3.0)))
    }

    fn holding(&self) -> f64 {
        let bound = |(v, reference): (usize, &[f64; 3])| match self.pull_back {
            None => (self.canonical[v][1] - reference[1]).abs(),
            Some(rows) => {
                let ([a, b, c, d], [x, y, z]) = (rows[v], self.posed[v]);
                (a * x + b * y + c * z + d - reference[1]).abs() * norm([a, b, c])
            }
        };
        2.0 * self.reference.iter().enumerate().map(bound).fold(0.0, f64::max)
    }

    /// As the inner garment under `outer`.
    fn layer_collision(&self, outer: &Self, settings: &EnergySettings) -> f64 {
        let aside = |gate: super::LayerGate| (gate.tangential_edges * self.median_edge).hypot(gate.depth);
        let index = crate::query::VertexIndex::new(&self.posed);
        let distance = |p: &[f64; 3]| norm(sub(*p, self.posed[index.nearest(*p).0 as usize]));
        let points = outer.contact_points.at(&outer.posed, settings.layer_samples);
        let farthest = points.iter().map(distance).fold(0.0, f64::max);
        let reach = settings.layer_gate.map_or(farthest, |gate| farthest.min(aside(gate)));
        let floor =
            layer_collision::nearest_vertex::NORMAL_COLLAPSE_FLOOR * self.median_edge * self.median_edge;
        let longest = (0..self.rest.face_count() as u32).map(|f| self.longest(f)).fold(0.0, f64::max);
        let turning = self.rest.faces().iter().map(|face| (*face, 3.0 * longest * reach / floor));
        let pair = settings.for_pair([self.material.thickness, outer.material.thickness]);
        let push = 3.0 * (pair.layer_collision_epsilon + reach).powi(2);
        outer.posed.len() as f64 * push * (1.0 + self.largest_sum(turning))
    }
}
