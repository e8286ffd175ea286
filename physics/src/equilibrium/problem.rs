//! The energy of a scene as a function of posed positions alone.

use super::EquilibriumError;
use super::kinks::{self, Kink};
use crate::energy::{CurvatureSink, LayerTouch, SceneEnergy, Term};
use crate::transform::{Transform, apply, apply_transposed, inverse};
use crate::vec3::{accumulate, norm_squared};

/// Linear parts with a smaller determinant cannot be undone.
const SMALLEST_DETERMINANT: f64 = 1e-6;

/// A scene to be brought into equilibrium.
#[derive(Debug)]
pub struct Problem<'a> {
    energy: &'a SceneEnergy<f64>,
    /// Posed → canonical, per vertex; `None`: they are the same, or nothing asks for canonical positions.
    inverse: Option<Vec<Transform>>,
    /// The scene with one of its terms each, for the relative gradient.
    single_terms: Vec<SceneEnergy<f64>>,
}

impl<'a> Problem<'a> {
    /// `transforms` `[ΣV]`: the blended skinning transform of every vertex, canonical → posed; `None`: canonical positions
    /// are the posed ones.
    ///
    /// # Errors
    /// When the scene does not pass its check, the number of transforms is not that of vertices, or a transform that is
    /// needed (some garment is held with a weight) is singular.
    pub fn new(
        energy: &'a SceneEnergy<f64>,
        transforms: Option<&[Transform]>,
    ) -> Result<Self, EquilibriumError> {
        energy.check()?;
        let (expected, needed) = (energy.vertex_count(), energy.needs_canonical());
        let inverse = match transforms {
            Some(transforms) if transforms.len() != expected => {
                let (what, found) = ("skinning transforms", transforms.len());
                return Err(EquilibriumError::Count { what, expected, found });
            }
            Some(transforms) if needed => {
                let undone = transforms.iter().enumerate().map(|(vertex, t)| {
                    inverse(t, SMALLEST_DETERMINANT)
                        .map_err(|determinant| EquilibriumError::Singular { vertex, determinant })
                });
                Some(undone.collect::<Result<_, _>>()?)
            }
            _ => None,
        };
        let single_terms = Term::ALL.into_iter().filter_map(|term| energy.only(term)).collect();
        Ok(Self { energy, inverse, single_terms })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.energy.vertex_count()
    }

    /// Canonical positions of vertices at `posed` `[ΣV, 3]` [m].
    pub fn canonical(&self, posed: &[[f64; 3]]) -> Vec<[f64; 3]> {
        match &self.inverse {
            Some(inverse) => inverse.iter().zip(posed).map(|(t, p)| apply(t, *p)).collect(),
            None => posed.to_vec(),
        }
    }

    /// Weighted sum of all energies at `posed` `[ΣV, 3]` [m].
    ///
    /// # Panics
    /// If `posed` does not have one entry per vertex.
    pub fn value(&self, posed: &[[f64; 3]]) -> f64 {
        self.energy.value(posed, &self.canonical(posed)).total
    }

    /// The same, with its gradient `[ΣV, 3]`.
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn value_and_gradient(&self, posed: &[[f64; 3]]) -> (f64, Vec<[f64; 3]>) {
        self.evaluate(self.energy, posed)
    }

    /// `Σ_t |w_t ∇E_t|` over the terms [N]: what a gradient is compared with (see [`super`]).
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn force_scale(&self, posed: &[[f64; 3]]) -> f64 {
        self.single_terms.iter().map(|energy| norm(&self.evaluate(energy, posed).1)).sum()
    }

    /// Relative gradient at `posed` (see [`super`]); 0 where no force acts at all.
    ///
    /// # Panics
    /// As [`value`](Self::value).
    pub fn relative_gradient(&self, posed: &[[f64; 3]]) -> f64 {
        let (_, gradient) = self.value_and_gradient(posed);
        relative(self.unbalanced_norm(posed, &gradient), self.force_scale(posed))
    }

    /// Norm of `gradient`, which is that at `posed`, without what balances at kinks.
    pub(super) fn unbalanced_norm(&self, posed: &[[f64; 3]], gradient: &[[f64; 3]]) -> f64 {
        let mut gradient = gradient.to_vec();
        kinks::balance(&self.kinks(posed, &gradient, 0.0), &mut gradient);
        norm(&gradient)
    }

    /// Vertices that rest on a kink, see [`kinks::kinks`].
    pub(super) fn kinks(&self, posed: &[[f64; 3]], gradient: &[[f64; 3]], least: f64) -> Vec<Kink> {
        kinks::kinks(self.energy, posed, gradient, least)
    }

    /// Positions with the vertices that are driven against a kink on it; `None` if there is no such vertex.
    pub(super) fn onto_kinks(
        &self,
        posed: &[[f64; 3]],
        gradient: &[[f64; 3]],
        least: f64,
    ) -> Option<Vec<[f64; 3]>> {
        let moved = kinks::onto_kinks(self.energy, posed, gradient, least);
        let mut positions = posed.to_vec();
        moved.iter().for_each(|(v, p)| positions[*v] = *p);
        (!moved.is_empty()).then_some(positions)
    }

    /// As [`SceneEnergy::couples_garments`].
    pub(super) fn couples_garments(&self) -> bool {
        self.energy.couples_garments()
    }

    /// As [`SceneEnergy::layer_touches`].
    pub(super) fn layer_touches(&self, posed: &[[f64; 3]]) -> Vec<LayerTouch> {
        self.energy.layer_touches(posed)
    }

    /// Passes a positive semidefinite approximation of the Hessian with respect to posed positions to `sink`.
    pub(super) fn curvature(&self, posed: &[[f64; 3]], sink: &mut dyn CurvatureSink) {
        let mut in_canonical = Collected::default();
        self.energy.curvature(posed, &self.canonical(posed), sink, &mut in_canonical);
        for (i, j, block) in in_canonical.0 {
            let block = match &self.inverse {
                // Aᵀ-congruence: rows by the transform of i, columns by that of j.
                Some(inverse) => {
                    let right: [[f64; 3]; 3] = block.map(|row| apply_transposed(&inverse[j], row));
                    let columns: [[f64; 3]; 3] = std::array::from_fn(|c| {
                        apply_transposed(&inverse[i], [right[0][c], right[1][c], right[2][c]])
                    });
                    std::array::from_fn(|r| std::array::from_fn(|c| columns[c][r]))
                }
                None => block,
            };
            sink.add(i, j, block);
        }
    }

    fn evaluate(&self, energy: &SceneEnergy<f64>, posed: &[[f64; 3]]) -> (f64, Vec<[f64; 3]>) {
        let value = energy.evaluate(posed, &self.canonical(posed));
        let mut gradient = value.posed_gradient;
        for (v, (sum, g)) in gradient.iter_mut().zip(&value.canonical_gradient).enumerate() {
            let pulled = self.inverse.as_ref().map_or(*g, |inverse| apply_transposed(&inverse[v], *g));
            accumulate(sum, pulled);
        }
        (value.total, gradient)
    }
}

/// Blocks kept as they come.
#[derive(Default)]
struct Collected(Vec<(usize, usize, [[f64; 3]; 3])>);

impl CurvatureSink for Collected {
    fn add(&mut self, i: usize, j: usize, block: [[f64; 3]; 3]) {
        self.0.push((i, j, block));
    }
}

/// `|g|/scale`, 0 for no force at all.
pub(super) fn relative(gradient_norm: f64, scale: f64) -> f64 {
    if gradient_norm == 0.0 { 0.0 } else { gradient_norm / scale }
}

/// Euclidean norm over all coordinates.
pub(super) fn norm(x: &[[f64; 3]]) -> f64 {
    x.iter().map(|x| norm_squared(*x)).sum::<f64>().sqrt()
}
