//! What a garment is made of.

/// Constants of a thin, homogeneous, isotropic cloth.
///
/// The default reproduces the magnitudes of the ClothCombo paper (§Training) and of SNUG, from which it takes its material:
/// thickness and density give 0.2002 kg/m², the Lamé constants follow from a Young's modulus of 0.7e5 Pa and a Poisson's
/// ratio of 0.485 in plane stress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Thickness (m).
    pub thickness: f64,
    /// Density (kg/m³).
    pub density: f64,
    /// Second Lamé constant μ (Pa).
    pub mu: f64,
    /// First Lamé constant λ (Pa).
    pub lambda: f64,
    /// Bending stiffness k of a hinge (J/rad²); the paper's weight of 5 is not part of it.
    pub bending_stiffness: f64,
}

impl Default for Material {
    fn default() -> Self {
        Self { thickness: 4.7e-4, density: 426.0, mu: 2.36e4, lambda: 4.44e4, bending_stiffness: 3.96e-5 }
    }
}
