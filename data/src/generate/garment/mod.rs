//! Garments of six categories for any body, designed by documented parameters or at random, cut and meshed for that body.
//!
//! Every garment is made alike. A smooth solid around the body — hanging tubes around trunk, sleeves and legs, united with an
//! offset of the body itself — is polygonised, opened along cut surfaces (hem, cuffs, neckline, armholes, placket), and remeshed
//! isotropically with every vertex kept on the solid and every boundary vertex on its cut. Being outside the body
//! is thus part of the construction, hems are exact, and the random lattice, sizing and design make every
//! triangulation a different one.

mod cloth;
mod cut;
mod design;
mod error;
mod fit;
mod lower;
pub(crate) mod measures;
mod pattern;
mod quality;
mod random_design;
mod tube;
mod upper;

use crate::asset::provenance::GENERATED;
use crate::asset::{Body, Category, Garment, Provenance};
use crate::mesh::{EditableMesh, LabelledTriangles, Lattice, Quality, extract, remesh};
use cloth::ClothSurface;
use clothcombo_physics::TriMesh;
use clothcombo_physics::contact::TriangleTree;
use cut::cut_pattern;
use design::GarmentDesign;
use fit::BodyFit;
use quality::GarmentQuality;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use error::GarmentError;

/// Relative spread of the number of vertices over seeds.
const RESOLUTION_SPREAD: f64 = 0.25;
/// Relative variation of the edge length within a garment: the triangulation is irregular, so that a network cannot learn it.
const SIZING_VARIATION: f64 = 0.15;
/// Least distance between cloth and skin at rest (m).
const LEAST_CLEARANCE: f64 = 0.005;
/// Designs tried before giving up on a seed.
const DESIGNS_TRIED: u64 = 12;

/// Generates garments for one body; measures the body once.
#[derive(Debug)]
pub struct GarmentGenerator<'a> {
    body: &'a Body,
    /// Tells bodies of the same name apart.
    body_hash: String,
    fit: BodyFit,
    tree: TriangleTree<'a>,
}

impl<'a> GarmentGenerator<'a> {
    /// Measures the zero body.
    ///
    /// # Errors
    /// [`GarmentError`] if it has no T-pose with the SMPL body joints.
    pub fn new(body: &'a Body) -> Result<Self, GarmentError> {
        let fit = BodyFit::new(body)?;
        let mut hasher = blake3::Hasher::new();
        body.template.as_flattened().iter().for_each(|x| {
            hasher.update(&x.to_le_bytes());
        });
        let body_hash = hasher.finalize().to_hex()[..8].to_string();
        Ok(Self { body, body_hash, fit, tree: TriangleTree::new(&body.template, &body.faces) })
    }

    /// Whether a garment can have about so many `vertices`.
    ///
    /// # Errors
    /// [`GarmentError`] if not.
    pub fn check_vertices(vertices: usize) -> Result<(), GarmentError> {
        match (200..=50_000).contains(&vertices) {
            true => Ok(()),
            false => {
                Err(GarmentError(format!("garment generator: {vertices} vertices, expected 200 to 50000")))
            }
        }
    }

    /// One garment of random design and about so many `vertices` at rest on the zero body: an orientable manifold with boundary, one component, faces
    /// outward, wholly outside the body (exact test) and free of self-intersections, edges within 0.4–2.5 of their
    /// median, angles of at least 15°. A design that misses one of these is replaced by another one of the same seed.
    ///
    /// # Errors
    /// [`GarmentError`] for another number of vertices, and for a seed without a design that passes.
    pub fn generate(&self, category: Category, seed: u64, vertices: usize) -> Result<Garment, GarmentError> {
        Self::check_vertices(vertices)?;
        let mut last = String::new();
        for attempt in 0..DESIGNS_TRIED {
            let design = GarmentDesign::random(category, &mut stream(seed, category, attempt, 0));
            match self.attempt(&design, seed, attempt, vertices) {
                Ok(rest) => {
                    let (name, source) = (Self::name(category, seed), self.provenance(seed, vertices));
                    let holding = Garment::needs_holding(&rest, self.body);
                    return Ok(Garment { name, holding, source, ..Garment::new(category, rest) });
                }
                Err(reason) => last = reason,
            }
        }
        Err(GarmentError(format!(
            "no {category} for seed {seed} passed the checks in {DESIGNS_TRIED} designs; the last one {last}; hint: use another \
             seed, or more vertices if the garment has narrow parts"
        )))
    }

    /// The name of the garment of a seed.
    pub fn name(category: Category, seed: u64) -> String {
        format!("{category}_{seed:06}")
    }

    /// Where the garment of a seed comes from: says which body, seed and number of vertices make the same garment again.
    pub fn provenance(&self, seed: u64, vertices: usize) -> Provenance {
        let (name, hash) = (&self.body.name, &self.body_hash);
        Provenance {
            source: format!("{GENERATED}{name} ({hash}) from seed {seed}, about {vertices} vertices"),
            author: "ClothCombo-rs".to_string(),
            licence: "CC0-1.0".to_string(),
        }
    }

    /// One mesh of a design; the error says which check it failed.
    fn attempt(
        &self,
        design: &GarmentDesign,
        seed: u64,
        attempt: u64,
        vertices: usize,
    ) -> Result<TriMesh, String> {
        let category = design.category();
        let mut rng = stream(seed, category, attempt, 1);
        let vertices = vertices as f64 * (1.0 + RESOLUTION_SPREAD * rng.random_range(-1.0..1.0));
        // A first guess of the edge length from a typical area; the real area is known after the cut.
        let area = match category {
            Category::Dress => 1.1,
            Category::Top => 0.45,
            Category::Skirt => 0.6,
            _ => 0.8,
        };
        let guess = edge_length(area, vertices);
        let pattern = cut_pattern(&self.fit, design, guess, LEAST_CLEARANCE);

        let step = (0.6 * guess).clamp(0.008, 0.018);
        let mut low = pattern.bounds[0];
        for (axis, x) in low.iter_mut().enumerate() {
            // A node plane in the middle lets the lattice see the gap between trouser legs.
            *x = if axis == 0 { (*x / step).floor() * step } else { *x - step * rng.random_range(0.0..1.0) };
        }
        let lattice = Lattice::covering(low, pattern.bounds[1], step);
        let values = lattice.sample(|p| pattern.field(p));
        let (positions, faces) = extract(&lattice, &values);
        let labels = vec![0; positions.len()];
        let mut triangles = LabelledTriangles { positions, labels, faces };
        for (bit, cut) in pattern.cuts.iter().enumerate() {
            triangles = triangles.clip(cut, 1 << bit);
        }
        let triangles = triangles.largest_component();
        if triangles.faces.is_empty() {
            return Err("has no cloth left after cutting".to_string());
        }
        quality::check_openings(&triangles.positions, &triangles.labels, &triangles.faces, pattern.openings)?;

        let target = ClothSurface {
            pattern: &pattern,
            edge_length: edge_length(triangles.area(), vertices),
            variation: SIZING_VARIATION,
            waves: std::array::from_fn(|_| {
                std::array::from_fn(|i| {
                    if i < 3 { rng.random_range(-3.5..3.5) } else { rng.random_range(0.0..1.0) }
                })
            }),
        };
        let mut sheet = EditableMesh::new(triangles);
        let limits = Quality { angle: 15.0, edge_ratio: [0.4, 2.5] };
        remesh(&mut sheet, &target, 6, limits);
        let (positions, faces) = sheet.compact();
        let rest = TriMesh::new(positions, faces).map_err(|e| format!("is no mesh: {e}"))?;
        self.quality(&rest).check(&limits, pattern.openings)?;
        Ok(rest)
    }

    /// Measures a mesh against the guarantees of the generator.
    fn quality(&self, rest: &TriMesh) -> GarmentQuality {
        GarmentQuality::measure(rest, &self.fit.surface, &self.tree)
    }
}

/// Random numbers of one attempt; streams keep categories, attempts and purposes of one seed independent of each other.
fn stream(seed: u64, category: Category, attempt: u64, purpose: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((attempt * 2 + purpose) * 16 + category as u64);
    rng
}

/// Edge length of a triangulation of `area` with `vertices` nearly equilateral triangles' corners.
fn edge_length(area: f64, vertices: f64) -> f64 {
    (area / (0.866 * vertices)).sqrt()
}

/// A garment of about `vertices` vertices for a test.
#[cfg(test)]
pub(crate) fn generated(body: &Body, category: Category, seed: u64, vertices: usize) -> Garment {
    GarmentGenerator::new(body).unwrap().generate(category, seed, vertices).unwrap()
}

#[cfg(test)]
mod tests;
