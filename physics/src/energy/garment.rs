//! Everything about one garment that its positions do not change.

use super::bending::Bending;
use super::body_collision::BodyCollision;
use super::gravity::Gravity;
use super::holding::Holding;
use super::layer_collision::InnerLayer;
use super::repulsion::Repulsion;
use super::strain::Strain;
use super::{ContactPoints, EnergyError, EnergySettings, GarmentTerm, Material, Term};
use crate::mesh::{Topology, TriMesh};
use crate::real::Real;

/// The energies of one garment, ready to be evaluated at any positions. Made once per garment and shared by `Arc`.
#[derive(Debug)]
pub struct GarmentEnergies<T: Real> {
    vertex_count: usize,
    material: Material,
    contact_points: ContactPoints,
    as_inner: InnerLayer,
    terms: Vec<(Term, Box<dyn GarmentTerm<T>>)>,
}

impl<T: Real> GarmentEnergies<T> {
    /// Prepares the energies of a garment with rest shape `rest`, made of the settings' material; `holding`: whether it hangs
    /// from nothing and is held.
    ///
    /// # Errors
    /// [`EnergyError::Setting`] for a setting out of range, [`EnergyError::TopologyMismatch`] for the topology of another
    /// mesh, [`EnergyError::NoArea`] for a mesh whose faces all have zero area. Single faces without area are fine.
    pub fn new(
        rest: &TriMesh,
        topology: &Topology,
        settings: &EnergySettings,
        holding: bool,
    ) -> Result<Self, EnergyError> {
        settings.check()?;
        let vertex_count = rest.vertex_count();
        if topology.vertex_count() != vertex_count {
            return Err(EnergyError::TopologyMismatch {
                topology: topology.vertex_count(),
                mesh: vertex_count,
            });
        }
        let area = rest.area();
        if !(area.is_finite() && area > 0.0) {
            return Err(EnergyError::NoArea { faces: rest.face_count() });
        }
        let material = settings.material;
        let strain = Strain::new(rest, &material, settings.needle_ratio);
        let bending = Bending::new(rest, &topology.hinges, material.bending_stiffness);
        let contact_points = ContactPoints::new(rest, topology);
        let mut terms: Vec<(Term, Box<dyn GarmentTerm<T>>)> = vec![
            (Term::Strain, Box::new(strain)),
            (Term::Bending, Box::new(bending)),
            (Term::Gravity, Box::new(Gravity::new(rest, &material, settings.gravity_acceleration))),
            (
                Term::BodyCollision,
                Box::new(BodyCollision { points: contact_points.clone(), thickness: material.thickness }),
            ),
            (Term::Repulsion, Box::new(Repulsion::new(topology))),
        ];
        if holding {
            terms.push((Term::Holding, Box::new(Holding::new(rest, settings.holding_fraction))));
        }
        let as_inner = InnerLayer::new(rest, topology);
        Ok(Self { vertex_count, material, contact_points, as_inner, terms })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// What it is made of.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Whether the garment is held.
    pub fn has_holding(&self) -> bool {
        self.terms.iter().any(|(term, _)| *term == Term::Holding)
    }

    /// The energies of this garment, in the order of [`Term::ALL`].
    pub fn terms(&self) -> impl Iterator<Item = (Term, &dyn GarmentTerm<T>)> {
        self.terms.iter().map(|(term, energy)| (*term, energy.as_ref()))
    }

    /// Where it is kept off the body and other garments.
    pub fn contact_points(&self) -> &ContactPoints {
        &self.contact_points
    }

    /// As others see it that lie on it.
    pub(crate) fn as_inner(&self) -> &InnerLayer {
        &self.as_inner
    }
}
