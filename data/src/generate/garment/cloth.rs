//! The surface that the remesher keeps a garment to, and how long its edges are there.

use super::super::field;
use super::pattern::Pattern;
use crate::mesh::RemeshTarget;
use clothcombo_physics::vec3::dot;

/// The surface that the remesher keeps to.
pub(super) struct ClothSurface<'a> {
    pub pattern: &'a Pattern<'a>,
    pub edge_length: f64,
    pub variation: f64,
    /// Wave vectors (1/m) and phases of the sizing, in whole turns.
    pub waves: [[f64; 4]; 3],
}

impl RemeshTarget for ClothSurface<'_> {
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
