//! The switches and constants of the energies.

use super::{ContactSamples, EnergyError, Material};
use crate::query::Distance;

/// How the signed distance of an outer vertex to an inner garment is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LayerContact {
    /// `(x − x_g)·n_g` with the nearest vertex `g` and its area-weighted normal: the paper's form.
    #[default]
    NearestVertex,
    /// The distance to the closest point of the surface.
    ClosestPoint,
}

/// Which outer vertices take part in the layer collision.
///
/// As printed, the paper's term has no cut-off: past an open hem the nearest inner vertex lies sideways, and the distance
/// along its normal is meaningless. The gate keeps vertices that have inner cloth under them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerGate {
    /// Largest offset along the inner surface, in median edge lengths of the inner garment at rest.
    pub tangential_edges: f64,
    /// Largest |d| (m).
    pub depth: f64,
}

impl Default for LayerGate {
    fn default() -> Self {
        Self { tangential_edges: 0.75, depth: 0.05 }
    }
}

/// Everything that the energies leave open, apart from their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergySettings {
    /// The cloth of garments that say nothing else.
    pub material: Material,
    /// Rest triangles flatter than this ratio of height to longest edge are measured by the strain as if they had it: else a
    /// needle is a spring of unbounded stiffness. 0: as printed in the paper, which has no floor.
    pub needle_ratio: f64,
    /// Margin ε between garment and body (m); paper: 0.002.
    pub body_collision_epsilon: f64,
    /// Points of a garment that are kept off the body; paper: vertices.
    pub body_samples: ContactSamples,
    /// Margin ε between two garments (m); paper: 0.002.
    pub layer_collision_epsilon: f64,
    /// Points of the outer garment that are kept off the inner one; paper: vertices.
    pub layer_samples: ContactSamples,
    /// How the distance to the body is measured; paper: nearest vertex.
    pub distance: Distance,
    /// Vertices of one garment repel each other below this distance (m); paper: 0.1.
    pub repulsion_radius: f64,
    /// Whether the repulsion is divided by the number of vertices, which the paper's magnitudes need; off: as printed.
    pub repulsion_normalised: bool,
    /// Random pairs per vertex instead of all close ones: an estimate of the same sum that is unbiased over the samples. `None`
    /// (default): all pairs.
    pub repulsion_subset: Option<usize>,
    /// Number of the sample that the subset is. Where it stays the same (default: 0), the energy is a function of positions
    /// alone. May differ from scene to scene of a garment.
    pub repulsion_sample: u32,
    /// The same repulsion forces from an energy without the printed form's jump at the radius: what a solver with a line
    /// search needs. Off (default): as printed.
    pub repulsion_continuous: bool,
    /// Gravitational acceleration (m/s²), along −y.
    pub gravity_acceleration: f64,
    /// How the distance to an inner garment is measured; paper: nearest vertex.
    pub layer_contact: LayerContact,
    /// Which outer vertices the layer collision counts; `None`: all, as printed in the paper. By the closest point, cloth that
    /// lies deeper than the gate has faded out, and `None` stands for the default.
    pub layer_gate: Option<LayerGate>,
    /// The layer distance counts vertices closer to the body than this (m); paper: 0.1.
    pub layer_distance_radius: f64,
    /// Share of the vertices, highest at rest first, that the holding energy holds; paper: 0.1.
    pub holding_fraction: f64,
}

impl Default for EnergySettings {
    fn default() -> Self {
        Self {
            material: Material::default(),
            needle_ratio: 1e-2,
            body_collision_epsilon: 0.002,
            body_samples: ContactSamples::Vertices,
            layer_collision_epsilon: 0.002,
            layer_samples: ContactSamples::Vertices,
            distance: Distance::NearestVertex,
            repulsion_radius: 0.1,
            repulsion_normalised: true,
            repulsion_subset: None,
            repulsion_sample: 0,
            repulsion_continuous: false,
            gravity_acceleration: 9.81,
            layer_contact: LayerContact::default(),
            layer_gate: Some(LayerGate::default()),
            layer_distance_radius: 0.1,
            holding_fraction: 0.1,
        }
    }
}

impl EnergySettings {
    /// The paper's printed form of every term (repulsion over `N`, which its magnitudes need): what a score reports.
    pub fn printed() -> Self {
        Self { layer_gate: None, needle_ratio: 0.0, ..Self::default() }
    }

    /// The same energies without most of their jumps, which no step can be judged across and no force can balance: the distance
    /// to the outside of the body, whose parts may intersect when posed; all pairs in the repulsion, from which the constant of
    /// each is taken off; the distance to the closest point of an inner garment, which still jumps between two of its sheets
    /// ([`layer_collision`](super::layer_collision)).
    #[must_use]
    pub fn continuous(self) -> Self {
        Self {
            distance: Distance::Union,
            repulsion_subset: None,
            repulsion_continuous: true,
            layer_contact: LayerContact::ClosestPoint,
            ..self
        }
    }

    /// Margin between the body and a garment of `thickness` (m): ε, and half the thickness where that is more, since positions are
    /// those of the middle of the cloth.
    pub fn body_margin(&self, thickness: f64) -> f64 {
        self.body_collision_epsilon.max(0.5 * thickness)
    }

    /// The settings for two garments of these thicknesses (m), whose middles are kept half their sum apart where that is more
    /// than ε.
    pub(super) fn for_pair(&self, thickness: [f64; 2]) -> Self {
        let [inner, outer] = thickness;
        let epsilon = self.layer_collision_epsilon.max(0.5 * (inner + outer));
        // A gate that is less deep than contact begins would cut it off with a jump.
        let layer_gate = self.layer_gate.map(|gate| LayerGate { depth: gate.depth.max(epsilon), ..gate });
        Self { layer_collision_epsilon: epsilon, layer_gate, ..*self }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`EnergyError::Setting`] names the first that is out of range.
    pub fn check(&self) -> Result<(), EnergyError> {
        let gate = self.layer_gate.unwrap_or_default();
        let fail = |setting, value, expected| Err(EnergyError::Setting { setting, value, expected });
        for (setting, value) in [
            ("material.density", self.material.density),
            ("material.mu", self.material.mu),
            ("material.lambda", self.material.lambda),
            ("material.bending_stiffness", self.material.bending_stiffness),
            ("body_collision_epsilon", self.body_collision_epsilon),
            ("layer_collision_epsilon", self.layer_collision_epsilon),
            ("gravity_acceleration", self.gravity_acceleration),
            ("layer_distance_radius", self.layer_distance_radius),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return fail(setting, value, "finite and not negative");
            }
        }
        for (setting, value) in [
            ("material.thickness", self.material.thickness),
            ("repulsion_radius", self.repulsion_radius),
            ("layer_gate.tangential_edges", gate.tangential_edges),
            ("layer_gate.depth", gate.depth),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return fail(setting, value, "finite and greater than 0");
            }
        }
        // Of an equilateral triangle it is 0.87: with as much, every triangle would count as a needle.
        if !(0.0..=0.5).contains(&self.needle_ratio) {
            return fail("needle_ratio", self.needle_ratio, "between 0 and 0.5");
        }
        if !(0.0..=1.0).contains(&self.holding_fraction) {
            return fail("holding_fraction", self.holding_fraction, "between 0 and 1");
        }
        if self.repulsion_subset == Some(0) {
            return fail("repulsion_subset", 0.0, "at least 1 partner per vertex, or left out for all pairs");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid_and_bad_values_are_named() {
        assert_eq!(EnergySettings::default().check(), Ok(()));
        let bad = EnergySettings { repulsion_radius: f64::NAN, ..EnergySettings::default() };
        assert!(matches!(bad.check(), Err(EnergyError::Setting { setting: "repulsion_radius", .. })));
        for needle_ratio in [-0.1, 0.6, f64::NAN] {
            let bad = EnergySettings { needle_ratio, ..EnergySettings::default() };
            assert!(matches!(bad.check(), Err(EnergyError::Setting { setting: "needle_ratio", .. })));
        }
        let bad = EnergySettings { holding_fraction: 1.5, ..EnergySettings::default() };
        assert!(matches!(bad.check(), Err(EnergyError::Setting { setting: "holding_fraction", .. })));
        let bad = EnergySettings { repulsion_subset: Some(0), ..EnergySettings::default() };
        assert!(matches!(bad.check(), Err(EnergyError::Setting { setting: "repulsion_subset", .. })));
    }
}
