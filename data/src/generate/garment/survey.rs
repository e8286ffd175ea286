//! The generator's promises measured over many seeds.

use super::{GarmentError, GarmentGenerator, GarmentSettings};
use crate::asset::Category;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt;
use std::time::{Duration, Instant};

/// What came out of one category.
#[derive(Debug, Clone, PartialEq)]
pub struct CategorySurvey {
    /// The category.
    pub category: Category,
    /// Garments asked for.
    pub asked: usize,
    /// Garments of which the first design was kept.
    pub first_kept: usize,
    /// Designs rejected by the checks, all attempts together.
    pub rejected: usize,
    /// Garments for which no design passed.
    pub failed: usize,
    /// Fewest and most vertices.
    pub vertices: [usize; 2],
    /// Smallest triangle angle [degrees].
    pub smallest_angle: f64,
    /// Shortest and longest edge relative to the median of its garment.
    pub edge_ratio: [f64; 2],
    /// Least distance of a vertex to the body [m]; negative inside.
    pub least_gap: f64,
    /// Pairs of a garment triangle and a body triangle that share a point.
    pub body_triangle_pairs: usize,
    /// Pairs of triangles of one garment that intersect.
    pub self_triangle_pairs: usize,
    /// Garments that are no orientable manifold of one component.
    pub broken: usize,
    /// Mean time per garment [ms], checks and rejected designs included.
    pub milliseconds: f64,
}

/// Measurements of many generated garments.
#[derive(Debug, Clone)]
pub struct Survey {
    /// One entry per category, in the order of [`Category::ALL`].
    pub categories: Vec<CategorySurvey>,
    /// Why designs were rejected, and how often; numbers in the reasons are left out.
    pub reasons: BTreeMap<String, usize>,
    /// Time of everything.
    pub elapsed: Duration,
    /// Threads used.
    pub threads: usize,
}

impl Survey {
    /// Makes `count` garments, categories in turn, garment `i` from `seed + i`, and measures each with
    /// [`GarmentGenerator::quality`]. `progress` is called after every garment.
    ///
    /// # Errors
    /// [`GarmentError::Setting`]; garments that cannot be made are counted.
    pub fn new(
        generator: &GarmentGenerator,
        count: usize,
        seed: u64,
        settings: &GarmentSettings,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self, GarmentError> {
        settings.check()?;
        let start = Instant::now();
        let made: Vec<_> = (0..count)
            .into_par_iter()
            .with_max_len(1)
            .map(|i| {
                let category = Category::ALL[i % Category::ALL.len()];
                let begin = Instant::now();
                let made = generator.generate_traced(category, seed.wrapping_add(i as u64), settings);
                let time = begin.elapsed();
                let quality = made.as_ref().ok().map(|m| generator.quality(&m.garment.rest));
                progress();
                (category, made, quality, time)
            })
            .collect();
        let mut reasons = BTreeMap::new();
        let mut categories: Vec<CategorySurvey> = Category::ALL.map(CategorySurvey::none).into();
        for (category, made, quality, time) in made {
            let entry = &mut categories[category as usize];
            entry.asked += 1;
            entry.milliseconds += time.as_secs_f64() * 1e3;
            let rejected = match &made {
                Ok(made) => made.rejected.clone(),
                Err(e) => {
                    entry.failed += 1;
                    entry.rejected += settings.attempts - 1;
                    vec![e.to_string()]
                }
            };
            entry.first_kept += usize::from(made.is_ok() && rejected.is_empty());
            entry.rejected += rejected.len();
            for reason in rejected {
                let words = reason.replace(|c: char| c.is_ascii_digit() || c == '.' || c == '-', "");
                *reasons.entry(words.split_whitespace().collect::<Vec<_>>().join(" ")).or_default() += 1;
            }
            let Some(q) = quality else { continue };
            entry.vertices = [entry.vertices[0].min(q.vertices), entry.vertices[1].max(q.vertices)];
            entry.smallest_angle = entry.smallest_angle.min(q.smallest_angle);
            entry.edge_ratio =
                [entry.edge_ratio[0].min(q.edge_ratio[0]), entry.edge_ratio[1].max(q.edge_ratio[1])];
            entry.least_gap = entry.least_gap.min(q.least_gap);
            entry.body_triangle_pairs += q.body_triangle_pairs;
            entry.self_triangle_pairs += q.self_triangle_pairs;
            entry.broken += usize::from(!q.is_orientable_manifold || q.components != 1);
        }
        for entry in &mut categories {
            entry.milliseconds /= entry.asked.max(1) as f64;
        }
        Ok(Self { categories, reasons, elapsed: start.elapsed(), threads: rayon::current_num_threads() })
    }

    /// Garments asked for.
    pub fn asked(&self) -> usize {
        self.categories.iter().map(|c| c.asked).sum()
    }

    /// Share of the garments for which no design passed, 0–1.
    pub fn failure_rate(&self) -> f64 {
        self.categories.iter().map(|c| c.failed).sum::<usize>() as f64 / self.asked().max(1) as f64
    }

    /// Whether every garment that was made keeps every promise.
    pub fn keeps_promises(&self) -> bool {
        self.categories.iter().filter(|c| c.asked > c.failed).all(|c| {
            c.smallest_angle >= 15.0
                && c.edge_ratio[0] >= 0.4
                && c.edge_ratio[1] <= 2.5
                && c.least_gap > 0.0
                && c.body_triangle_pairs + c.self_triangle_pairs + c.broken == 0
        })
    }
}

impl CategorySurvey {
    fn none(category: Category) -> Self {
        Self {
            category,
            asked: 0,
            first_kept: 0,
            rejected: 0,
            failed: 0,
            vertices: [usize::MAX, 0],
            smallest_angle: f64::INFINITY,
            edge_ratio: [f64::INFINITY, 0.0],
            least_gap: f64::INFINITY,
            body_triangle_pairs: 0,
            self_triangle_pairs: 0,
            broken: 0,
            milliseconds: 0.0,
        }
    }
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<11} {:>6} {:>6} {:>9} {:>7} {:>12} {:>6} {:>11} {:>7} {:>6} {:>5} {:>7} {:>7}",
            "category",
            "asked",
            "first",
            "rejected",
            "failed",
            "vertices",
            "angle",
            "edges",
            "gap mm",
            "body",
            "self",
            "broken",
            "ms"
        )?;
        for c in self.categories.iter().filter(|c| c.asked > 0) {
            let vertices = format!("{}-{}", c.vertices[0].min(c.vertices[1]), c.vertices[1]);
            let edges = format!("{:.2}-{:.2}", c.edge_ratio[0], c.edge_ratio[1]);
            writeln!(
                f,
                "{:<11} {:>6} {:>6} {:>9} {:>7} {:>12} {:>6.1} {:>11} {:>7.1} {:>6} {:>5} {:>7} {:>7.0}",
                c.category.name(),
                c.asked,
                c.first_kept,
                c.rejected,
                c.failed,
                vertices,
                c.smallest_angle,
                edges,
                c.least_gap * 1e3,
                c.body_triangle_pairs,
                c.self_triangle_pairs,
                c.broken,
                c.milliseconds
            )?;
        }
        for (reason, count) in &self.reasons {
            writeln!(f, "rejected {count:>4} x {reason}")?;
        }
        let asked = self.asked();
        let seconds = self.elapsed.as_secs_f64();
        write!(
            f,
            "{asked} garments in {seconds:.1} s on {} threads ({:.0} ms of one thread each); failure rate {:.2} %; promises {}",
            self.threads,
            seconds * 1e3 * self.threads as f64 / asked.max(1) as f64,
            100.0 * self.failure_rate(),
            if self.keeps_promises() { "kept" } else { "BROKEN" }
        )
    }
}
