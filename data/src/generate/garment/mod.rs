//! A wardrobe for any body: garments of six categories, designed by documented parameters or by chance, cut and meshed for the
//! body that shall wear them.
//!
//! Every garment is made the same way. A smooth solid around the body — hanging tubes around trunk, sleeves and legs, united with an
//! offset of the body itself — is polygonised, opened along cut surfaces (hem, cuffs, neckline, armholes, placket), and remeshed
//! isotropically with every vertex kept on the solid and every boundary vertex on its cut. Being outside the body
//! is thus part of the construction, hems are exact, and the random lattice, sizing and design make every
//! triangulation a different one.

mod design;
mod distance_grid;
mod fit;
mod pattern;
mod quality;
mod survey;
mod tube;
mod upper;
mod wardrobe;

use super::field;
use super::isosurface::{Lattice, extract};
use super::remesh::{Quality, Target, remesh};
use super::sheet::{LabelledTriangles, Sheet};
use crate::asset::{Body, Category, Garment, Provenance};
use clothcombo_physics::TriMesh;
use clothcombo_physics::contact::TriangleTree;
use clothcombo_physics::vec3::{dot, norm};
use fit::BodyFit;
use pattern::Pattern;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use thiserror::Error;

pub use design::{
    FlareDesign, Front, GarmentDesign, Neckline, PleatDesign, SkirtDesign, SleeveDesign, TrousersDesign,
    UpperDesign,
};
pub use quality::GarmentQuality;
pub use survey::{CategorySurvey, Survey};

/// How garments are generated.
#[derive(Debug, Clone, PartialEq)]
pub struct GarmentSettings {
    /// Vertices a garment has about, from 200 to 50,000. Default 1,200.
    pub target_vertices: usize,
    /// Relative spread of the number of vertices over seeds, 0–0.5. Default 0.25.
    pub resolution_spread: f64,
    /// Least distance between cloth and skin at rest [m]. Default 5 mm.
    pub clearance: f64,
    /// Relative variation of the edge length within a garment, 0–0.25. Default 0.15: the triangulation is
    /// irregular, so that a network cannot learn it.
    pub sizing_variation: f64,
    /// Designs tried before giving up on a seed. Default 12.
    pub attempts: usize,
}

impl Default for GarmentSettings {
    fn default() -> Self {
        Self {
            target_vertices: 1200,
            resolution_spread: 0.25,
            clearance: 0.005,
            sizing_variation: 0.15,
            attempts: 12,
        }
    }
}

/// Why no garment was generated.
#[derive(Debug, Error)]
pub enum GarmentError {
    /// The body is no T-posed human body with the SMPL joints.
    #[error("cannot cut garments for body '{body}': {reason}")]
    UnsuitableBody {
        /// Body name.
        body: String,
        /// What does not fit.
        reason: String,
    },
    /// A setting is out of range.
    #[error("garment generator: {setting} is {value}, expected {expected}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        expected: &'static str,
    },
    /// No design of this seed passed the checks.
    #[error(
        "no {category} for seed {seed} passed the checks in {attempts} designs; the last one {last}; \
         hint: use another seed, or more vertices if the garment has narrow parts"
    )]
    Exhausted {
        /// Wanted category.
        category: Category,
        /// Seed.
        seed: u64,
        /// How many designs were tried.
        attempts: usize,
        /// What was wrong with the last.
        last: String,
    },
}

/// Generates garments for one body; measures the body once.
#[derive(Debug)]
pub struct GarmentGenerator<'a> {
    body: &'a Body,
    /// Tells bodies of the same name apart.
    body_hash: String,
    fit: BodyFit,
    tree: TriangleTree<'a>,
}

/// A garment with the story of its making.
#[derive(Debug, Clone)]
pub struct GeneratedGarment {
    /// The garment.
    pub garment: Garment,
    /// Its design.
    pub design: GarmentDesign,
    /// What was wrong with the designs tried before it; none of them was kept.
    pub rejected: Vec<String>,
}

/// One garment for `body`, the same for the same seed and settings. For many garments keep a [`GarmentGenerator`], which
/// measures the body only once.
///
/// # Errors
/// [`GarmentError`] if the body is unsuitable, a setting is out of range, or no design passed the checks.
pub fn generate_garment(
    body: &Body,
    category: Category,
    seed: u64,
    settings: &GarmentSettings,
) -> Result<Garment, GarmentError> {
    GarmentGenerator::new(body)?.generate(category, seed, settings)
}

impl<'a> GarmentGenerator<'a> {
    /// Measures the zero body.
    ///
    /// # Errors
    /// [`GarmentError::UnsuitableBody`] if it has no T-pose with the SMPL body joints.
    pub fn new(body: &'a Body) -> Result<Self, GarmentError> {
        let fit = BodyFit::new(body)?;
        let mut hasher = blake3::Hasher::new();
        body.template.as_flattened().iter().for_each(|x| {
            hasher.update(&x.to_le_bytes());
        });
        let body_hash = hasher.finalize().to_hex()[..8].to_string();
        Ok(Self { body, body_hash, fit, tree: TriangleTree::new(&body.template, &body.faces) })
    }

    /// One garment of random design at rest on the zero body: an orientable manifold with boundary, one component, faces
    /// outward, wholly outside the body (exact test) and free of self-intersections, edges within 0.4–2.5 of their
    /// median, angles of at least 15°. A design that misses one of these is replaced by another one of the same seed.
    ///
    /// # Errors
    /// [`GarmentError::Setting`] and [`GarmentError::Exhausted`].
    pub fn generate(
        &self,
        category: Category,
        seed: u64,
        settings: &GarmentSettings,
    ) -> Result<Garment, GarmentError> {
        Ok(self.generate_traced(category, seed, settings)?.garment)
    }

    /// As [`Self::generate`], with the design and the rejected attempts.
    ///
    /// # Errors
    /// As [`Self::generate`].
    pub fn generate_traced(
        &self,
        category: Category,
        seed: u64,
        settings: &GarmentSettings,
    ) -> Result<GeneratedGarment, GarmentError> {
        settings.check()?;
        let mut rejected = Vec::new();
        for attempt in 0..settings.attempts as u64 {
            let design = GarmentDesign::random(category, &mut stream(seed, category, attempt, 0));
            match self.attempt(&design, seed, attempt, settings) {
                Ok(rest) => {
                    return Ok(GeneratedGarment {
                        garment: self.garment(category, seed, settings, rest),
                        design,
                        rejected,
                    });
                }
                Err(reason) => rejected.push(reason),
            }
        }
        Err(exhausted(category, seed, rejected))
    }

    /// A garment of the given design, with the promises of [`Self::generate`]. The seed decides about the mesh; other
    /// triangulations are tried where one misses a promise.
    ///
    /// # Errors
    /// [`GarmentError::Setting`], and [`GarmentError::Exhausted`] for a design that does not work on this body.
    pub fn make(
        &self,
        design: &GarmentDesign,
        seed: u64,
        settings: &GarmentSettings,
    ) -> Result<Garment, GarmentError> {
        settings.check()?;
        let mut rejected = Vec::new();
        for attempt in 0..settings.attempts as u64 {
            match self.attempt(design, seed, attempt, settings) {
                Ok(rest) => return Ok(self.garment(design.category(), seed, settings, rest)),
                Err(reason) => rejected.push(reason),
            }
        }
        Err(exhausted(design.category(), seed, rejected))
    }

    /// The name of the garment of a seed.
    pub fn name(category: Category, seed: u64) -> String {
        format!("{category}_{seed:06}")
    }

    /// Where the garment of a seed comes from: says which body, seed and settings make the same garment again.
    pub fn provenance(&self, seed: u64, settings: &GarmentSettings) -> Provenance {
        let (name, hash, vertices) = (&self.body.name, &self.body_hash, settings.target_vertices);
        Provenance {
            source: format!("generated for {name} ({hash}) from seed {seed}, about {vertices} vertices"),
            author: "ClothCombo-rs".to_string(),
            licence: "CC0-1.0".to_string(),
        }
    }

    fn garment(&self, category: Category, seed: u64, settings: &GarmentSettings, rest: TriMesh) -> Garment {
        Garment {
            name: Self::name(category, seed),
            category,
            holding: Garment::needs_holding(&rest, self.body),
            rest,
            source: self.provenance(seed, settings),
        }
    }

    /// One mesh of a design; the error says which check it failed.
    fn attempt(
        &self,
        design: &GarmentDesign,
        seed: u64,
        attempt: u64,
        settings: &GarmentSettings,
    ) -> Result<TriMesh, String> {
        let category = design.category();
        let mut rng = stream(seed, category, attempt, 1);
        let spread = settings.resolution_spread;
        let vertices = settings.target_vertices as f64 * (1.0 + spread * rng.random_range(-1.0..1.0));
        // A first guess of the edge length from a typical area; the real area is known after the cut.
        let area = match category {
            Category::Dress => 1.1,
            Category::Top => 0.45,
            Category::Skirt => 0.6,
            _ => 0.8,
        };
        let guess = edge_length(area, vertices);
        let pattern = Pattern::new(&self.fit, design, guess, settings.clearance);

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

        let target = Cloth {
            pattern: &pattern,
            edge_length: edge_length(triangles.area(), vertices),
            variation: settings.sizing_variation,
            waves: std::array::from_fn(|_| {
                std::array::from_fn(|i| {
                    if i < 3 { rng.random_range(-3.5..3.5) } else { rng.random_range(0.0..1.0) }
                })
            }),
        };
        let mut sheet = Sheet::new(triangles);
        let limits = Quality { angle: 15.0, edge_ratio: [0.4, 2.5] };
        remesh(&mut sheet, &target, 6, limits);
        let (positions, faces) = sheet.compact();
        let rest = TriMesh::new(positions, faces).map_err(|e| format!("is no mesh: {e}"))?;
        self.quality(&rest).check(&limits, pattern.openings)?;
        Ok(rest)
    }

    /// Measures a mesh against the promises of the generator.
    pub fn quality(&self, rest: &TriMesh) -> GarmentQuality {
        GarmentQuality::measure(rest, &self.fit.surface, &self.tree)
    }
}

/// Random numbers of one attempt; streams keep categories, attempts and purposes of one seed independent of each other.
fn stream(seed: u64, category: Category, attempt: u64, purpose: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((attempt * 2 + purpose) * 16 + category as u64);
    rng
}

fn exhausted(category: Category, seed: u64, mut rejected: Vec<String>) -> GarmentError {
    let attempts = rejected.len();
    GarmentError::Exhausted { category, seed, attempts, last: rejected.pop().unwrap_or_default() }
}

impl GarmentSettings {
    /// Whether every setting is in its range.
    ///
    /// # Errors
    /// [`GarmentError::Setting`] names the first that is not.
    pub fn check(&self) -> Result<(), GarmentError> {
        let fail = |setting, value: String, expected| Err(GarmentError::Setting { setting, value, expected });
        if !(200..=50_000).contains(&self.target_vertices) {
            return fail("target_vertices", self.target_vertices.to_string(), "200 to 50000");
        }
        if !(0.0..=0.5).contains(&self.resolution_spread) {
            return fail("resolution_spread", self.resolution_spread.to_string(), "0 to 0.5");
        }
        if !(0.003..=0.05).contains(&self.clearance) {
            return fail("clearance", self.clearance.to_string(), "0.003 to 0.05 (metres)");
        }
        if !(0.0..=0.25).contains(&self.sizing_variation) {
            return fail("sizing_variation", self.sizing_variation.to_string(), "0 to 0.25");
        }
        if !(1..=1000).contains(&self.attempts) {
            return fail("attempts", self.attempts.to_string(), "1 to 1000");
        }
        Ok(())
    }
}

/// Edge length of a triangulation of `area` with `vertices` nearly equilateral triangles' corners.
fn edge_length(area: f64, vertices: f64) -> f64 {
    (area / (0.866 * vertices)).sqrt()
}

/// The surface that the remesher keeps to.
struct Cloth<'a> {
    pattern: &'a Pattern<'a>,
    edge_length: f64,
    variation: f64,
    /// Wave vectors [1/m] and phases of the sizing, in whole turns.
    waves: [[f64; 4]; 3],
}

impl Target for Cloth<'_> {
    fn project(&self, mut point: [f64; 3], label: u32) -> [f64; 3] {
        let reach = self.edge_length;
        if label == 0 {
            return field::project(|p| self.pattern.field(p), point, 2, reach);
        }
        // Alternating corrections along the joint normal space: the surface, then each cut within the surface.
        for _ in 0..3 {
            point = field::project(|p| self.pattern.field(p), point, 1, reach);
            for (bit, cut) in self.pattern.cuts.iter().enumerate() {
                if label >> bit & 1 == 0 {
                    continue;
                }
                let (value, slope) = field::gradient(cut, point);
                let (_, normal) = field::gradient(|p| self.pattern.field(p), point);
                let length = dot(normal, normal);
                let overlap = if length > 1e-9 { dot(slope, normal) / length } else { 0.0 };
                let within: [f64; 3] = std::array::from_fn(|a| slope[a] - overlap * normal[a]);
                let squared = dot(within, within);
                if squared < 1e-4 {
                    continue;
                }
                let factor = value / squared * (reach / (value.abs() / squared.sqrt()).max(1e-12)).min(1.0);
                (0..3).for_each(|a| point[a] -= factor * within[a]);
            }
        }
        point
    }

    fn edge_length(&self, point: [f64; 3]) -> f64 {
        let sum: f64 =
            self.waves.iter().map(|w| wave(w[0] * point[0] + w[1] * point[1] + w[2] * point[2] + w[3])).sum();
        self.edge_length * (1.0 + self.variation * sum / 3.0_f64.sqrt())
    }
}

/// A sine-like wave of period 1 made of parabolas: the remesher asks for it ten million times.
fn wave(turns: f64) -> f64 {
    let t = 2.0 * (turns - turns.floor()) - 1.0;
    4.0 * t * (1.0 - t.abs())
}

/// Length of an edge [m].
fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm([a[0] - b[0], a[1] - b[1], a[2] - b[2]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::BodyParts;
    use crate::generate::mannequin;
    use std::collections::HashSet;

    /// The promises, measured without the generator's own label bookkeeping.
    fn assert_promises(generator: &GarmentGenerator, garment: &Garment) {
        let quality = generator.quality(&garment.rest);
        let name = &garment.name;
        assert!(quality.is_orientable_manifold, "{name}");
        assert_eq!(quality.components, 1, "{name}");
        assert!((2..=4).contains(&quality.boundary_loops), "{name}");
        assert_eq!(quality.euler_characteristic, 2 - quality.boundary_loops as i64, "{name}");
        assert!(quality.smallest_angle >= 15.0, "{name}: {}", quality.smallest_angle);
        assert!(
            quality.edge_ratio[0] >= 0.4 && quality.edge_ratio[1] <= 2.5,
            "{name}: {:?}",
            quality.edge_ratio
        );
        assert!(quality.least_gap >= 0.003, "{name}: {}", quality.least_gap);
        assert_eq!((quality.body_triangle_pairs, quality.self_triangle_pairs), (0, 0), "{name}");
        assert!(quality.outward > 0.6, "{name}: {}", quality.outward);
    }

    #[test]
    fn every_category_keeps_the_promises_with_a_topology_of_its_own() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 700, ..GarmentSettings::default() };
        let mut seen = HashSet::new();
        for category in Category::ALL {
            for seed in 0..3 {
                let garment = generator.generate(category, seed, &settings).unwrap();
                assert_promises(&generator, &garment);
                assert!(seen.insert(garment.rest.faces().to_vec()));
                let vertices = garment.rest.vertex_count();
                assert!((350..1100).contains(&vertices), "{}: {vertices} vertices", garment.name);
            }
        }
    }

    #[test]
    fn the_categories_cover_what_they_should() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 500, ..GarmentSettings::default() };
        let joint = &body.joint_template;
        for seed in 20..23 {
            for category in Category::ALL {
                let garment = generator.generate(category, seed, &settings).unwrap();
                let (low, high) = garment.rest.bounds();
                let at_chest = high[1] > joint[9][1];
                let below_hips = low[1] < joint[1][1];
                match category {
                    Category::Dress => assert!(at_chest && below_hips),
                    Category::Top | Category::TShirt | Category::OpenShirt => assert!(at_chest),
                    Category::Skirt | Category::Trousers => assert!(!at_chest && below_hips),
                }
                // Cloth far out beside the chest; hems may be as wide, but lower.
                let sleeves = garment
                    .rest
                    .positions()
                    .iter()
                    .any(|p| p[1] > 0.5 * (joint[9][1] + joint[16][1]) && p[0] > joint[16][0] + 0.05);
                match category {
                    Category::TShirt | Category::OpenShirt => assert!(sleeves),
                    Category::Top => assert!(!sleeves),
                    _ => {}
                }
                assert_eq!(garment.holding, Garment::needs_holding(&garment.rest, &body));
                if matches!(category, Category::Skirt | Category::Trousers) {
                    assert!(garment.holding);
                }
            }
        }
    }

    #[test]
    fn trouser_legs_are_apart_and_hems_are_exact_curves() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 500, ..GarmentSettings::default() };
        for seed in 0..3 {
            let rest = generator.generate(Category::Trousers, seed, &settings).unwrap().rest;
            let topology = clothcombo_physics::Topology::new(&rest);
            assert_eq!(topology.boundary_loops.len(), 3);
            let lowest = rest.bounds().0[1];
            // The two leg openings lie on one level, each wholly on its side.
            let hems: Vec<&Vec<u32>> = topology
                .boundary_loops
                .iter()
                .filter(|curve| {
                    curve.iter().all(|v| (rest.positions()[*v as usize][1] - lowest).abs() < 1e-3)
                })
                .collect();
            assert_eq!(hems.len(), 2);
            for hem in hems {
                let left = hem.iter().filter(|v| rest.positions()[**v as usize][0] > 0.0).count();
                assert!(left == 0 || left == hem.len());
            }
        }
    }

    /// The mannequin of another build on the skeleton of SMPL-X, fingers and face without skin of their own.
    fn smplx_shaped() -> Body {
        let mannequin = mannequin();
        let shape: Vec<f64> =
            (0..mannequin.shape_count).map(|k| if k % 2 == 0 { 1.2 } else { -0.8 }).collect();
        let shaped = mannequin.shaped(&shape).unwrap();
        let mut joints = shaped.joints;
        let mut parents = mannequin.parents.clone();
        for (joint, parent) in (22..25).map(|j| (j, 15)).chain((25..55).map(|j| (j, 20 + (j - 25) / 15))) {
            parents.push(Some(parent));
            joints.push(joints[parent]);
            assert_eq!(joints.len(), joint + 1);
        }
        Body::new(BodyParts {
            name: "smplx".into(),
            faces: mannequin.faces.clone(),
            template: shaped.positions,
            shape_directions: Vec::new(),
            shape_count: 0,
            joint_template: joints,
            joint_shape_directions: Vec::new(),
            pose_directions: None,
            skin_weights: mannequin.skin_weights.clone(),
            parents,
            joint_names: crate::asset::skeleton::joint_names(55),
        })
        .unwrap()
    }

    #[test]
    fn garments_of_every_category_keep_the_promises_on_two_bodies() {
        let settings = GarmentSettings { target_vertices: 500, ..GarmentSettings::default() };
        for (body, count) in [(mannequin(), 18), (smplx_shaped(), 12)] {
            let generator = GarmentGenerator::new(&body).unwrap();
            let calls = std::sync::atomic::AtomicUsize::new(0);
            let progress = || {
                calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            };
            let survey = Survey::new(&generator, count, 300, &settings, &progress).unwrap();
            assert!(survey.keeps_promises(), "{survey}");
            assert_eq!((survey.asked(), survey.failure_rate()), (count, 0.0), "{survey}");
            assert_eq!(calls.into_inner(), count);
            assert!(survey.categories.iter().all(|c| c.asked == count / 6 && c.failed == 0));
        }
    }

    #[test]
    fn a_given_design_is_followed() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 900, ..GarmentSettings::default() };
        let make = |design: &GarmentDesign| generator.make(design, 3, &settings).unwrap().rest;
        let mut skirt = SkirtDesign {
            rise: 0.5,
            length: 1.4,
            ease: 0.01,
            hang: 0.8,
            skirt: FlareDesign { flare: 0.2, pleats: None },
            rim_tilt: 0.0,
            hem_tilt: 0.0,
        };
        let plain = make(&GarmentDesign::Skirt(skirt.clone()));
        let mark = generator.fit.landmarks;
        let hem = mark.crotch + 0.4 * (mark.ankle - mark.crotch);
        assert!((plain.bounds().0[1] - hem).abs() < 2e-3);
        // Pleats swing the radius of the hem around; without them it changes slowly.
        let turns = |rest: &TriMesh| {
            let topology = clothcombo_physics::Topology::new(rest);
            let curve = topology
                .boundary_loops
                .iter()
                .find(|curve| curve.iter().all(|v| rest.positions()[*v as usize][1] < hem + 0.01))
                .unwrap();
            let radii: Vec<f64> = curve
                .iter()
                .map(|v| rest.positions()[*v as usize])
                .map(|p| p[0].hypot(p[2] - generator.fit.column.centre(hem)[0]))
                .collect();
            let rises = |i: usize| radii[(i + 1) % radii.len()] > radii[i];
            (0..radii.len()).filter(|i| rises(*i) != rises((i + 1) % radii.len())).count()
        };
        skirt.skirt.pleats = Some(PleatDesign { count: 10, depth: 0.2, formed: 0.3, phase: 0.0 });
        let pleated = make(&GarmentDesign::Skirt(skirt.clone()));
        assert!(turns(&pleated) >= 16 && turns(&plain) < 16, "{} {}", turns(&pleated), turns(&plain));
        assert!(pleated.area() > 1.03 * plain.area());

        // A cuff is narrower than the same sleeve left open; a placket opens the front below the neckline.
        let upper = |cuff: f64, front: Front| {
            GarmentDesign::Upper(UpperDesign {
                category: Category::TShirt,
                length: 0.6,
                looseness: 0.6,
                hang: 0.6,
                skirt: FlareDesign { flare: 0.0, pleats: None },
                hem_tilt: 0.0,
                neckline: Neckline::Neck {
                    width: 0.03,
                    depth: 0.02,
                    depth_back: 0.0,
                    power: 2.0,
                    armhole: 0.9,
                    armhole_drop: 0.02,
                },
                sleeves: Some(SleeveDesign {
                    length: 0.9,
                    ease: 0.004,
                    hang: 0.8,
                    flare: 0.01,
                    armhole: 0.0,
                    tilt: 0.0,
                    cuff,
                }),
                front,
            })
        };
        let end = mark.shoulder[0] + 0.9 * (mark.wrist - mark.shoulder[0]);
        let height_of_end = |rest: &TriMesh| {
            let ends = rest.positions().iter().filter(|p| p[0] > end - 2e-3).map(|p| p[1]);
            let (low, high) = ends.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
            high - low
        };
        let (open, cuffed) = (
            make(&upper(0.0, Front::Closed)),
            make(&upper(1.0, Front::Placket { length: 0.15, half_width: 0.015 })),
        );
        assert!(height_of_end(&cuffed) < height_of_end(&open) - 0.015);
        let in_front = |rest: &TriMesh| {
            let chest = rest.positions().iter().filter(|p| p[2] > mark.neck[2] && p[1] > mark.armpit);
            chest.map(|p| p[0].abs()).fold(f64::MAX, f64::min)
        };
        assert!(in_front(&open) < 0.013 && in_front(&cuffed) > 0.013);
    }

    #[test]
    fn the_same_seed_gives_the_same_garment_for_any_number_of_threads() {
        let body = mannequin();
        let settings = GarmentSettings { target_vertices: 400, ..GarmentSettings::default() };
        let make = || generate_garment(&body, Category::TShirt, 11, &settings).unwrap();
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert_eq!(one.install(make).rest, three.install(make).rest);
        assert_ne!(make().rest, generate_garment(&body, Category::TShirt, 12, &settings).unwrap().rest);
    }

    #[test]
    fn bad_settings_and_bodies_are_refused_with_a_reason() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 3, ..GarmentSettings::default() };
        let message = generator.generate(Category::Top, 0, &settings).unwrap_err().to_string();
        assert!(message.contains("target_vertices") && message.contains("200"), "{message}");
        // A body lying on its back.
        let mut lying = body.clone();
        for p in lying.template.iter_mut().chain(&mut lying.joint_template) {
            *p = [p[0], -p[2], p[1]];
        }
        let message = GarmentGenerator::new(&lying).unwrap_err().to_string();
        assert!(message.contains("mannequin") && message.contains("T-pose"), "{message}");
    }
}
