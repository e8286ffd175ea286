//! The scene of a degenerate case, and its energies in either precision.

use crate::asset::Garment;
use clothcombo_physics::energy::{
    EnergySettings, GarmentEnergies, SceneEnergy, SceneGarment, SceneLayers, TermMap,
};
use clothcombo_physics::{EnergyError, Real, Surface, Topology, TriMesh, vec3};
use std::error::Error;
use std::sync::Arc;

/// Why a case has no scene or no energies: a mesh, a body or its energies are refused.
pub type CaseError = Box<dyn Error + Send + Sync>;

/// One garment of a degenerate case.
#[derive(Debug, Clone)]
pub struct CaseGarment {
    /// The garment with its rest mesh.
    pub garment: Garment,
    /// Positions before skinning `[V, 3]` (m).
    pub canonical: Vec<[f64; 3]>,
    /// Positions on the posed body `[V, 3]` (m).
    pub posed: Vec<[f64; 3]>,
}

/// Garments on a posed body, from the body outwards.
#[derive(Debug, Clone)]
pub struct CaseScene {
    /// The posed body (m).
    pub body: TriMesh,
    /// The garments.
    pub garments: Vec<CaseGarment>,
}

impl CaseScene {
    /// The energies of the scene: every garment with `weights`, every pair of garments as layers.
    ///
    /// # Errors
    /// [`EnergyError`] if a garment has no energies.
    pub fn energy<T: Real>(
        &self,
        settings: &EnergySettings,
        weights: TermMap<f64>,
    ) -> Result<SceneEnergy<T>, EnergyError> {
        let garments = self.garments.iter().map(|g| {
            let rest = &g.garment.rest;
            let energies = GarmentEnergies::new(rest, &Topology::new(rest), settings, g.garment.holding)?;
            Ok(SceneGarment {
                energies: Arc::new(energies),
                thickness_below: Vec::new(),
                holding_reference: rest.positions().iter().map(|p| vec3::from_f64(*p)).collect(),
                pull_back: None,
                weights,
            })
        });
        let garments = garments.collect::<Result<Vec<_>, EnergyError>>()?;
        let pairs = (0..garments.len()).flat_map(|outer| (0..outer).map(move |inner| (inner, outer)));
        let layers = pairs.map(|(inner, outer)| SceneLayers { inner, outer, weights }).collect();
        let body = Arc::new(Surface::from_mesh(&self.body));
        let energy = SceneEnergy { body, garments, layers, settings: *settings };
        energy.check()?;
        Ok(energy)
    }

    /// Posed positions of all garments, packed as [`SceneEnergy::evaluate`] takes them.
    pub fn posed<T: Real>(&self) -> Vec<[T; 3]> {
        self.garments.iter().flat_map(|g| &g.posed).map(|p| vec3::from_f64(*p)).collect()
    }

    /// Canonical positions of all garments, packed likewise.
    pub fn canonical<T: Real>(&self) -> Vec<[T; 3]> {
        self.garments.iter().flat_map(|g| &g.canonical).map(|p| vec3::from_f64(*p)).collect()
    }

    /// Vertices of all garments.
    pub fn vertex_count(&self) -> usize {
        self.garments.iter().map(|g| g.posed.len()).sum()
    }

    /// Every position rounded to `f32`; rest shapes, which are always `f64`, stay.
    pub(super) fn rounded(mut self) -> Self {
        let round = |p: &mut [f64; 3]| *p = p.map(|x| f64::from(x as f32));
        let mut body = self.body.positions().to_vec();
        body.iter_mut().for_each(round);
        self.body = self.body.with_positions(body).expect("f32 holds every coordinate of the suite");
        for g in &mut self.garments {
            g.canonical.iter_mut().chain(&mut g.posed).for_each(round);
        }
        self
    }
}
