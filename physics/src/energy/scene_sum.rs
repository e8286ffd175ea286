//! The weighted sum of all energies of a scene, with its gradient.

use rayon::prelude::*;

use super::elements::GRAIN;
use super::layer_collision::{OuterPoints, PosedInnerLayer};
use super::layer_distance::{BodyBuckets, LayerGaps, layer_distance};
use super::{EnergySettings, GarmentState, SceneEnergy, SceneLayers, Term, TermMap, Weighted};
use crate::query::Gap;
use crate::query::near_faces::NearFaces;
use crate::real::Real;
use crate::vec3;

/// Values and gradients of a [`SceneEnergy`].
#[derive(Debug, Clone, PartialEq)]
pub struct SceneValue<T> {
    /// `Σ weight·raw`.
    pub total: f64,
    /// `∂total/∂posed` `[ΣV, 3]`; empty if no gradient was asked for.
    pub posed_gradient: Vec<[T; 3]>,
    /// `∂total/∂canonical` `[ΣV, 3]`; empty if no gradient was asked for.
    pub canonical_gradient: Vec<[T; 3]>,
    /// Raw value of every term of every garment; `None`: not evaluated.
    pub garments: Vec<TermMap<Option<f64>>>,
    /// Raw value of every layer term of every pair; `None`: not evaluated.
    pub layers: Vec<TermMap<Option<f64>>>,
}

/// `Σ weight·raw` over the terms that were evaluated.
pub fn weighted(weights: &TermMap<f64>, raw: &TermMap<Option<f64>>) -> f64 {
    let terms = raw.iter().filter(|(term, _)| weights[*term] != 0.0);
    terms.filter_map(|(term, value)| value.map(|v| weights[term] * v)).sum()
}

/// Whether a term of this weight counts.
pub(super) fn is_weighted(weight: f64) -> bool {
    weight != 0.0
}

/// What several terms share of a garment at its present positions.
pub(super) struct Shared<'a, T: Real> {
    state: GarmentState<'a, T>,
    gaps: Vec<Gap<T>>,
    buckets: Option<BodyBuckets>,
    as_inner: Option<PosedInnerLayer<T>>,
}

impl<T: Real> Shared<'_, T> {
    pub fn state(&self) -> GarmentState<'_, T> {
        GarmentState { gaps: &self.gaps, ..self.state }
    }

    fn layer_gaps(&self) -> Option<LayerGaps<'_, T>> {
        let gaps = &self.gaps[..self.gaps.len().min(self.state.posed.len())];
        self.buckets.as_ref().map(|buckets| LayerGaps { gaps, buckets })
    }
}

/// What is remembered of the contact points of every garment, for positions that change little from call to call.
pub(crate) type BodyMemory = Vec<Vec<NearFaces>>;

/// The memory of every one of `count` garments, if there is one.
pub(super) fn memories(memory: Option<&mut BodyMemory>, count: usize) -> Vec<Option<&mut Vec<NearFaces>>> {
    match memory {
        None => (0..count).map(|_| None).collect(),
        Some(memory) => {
            memory.resize_with(count, Vec::new);
            memory.iter_mut().map(Some).collect()
        }
    }
}

/// Raw values of one garment and its weighted gradients by posed and canonical positions, if they are asked for.
struct GarmentValue<T> {
    raw: TermMap<Option<f64>>,
    posed: Option<Vec<[T; 3]>>,
    canonical: Option<Vec<[T; 3]>>,
}

/// Raw values of one pair and its weighted gradients at the inner and the outer garment.
struct PairValue<T> {
    raw: TermMap<Option<f64>>,
    gradients: Option<[Vec<[T; 3]>; 2]>,
}

impl<T: Real> SceneEnergy<T> {
    /// Value and gradient of the weighted sum. Terms of weight 0 are not evaluated.
    ///
    /// `posed` and `canonical` hold the vertices of all garments in order, `[ΣV, 3]` (m); `canonical` may be empty when no
    /// garment is held with a weight ([`needs_canonical`](Self::needs_canonical)).
    ///
    /// # Panics
    /// If a length is not that of the scene, or a scene does not pass [`check`](Self::check): these are errors of the
    /// calling code, not of its input.
    pub fn evaluate(&self, posed: &[[T; 3]], canonical: &[[T; 3]]) -> SceneValue<T> {
        self.run(posed, canonical, is_weighted, true, None)
    }

    /// The same, for positions that are near those of earlier calls with the same `memory`.
    ///
    /// # Panics
    /// As [`evaluate`](Self::evaluate).
    pub(crate) fn evaluate_near(&self, posed: &[[T; 3]], memory: &mut BodyMemory) -> SceneValue<T> {
        self.run(posed, &[], is_weighted, true, Some(memory))
    }

    /// The same value, without gradients.
    ///
    /// # Panics
    /// As [`evaluate`](Self::evaluate).
    pub fn value(&self, posed: &[[T; 3]], canonical: &[[T; 3]]) -> SceneValue<T> {
        self.run(posed, canonical, is_weighted, false, None)
    }

    /// All raw values, whatever the weights, without gradients: what a score reports. A garment that is not held has no
    /// holding energy, and none has one if `canonical` is empty.
    ///
    /// # Panics
    /// As [`evaluate`](Self::evaluate).
    pub fn raw(&self, posed: &[[T; 3]], canonical: &[[T; 3]]) -> SceneValue<T> {
        self.run(posed, canonical, |_| true, false, None)
    }

    /// Evaluates the terms with weights that are active, as far as there is input for them.
    fn run(
        &self,
        posed: &[[T; 3]],
        canonical: &[[T; 3]],
        is_active: fn(f64) -> bool,
        with_gradient: bool,
        memory: Option<&mut BodyMemory>,
    ) -> SceneValue<T> {
        let count = self.vertex_count();
        assert_eq!(posed.len(), count, "posed positions of all garments of the scene");
        assert!(
            canonical.len() == count || canonical.is_empty() && (is_active(0.0) || !self.needs_canonical()),
            "{} canonical positions for the {count} vertices of the scene",
            canonical.len()
        );
        let shared: Vec<Shared<'_, T>> = self
            .ranges()
            .into_par_iter()
            .zip(memories(memory, self.garments.len()))
            .enumerate()
            .map(|(i, (range, near))| {
                self.share(i, &posed[range.clone()], canonical.get(range).unwrap_or(&[]), is_active, near)
            })
            .collect();

        let garments: Vec<GarmentValue<T>> = self
            .garments
            .par_iter()
            .zip(&shared)
            .map(|(garment, shared)| {
                let zeros = || with_gradient.then(|| vec![vec3::zero(); shared.state.posed.len()]);
                let mut value = GarmentValue { raw: TermMap::default(), posed: zeros(), canonical: zeros() };
                for (term, energy) in garment.energies.terms() {
                    let weight = garment.weights[term];
                    let is_canonical = garment.is_canonical(term);
                    if !is_active(weight) || is_canonical && canonical.is_empty() {
                        continue;
                    }
                    let space = if is_canonical { &mut value.canonical } else { &mut value.posed };
                    let target = space.as_deref_mut().map(|gradient| Weighted { weight, gradient });
                    value.raw[term] = Some(energy.evaluate(&shared.state(), target));
                }
                value
            })
            .collect();
        let joined = |of: fn(&GarmentValue<T>) -> &Option<Vec<[T; 3]>>| {
            garments.iter().filter_map(|value| of(value).as_deref()).collect::<Vec<_>>().concat()
        };
        let mut posed_gradient = joined(|value| &value.posed);
        let canonical_gradient = joined(|value| &value.canonical);

        let pairs: Vec<PairValue<T>> =
            self.layers.par_iter().map(|pair| self.pair(pair, &shared, is_active, with_gradient)).collect();
        let ranges = self.ranges();
        for (pair, value) in self.layers.iter().zip(&pairs) {
            for (garment, gradient) in
                [pair.inner, pair.outer].into_iter().zip(value.gradients.iter().flatten())
            {
                for (sum, g) in posed_gradient[ranges[garment].clone()].iter_mut().zip(gradient) {
                    vec3::accumulate(sum, *g);
                }
            }
        }
        let garments: Vec<TermMap<Option<f64>>> = garments.into_iter().map(|value| value.raw).collect();
        let layers: Vec<TermMap<Option<f64>>> = pairs.into_iter().map(|pair| pair.raw).collect();
        let total =
            self.garments.iter().zip(&garments).map(|(g, raw)| weighted(&g.weights, raw)).sum::<f64>()
                + self.layers.iter().zip(&layers).map(|(l, raw)| weighted(&l.weights, raw)).sum::<f64>();
        SceneValue { total, posed_gradient, canonical_gradient, garments, layers }
    }

    /// Everything that more than one term needs of garment `i`, each part only if an active term does.
    pub(super) fn share<'a>(
        &'a self,
        i: usize,
        posed: &'a [[T; 3]],
        canonical: &'a [[T; 3]],
        is_active: fn(f64) -> bool,
        near: Option<&mut Vec<NearFaces>>,
    ) -> Shared<'a, T> {
        let garment = &self.garments[i];
        let in_pair = |term: Term, is_side: fn(&SceneLayers, usize) -> bool| {
            self.layers.iter().any(|pair| is_side(pair, i) && is_active(pair.weights[term]))
        };
        let in_distance = in_pair(Term::LayerDistance, |pair, i| pair.inner == i || pair.outer == i);
        let is_inner = in_pair(Term::LayerCollision, |pair, i| pair.inner == i);
        let needs_gaps = in_distance || is_active(garment.weights[Term::BodyCollision]);

        let gaps = match needs_gaps {
            true => self.gaps(i, posed, in_distance, near),
            false => Vec::new(),
        };
        let body_vertex_count = self.body.positions.len();
        let radius = self.settings.layer_distance_radius;
        Shared {
            state: GarmentState {
                posed,
                canonical,
                holding_reference: &garment.holding_reference,
                pull_back: garment.pull_back.as_deref(),
                thickness_below: &garment.thickness_below,
                gaps: &[],
                settings: &self.settings,
            },
            buckets: in_distance.then(|| BodyBuckets::new(&gaps[..posed.len()], body_vertex_count, radius)),
            gaps,
            as_inner: is_inner.then(|| garment.energies.as_inner().posed(posed, self.settings.layer_contact)),
        }
    }

    /// Signed distances of the contact points of garment `i` to the body; unless `exact`, only where they count as contact.
    fn gaps(
        &self,
        i: usize,
        posed: &[[T; 3]],
        exact: bool,
        near: Option<&mut Vec<NearFaces>>,
    ) -> Vec<Gap<T>> {
        let EnergySettings { distance, body_samples, .. } = self.settings;
        let garment = &self.garments[i];
        let points = garment.energies.contact_points().at(posed, body_samples);
        let points = points.par_iter().with_min_len(GRAIN / 4);
        let margin = garment.body_margin(&self.settings) + garment.most_thickness();
        let reach = if exact { f64::INFINITY } else { margin };
        let Some(near) = near else {
            return points.map(|p| self.body.gap_within(*p, distance, reach)).collect();
        };
        near.resize_with(points.len(), NearFaces::default);
        points.zip(near).map(|(p, near)| self.body.gap_near(*p, distance, reach, near)).collect()
    }

    /// The points of the outer garment of a pair that are kept off the inner one.
    pub(super) fn outer_points<'a>(&'a self, pair: &SceneLayers, posed: &[[T; 3]]) -> OuterPoints<'a, T> {
        OuterPoints::new(
            self.garments[pair.outer].energies.contact_points(),
            posed,
            self.settings.layer_samples,
        )
    }

    fn pair(
        &self,
        pair: &SceneLayers,
        shared: &[Shared<'_, T>],
        is_active: fn(f64) -> bool,
        with_gradient: bool,
    ) -> PairValue<T> {
        let (inner, outer) = (&shared[pair.inner], &shared[pair.outer]);
        let zeros = |of: &Shared<'_, T>| vec![vec3::zero(); of.state.posed.len()];
        let mut gradients = with_gradient.then(|| [zeros(inner), zeros(outer)]);
        let mut raw = TermMap::default();
        for (term, &weight) in pair.weights.iter() {
            if !term.is_layer_term() || !is_active(weight) {
                continue;
            }
            let targets = gradients
                .as_mut()
                .map(|[a, b]| [Weighted { weight, gradient: a }, Weighted { weight, gradient: b }]);
            raw[term] = match term {
                Term::LayerCollision => inner.as_inner.as_ref().map(|posed_inner| {
                    self.garments[pair.inner].energies.as_inner().evaluate(
                        inner.state.posed,
                        posed_inner,
                        self.outer_points(pair, outer.state.posed),
                        &self.settings_of(pair),
                        targets,
                    )
                }),
                Term::LayerDistance => inner.layer_gaps().zip(outer.layer_gaps()).map(|(inner, outer)| {
                    layer_distance(inner, outer, self.settings.layer_distance_radius, targets)
                }),
                Term::Strain
                | Term::Bending
                | Term::Gravity
                | Term::BodyCollision
                | Term::Repulsion
                | Term::Holding => None,
            };
        }
        PairValue { raw, gradients }
    }
}
