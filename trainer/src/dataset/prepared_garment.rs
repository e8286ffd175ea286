//! A garment with everything that does not change during training.

use clothcombo_data::asset::{Body, Footprint, Garment};
use clothcombo_physics::energy::GarmentEnergies;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// A garment with everything that does not change during training, but for DiffusionNet's operators
/// ([`GarmentStore::operators`](super::GarmentStore::operators)), which only the device needs.
pub struct PreparedGarment {
    /// Rest mesh, category, provenance.
    pub garment: Garment,
    /// Constants of its energies.
    pub energies: Arc<GarmentEnergies<f32>>,
    /// Initial skin weights of the active joints, `[V, J]`.
    pub skin_weights: Vec<f32>,
    /// Shape displacement per unit β, `[V, 3, K]` (m), K being the shape components of the body; empty without shape transfer.
    pub shape_directions: Vec<f32>,
    pub(super) footprint: OnceLock<Footprint>,
}

/// Constants of the energies per vertex (bytes), and its neighbourhoods; measured on garments of 8,000 vertices.
const ENERGIES: usize = 1050;

impl PreparedGarment {
    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.garment.rest.vertex_count()
    }

    /// Where the garment starts on a body of shape β: rest positions plus the transferred shape displacement.
    pub fn start_positions(&self, shape: &[f64]) -> Vec<[f32; 3]> {
        let directions = &self.shape_directions;
        let k = directions.len() / (3 * self.vertex_count()).max(1);
        self.garment
            .rest
            .positions()
            .par_iter()
            .enumerate()
            .with_min_len(512)
            .map(|(v, p)| {
                std::array::from_fn(|axis| {
                    let row = &directions[(3 * v + axis) * k..(3 * v + axis + 1) * k];
                    let moved: f64 = row.iter().zip(shape).map(|(d, b)| f64::from(*d) * b).sum();
                    (p[axis] + moved) as f32
                })
            })
            .collect()
    }

    /// Where it lies on `body`, the one it was made for; computed when first asked for.
    pub(super) fn footprint(&self, body: &Body) -> &Footprint {
        self.footprint.get_or_init(|| Footprint::new(&self.garment, body))
    }

    /// Thickness (m) of the garments `below` at each vertex `[V]`, each of which counts as at least `each` thick (m).
    pub fn thickness_of(&self, below: &[&Arc<Self>], body: &Body, each: f64) -> Vec<f32> {
        let thickness = |garment: &Self| each.max(garment.energies.material().thickness);
        let below = below.iter().map(|garment| (garment.footprint(body), thickness(garment)));
        self.footprint(body).thickness_of(below)
    }

    /// About how much memory it takes (bytes).
    pub fn bytes(&self) -> usize {
        let mesh = self.vertex_count() * 24 + self.garment.rest.face_count() * 12;
        mesh + self.vertex_count() * ENERGIES + 4 * (self.skin_weights.len() + self.shape_directions.len())
    }

    /// About how much memory a garment of `vertices` vertices takes with `joints` joints and `shape_components` transferred
    /// shape components (bytes).
    pub fn expected_bytes(vertices: usize, joints: usize, shape_components: usize) -> usize {
        vertices * (48 + ENERGIES + 4 * (joints + 3 * shape_components))
    }
}
