//! Garments on one body, with the weights of all their energies.

use std::ops::Range;
use std::sync::Arc;

use super::garment_term::HeightRow;
use super::holding::height_rows;
use super::{EnergyError, EnergySettings, GarmentEnergies, Term, TermMap};
use crate::query::Surface;
use crate::real::Real;
use crate::transform::Transform;

/// One garment of a scene.
#[derive(Debug, Clone)]
pub struct SceneGarment<T: Real> {
    /// Its energies.
    pub energies: Arc<GarmentEnergies<T>>,
    /// Canonical positions that the holding energy measures against `[V, 3]` (m); may be empty for a garment that is not
    /// held.
    pub holding_reference: Vec<[T; 3]>,
    /// Heights before skinning as functions of posed positions `[V]`, which the holding energy then acts on
    /// ([`super::holding`]); `None`: it acts on canonical positions (the paper's form).
    pub pull_back: Option<Vec<HeightRow>>,
    /// Thickness of the garments below each vertex `[V]` (m) that are not in the scene: the body is that much thicker there.
    /// Empty: there are none.
    pub thickness_below: Vec<T>,
    /// Weight of every term; entries of layer terms are ignored.
    pub weights: TermMap<f64>,
}

impl<T: Real> SceneGarment<T> {
    /// The largest thickness of the garments below (m).
    pub(super) fn most_thickness(&self) -> f64 {
        self.thickness_below.iter().fold(0.0, |most, t| most.max(Real::to_f64(*t)))
    }

    /// Margin between it and the body, or the garments between them (m).
    pub(super) fn body_margin(&self, settings: &EnergySettings) -> f64 {
        settings.body_margin(self.energies.material().thickness)
    }

    /// Whether `term` of this garment acts on canonical positions (before skinning).
    pub(super) fn is_canonical(&self, term: Term) -> bool {
        term == Term::Holding && self.pull_back.is_none()
    }
}

/// Two garments of a scene, one over the other.
#[derive(Debug, Clone)]
pub struct SceneLayers {
    /// Index of the garment nearer to the body.
    pub inner: usize,
    /// Index of the garment over it.
    pub outer: usize,
    /// Weight of every layer term; other entries are ignored.
    pub weights: TermMap<f64>,
}

/// Garments on a fixed posed body, with the weights of all their energies.
#[derive(Debug, Clone)]
pub struct SceneEnergy<T: Real> {
    /// The posed body.
    pub body: Arc<Surface<T>>,
    /// The garments, from the body outwards.
    pub garments: Vec<SceneGarment<T>>,
    /// The pairs that the layer terms are about.
    pub layers: Vec<SceneLayers>,
    /// Constants and switches. Gravity and the share of held vertices must be those the energies were made with; the material is
    /// that of [`GarmentEnergies::material`].
    pub settings: EnergySettings,
}

impl<T: Real> SceneEnergy<T> {
    /// The settings of the collision of a pair.
    pub(super) fn settings_of(&self, pair: &SceneLayers) -> EnergySettings {
        let thickness = |garment: usize| self.garments[garment].energies.material().thickness;
        self.settings.for_pair([thickness(pair.inner), thickness(pair.outer)])
    }

    /// Number of vertices of all garments.
    pub fn vertex_count(&self) -> usize {
        self.garments.iter().map(|g| g.energies.vertex_count()).sum()
    }

    /// The same garments, each by itself: without the pairs.
    pub fn without_layers(&self) -> Self {
        let Self { body, garments, settings, .. } = self;
        Self { body: body.clone(), garments: garments.clone(), layers: Vec::new(), settings: *settings }
    }

    /// The same scene with [`EnergySettings::continuous`] and without the layer distance, whose pairs change with the nearest
    /// body vertex: what states of a scene are compared by. Continuous for one garment; the layer collision keeps a jump.
    #[must_use]
    pub fn continuous(mut self) -> Self {
        self.settings = self.settings.continuous();
        self.layers.iter_mut().for_each(|pair| pair.weights[Term::LayerDistance] = 0.0);
        self
    }

    /// The same scene with no other weights than those of `term`; `None` if it has none.
    pub fn only(&self, term: Term) -> Option<Self> {
        let mut scene = self.clone();
        let mut present = false;
        let garments = scene.garments.iter_mut().map(|g| &mut g.weights);
        for weights in garments.chain(scene.layers.iter_mut().map(|l| &mut l.weights)) {
            let weight = weights[term];
            *weights = TermMap::filled(0.0);
            weights[term] = weight;
            present |= weight != 0.0;
        }
        present.then_some(scene)
    }

    /// Checks that the parts fit together.
    ///
    /// # Errors
    /// [`EnergyError`] naming the garment, pair, weight or setting that does not.
    pub fn check(&self) -> Result<(), EnergyError> {
        self.settings.check()?;
        for (garment, g) in self.garments.iter().enumerate() {
            let (expected, found) = (g.energies.vertex_count(), g.holding_reference.len());
            if found != expected && g.energies.has_holding() {
                return Err(EnergyError::HoldingReference { garment, expected, found });
            }
            let found = g.thickness_below.len();
            if found != expected && found != 0 {
                return Err(EnergyError::ThicknessBelow { garment, expected, found });
            }
        }
        let garments = self.garments.len();
        for (pair, &SceneLayers { inner, outer, .. }) in self.layers.iter().enumerate() {
            if inner >= outer || outer >= garments {
                return Err(EnergyError::LayerPair { pair, inner, outer, garments });
            }
        }
        let all = self.garments.iter().map(|g| &g.weights).chain(self.layers.iter().map(|l| &l.weights));
        for (term, &value) in all.flat_map(TermMap::iter) {
            if !value.is_finite() {
                return Err(EnergyError::Weight { term: term.name(), value });
            }
        }
        Ok(())
    }

    /// Whether any garment is held with a weight: if not, the canonical gradient is zero.
    pub fn needs_canonical(&self) -> bool {
        let mut terms = self.garments.iter().flat_map(|g| g.energies.terms().map(move |(term, _)| (g, term)));
        terms.any(|(g, term)| g.is_canonical(term) && g.weights[term] != 0.0)
    }

    /// The same scene with the holding energy on posed positions, pulled back by `transforms` `[ΣV]`: the initial blended
    /// skinning of every vertex, canonical → posed.
    ///
    /// # Panics
    /// If there is not one transform per vertex.
    #[must_use]
    pub fn pulled_back(mut self, transforms: &[Transform]) -> Self {
        assert_eq!(transforms.len(), self.vertex_count(), "skinning transforms of all garments of the scene");
        for (garment, range) in self.ranges().into_iter().enumerate() {
            let garment = &mut self.garments[garment];
            garment.pull_back = garment.energies.has_holding().then(|| height_rows(&transforms[range]));
        }
        self
    }

    /// The vertices of every garment in the packed positions.
    pub(crate) fn ranges(&self) -> Vec<Range<usize>> {
        let mut start = 0;
        let next = |g: &SceneGarment<T>| {
            let range = start..start + g.energies.vertex_count();
            start = range.end;
            range
        };
        self.garments.iter().map(next).collect()
    }
}
