//! Moves an outfit towards proposed states, garment by garment, only as far as that lowers its energy.
//!
//! A network may make worse what is unlike anything that it was trained on. The losses need no ground truth, so that this is seen
//! at inference. A proposal is a new state of all garments; every garment goes a share of the distance there, the first of some
//! with which *no garment's energy rises, nor the sum of those that pairs connect*. The energy of a garment is that of its own
//! terms and of every pair it is part of: what it wins against a neighbour counts, and what that loses is its own to see. So the
//! energy of every garment and that of the outfit fall or stay from state to state, and a garment that a proposal would harm does
//! not keep those from moving that it has nothing to do with.

use crate::inference::Draped;
use clothcombo_physics::energy::{SceneEnergy, weighted};
use std::collections::BTreeSet;

/// Backtracking: a step that goes too far along a direction that is right is halved, and halved again.
pub const BACKTRACKING: [f32; 3] = [1.0, 0.5, 0.25];
/// All of it or nothing, for a proposal that is a place rather than a direction.
pub const WHOLE_STEP: [f32; 1] = [1.0];

/// A state of an outfit whose energies only fall.
pub struct Descent<'a> {
    energy: &'a SceneEnergy<f32>,
    state: Draped,
    reached: StateEnergies,
    /// For every garment the first of those that pairs connect it with.
    group: Vec<usize>,
}

impl<'a> Descent<'a> {
    /// Starts from `state`.
    pub fn new(energy: &'a SceneEnergy<f32>, state: Draped) -> Self {
        let reached = measured(energy, &state);
        let mut group: Vec<usize> = (0..reached.energies.len()).collect();
        for pair in &energy.layers {
            let [from, to] = [pair.inner, pair.outer].map(|garment| group[garment]);
            group.iter_mut().filter(|g| **g == from.max(to)).for_each(|g| *g = from.min(to));
        }
        Self { energy, state, reached, group }
    }

    /// Starts from the one of `candidates` in which the outfit has least energy. A garment that has less in another one goes
    /// there, where that raises nobody's energy. So the outfit starts with no more energy than in any of them, and so does every
    /// garment that is part of no pair.
    ///
    /// # Panics
    /// If there is none.
    pub fn from_best(energy: &'a SceneEnergy<f32>, candidates: impl IntoIterator<Item = Draped>) -> Self {
        let mut starts: Vec<Self> = candidates.into_iter().map(|state| Self::new(energy, state)).collect();
        let lowest = (0..starts.len()).min_by(|&a, &b| starts[a].total().total_cmp(&starts[b].total()));
        let mut best = starts.remove(lowest.expect("a state to start from"));
        for other in starts {
            let gains: Vec<bool> = other.energies().iter().zip(best.energies()).map(|(o, b)| o < b).collect();
            best.advance_some(&other.state, &WHOLE_STEP, |garment| gains[garment]);
        }
        best
    }

    /// Where it is.
    pub fn state(&self) -> &Draped {
        &self.state
    }

    /// Energy of every garment with the pairs that it is part of (J); infinite where it is not finite.
    pub fn energies(&self) -> &[f64] {
        &self.reached.energies
    }

    /// Energy of the outfit (J); infinite where it is not finite.
    pub fn total(&self) -> f64 {
        self.reached.total
    }

    /// The state that was reached.
    pub fn into_state(self) -> Draped {
        self.state
    }

    /// Moves every garment towards `proposal` by the first of `shares` of the distance, or not at all, so that no garment's
    /// energy rises, nor that of the outfit; which share every garment took.
    ///
    /// # Panics
    /// If the proposal has another number of vertices.
    pub fn advance(&mut self, proposal: &Draped, shares: &[f32]) -> Vec<f32> {
        self.advance_some(proposal, shares, |_| true)
    }

    /// The same for the garments that `may_move`.
    ///
    /// # Panics
    /// As [`advance`](Self::advance).
    pub fn advance_some(
        &mut self,
        proposal: &Draped,
        shares: &[f32],
        may_move: impl Fn(usize) -> bool,
    ) -> Vec<f32> {
        // Which share every garment takes; one behind the last stands still.
        let mut taken: Vec<usize> =
            (0..self.group.len()).map(|i| if may_move(i) { 0 } else { shares.len() }).collect();
        let share = |taken: usize| shares.get(taken).copied().unwrap_or(0.0);
        while taken.iter().any(|s| *s < shares.len()) {
            let trial = self.between(proposal, |i| share(taken[i]));
            let found = measured(self.energy, &trial);
            let moves = |i: usize| taken[i] < shares.len();
            let rose = (0..taken.len()).filter(|&i| found.energies[i] > self.reached.energies[i]);
            let mut shorter: BTreeSet<usize> = rose.flat_map(|i| self.shortened(i, moves)).collect();
            if shorter.is_empty() {
                // What garments win from each other counts twice for them, what they pay for it once. Those that no chain of
                // pairs connects have nothing to do with each other.
                let of = |totals: &[f64]| -> Vec<f64> {
                    let mut sums = vec![0.0; taken.len()];
                    self.group.iter().zip(totals).for_each(|(group, energy)| sums[*group] += energy);
                    sums
                };
                let (new, old) = (of(&found.shares_of_total), of(&self.reached.shares_of_total));
                shorter.extend(
                    (0..taken.len()).filter(|&i| moves(i) && new[self.group[i]] > old[self.group[i]]),
                );
            }
            if shorter.is_empty() {
                // Infinite energies neither rise nor fall.
                if found.energies.iter().zip(self.energies()).any(|(new, old)| new < old) {
                    (self.state, self.reached) = (trial, found);
                    return taken.into_iter().map(share).collect();
                }
                break;
            }
            shorter.into_iter().for_each(|i| taken[i] += 1);
        }
        vec![0.0; taken.len()]
    }

    /// The garments that go less far where the energy of `garment` rises: itself, or its neighbours where it stands still.
    fn shortened(&self, garment: usize, moves: impl Fn(usize) -> bool) -> Vec<usize> {
        if moves(garment) {
            return vec![garment];
        }
        let pairs = self.energy.layers.iter().map(|pair| [pair.inner, pair.outer]);
        let neighbours = pairs.filter(|pair| pair.contains(&garment)).flatten();
        neighbours.filter(|&i| moves(i)).collect()
    }

    fn between(&self, proposal: &Draped, share: impl Fn(usize) -> f32) -> Draped {
        let mut trial = self.state.clone();
        let mut first = 0;
        for (i, garment) in self.energy.garments.iter().enumerate() {
            let share = share(i);
            let rows = first..first + garment.energies.vertex_count();
            first = rows.end;
            let spaces = [(&mut trial.posed, &proposal.posed), (&mut trial.canonical, &proposal.canonical)];
            for (of_trial, of_proposal) in spaces {
                for (x, y) in of_trial[rows.clone()].iter_mut().zip(&of_proposal[rows.clone()]) {
                    *x = match share {
                        1.0 => *y,
                        0.0 => *x,
                        _ => std::array::from_fn(|k| x[k] + share * (y[k] - x[k])),
                    };
                }
            }
        }
        trial
    }
}

/// Energies of a state (J); infinite where they are not finite.
struct StateEnergies {
    /// Of every garment, with the pairs that it is part of.
    energies: Vec<f64>,
    /// What every garment has of the outfit's energy: half of that of its pairs.
    shares_of_total: Vec<f64>,
    /// Of the whole outfit, in which every pair counts once.
    total: f64,
}

/// Weighted energy of every garment, its own terms and those of every pair that it is part of; and of the outfit.
fn measured(energy: &SceneEnergy<f32>, state: &Draped) -> StateEnergies {
    let value = energy.value(&state.posed, &state.canonical);
    let own = energy.garments.iter().zip(&value.garments);
    let mut energies: Vec<f64> = own.map(|(garment, raw)| weighted(&garment.weights, raw)).collect();
    let mut shares = energies.clone();
    for (pair, raw) in energy.layers.iter().zip(&value.layers) {
        let shared = weighted(&pair.weights, raw);
        for garment in [pair.inner, pair.outer] {
            energies[garment] += shared;
            shares[garment] += 0.5 * shared;
        }
    }
    let bounded = |e: f64| if e.is_finite() { e } else { f64::INFINITY };
    StateEnergies {
        energies: energies.into_iter().map(bounded).collect(),
        shares_of_total: shares.into_iter().map(bounded).collect(),
        total: bounded(value.total),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::energy::{
        EnergySettings, GarmentEnergies, SceneGarment, SceneLayers, Term, TermMap,
    };
    use clothcombo_physics::mesh::{Topology, shapes};
    use clothcombo_physics::query::Surface;
    use std::sync::Arc;

    /// Tubes of these radii with strain, those of `pairs` with layer collision, and their rest positions.
    fn scene(radii: &[f64], pairs: &[[usize; 2]]) -> (SceneEnergy<f32>, Vec<[f32; 3]>) {
        let settings = EnergySettings::default();
        let tubes: Vec<_> = radii.iter().map(|radius| shapes::tube(*radius, 0.3, 12, 6)).collect();
        let only = |one, weight| TermMap::from_fn(|term| if term == one { weight } else { 0.0 });
        let garment = |tube| SceneGarment {
            energies: Arc::new(
                GarmentEnergies::new(tube, &Topology::new(tube), &settings, false).expect("a garment"),
            ),
            holding_reference: Vec::new(),
            thickness_below: Vec::new(),
            pull_back: None,
            weights: only(Term::Strain, 1.0),
        };
        let layers = pairs.iter().map(|&[inner, outer]| SceneLayers {
            inner,
            outer,
            weights: only(Term::LayerCollision, 1e6),
        });
        let energy = SceneEnergy {
            body: Arc::new(Surface::from_mesh(&shapes::tetrahedron())),
            garments: tubes.iter().map(garment).collect(),
            layers: layers.collect(),
            settings,
        };
        let rest = tubes.iter().flat_map(|t| t.positions()).map(|p| p.map(|x| x as f32)).collect();
        (energy, rest)
    }

    /// The parts of `rest`, each made larger by a factor of its own.
    fn stretched(rest: &[[f32; 3]], by: &[f32]) -> Draped {
        let part = rest.len() / by.len();
        let posed: Vec<[f32; 3]> =
            rest.iter().enumerate().map(|(v, p)| p.map(|x| x * by[v / part])).collect();
        Draped { canonical: posed.clone(), posed }
    }

    #[test]
    fn a_garment_that_a_proposal_harms_does_not_keep_others_from_moving() {
        let (energy, rest) = scene(&[0.1, 0.12], &[]);
        let mut descent = Descent::new(&energy, stretched(&rest, &[1.2, 1.1]));
        let before = descent.energies().to_vec();
        assert_eq!(descent.advance(&stretched(&rest, &[1.0, 1.3]), &BACKTRACKING), [1.0, 0.0]);
        assert_eq!(descent.state().posed, stretched(&rest, &[1.0, 1.1]).posed);
        assert!(descent.energies()[0] < 1e-9 && descent.energies()[1] == before[1]);
        assert_eq!(
            descent.advance(&stretched(&rest, &[1.3, 1.3]), &BACKTRACKING),
            [0.0, 0.0],
            "nothing to gain"
        );
    }

    #[test]
    fn a_proposal_that_goes_too_far_is_followed_half_way_or_a_quarter() {
        let (energy, rest) = scene(&[0.1], &[]);
        // From 1.1 towards 1 and on to the other side: 0.95 is nearer to rest, 0.8 and 0.6 are not.
        for (proposed, share) in [(0.95, 1.0), (0.8, 0.5), (0.6, 0.25)] {
            let mut descent = Descent::new(&energy, stretched(&rest, &[1.1]));
            let started = descent.energies()[0];
            assert_eq!(descent.advance(&stretched(&rest, &[proposed]), &BACKTRACKING), [share], "{proposed}");
            assert!(descent.energies()[0] < started);
            assert_eq!(descent.state().posed, descent.state().canonical);
        }
    }

    #[test]
    fn a_place_is_taken_whole_or_not() {
        let (energy, rest) = scene(&[0.1, 0.12], &[]);
        let start = stretched(&rest, &[1.1, 1.1]);
        let mut descent = Descent::new(&energy, start.clone());
        assert_eq!(descent.advance(&stretched(&rest, &[0.7, 1.2]), &WHOLE_STEP), [0.0, 0.0]);
        assert_eq!(descent.state().posed, start.posed);
        assert_eq!(descent.advance(&stretched(&rest, &[0.7, 1.05]), &WHOLE_STEP), [0.0, 1.0]);
        assert_eq!(descent.state().posed, stretched(&rest, &[1.1, 1.05]).posed);
        assert_eq!(descent.advance_some(&stretched(&rest, &[1.0, 1.0]), &WHOLE_STEP, |i| i == 0), [1.0, 0.0]);
        assert_eq!(descent.state().posed, stretched(&rest, &[1.0, 1.05]).posed);
    }

    #[test]
    fn a_descent_starts_with_the_better_state_of_every_garment() {
        let (energy, rest) = scene(&[0.1, 0.12], &[]);
        let candidates = [stretched(&rest, &[1.1, 1.3]), stretched(&rest, &[1.2, 1.1])];
        for order in [[0, 1], [1, 0]] {
            let descent = Descent::from_best(&energy, order.map(|i| candidates[i].clone()));
            assert_eq!(descent.state().posed, stretched(&rest, &[1.1, 1.1]).posed);
        }
        // Where the two are a pair, the outfit has no more energy than in either state.
        let (energy, rest) = scene(&[0.13, 0.12], &[[0, 1]]);
        let candidates = [[0.8, 1.0], [1.0, 1.2], [0.9, 1.1]].map(|by| stretched(&rest, &by));
        let totals = candidates.each_ref().map(|state| Descent::new(&energy, state.clone()).total());
        let descent = Descent::from_best(&energy, candidates);
        assert!(totals.iter().all(|total| descent.total() <= *total), "{totals:?}");
    }

    #[test]
    fn what_one_garment_gains_is_not_paid_by_its_neighbour() {
        // The inner tube, stretched across it, would relax outwards through the outer one, which stays where it is.
        let (energy, rest) = scene(&[0.13, 0.12], &[[0, 1]]);
        let start = stretched(&rest, &[0.8, 1.0]);
        let mut descent = Descent::new(&energy, start.clone());
        let before = descent.energies().to_vec();
        let shares = descent.advance(&stretched(&rest, &[1.0, 1.0]), &BACKTRACKING);
        let after = descent.energies();
        assert!(after.iter().zip(&before).all(|(after, before)| after <= before), "{before:?} {after:?}");
        assert!(shares[0] < 1.0, "{shares:?}");
        // Without the pair it would have moved the whole distance.
        let (free, _) = scene(&[0.13, 0.12], &[]);
        let mut descent = Descent::new(&free, start);
        assert_eq!(descent.advance(&stretched(&rest, &[1.0, 1.0]), &BACKTRACKING)[0], 1.0);
        assert_eq!(descent.state().posed, rest);
    }

    #[test]
    fn garments_do_not_both_strain_for_what_the_outfit_loses() {
        // Two tubes that intersect would part by stretching: each wins the pair, which counts for both, and pays its own strain.
        let (mut energy, rest) = scene(&[0.12, 0.12], &[[0, 1]]);
        let (apart, start) = (stretched(&rest, &[0.96, 1.04]), stretched(&rest, &[1.0, 1.0]));
        let raw = Descent::new(&energy, start.clone());
        let strain = Descent::new(&energy, apart.clone()).total();
        assert!(raw.total() > 0.0 && strain > 0.0);
        // A pair that is worth three quarters of what both strain together: more than each of them pays, less than their sum.
        energy.layers[0].weights =
            energy.layers[0].weights.map(|_, weight| weight * 0.75 * strain / raw.total());
        let mut descent = Descent::new(&energy, start);
        let (energies, total) = (descent.energies().to_vec(), descent.total());
        assert!(Descent::new(&energy, apart.clone()).energies().iter().zip(&energies).all(|(a, b)| a < b));
        assert_eq!(descent.advance(&apart, &WHOLE_STEP), [0.0, 0.0]);
        descent.advance(&apart, &BACKTRACKING);
        assert!(descent.total() <= total);
        // A third tube that no pair connects goes all the way.
        let (mut three, rest) = scene(&[0.12, 0.12, 0.2], &[[0, 1]]);
        three.layers[0].weights = energy.layers[0].weights;
        let mut descent = Descent::new(&three, stretched(&rest, &[1.0, 1.0, 1.1]));
        let proposal = stretched(&rest, &[0.96, 1.04, 1.09]);
        assert_eq!(descent.advance(&proposal, &WHOLE_STEP), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn what_is_not_finite_is_never_better_and_left_at_the_first_chance() {
        let (energy, rest) = scene(&[0.1, 0.12], &[]);
        let (good, bad) = (stretched(&rest, &[1.1, 1.1]), stretched(&rest, &[f32::NAN, 1.0]));
        let mut descent = Descent::new(&energy, good.clone());
        assert_eq!(descent.advance(&bad, &BACKTRACKING), [0.0, 1.0], "the other garment moves");
        assert_eq!(descent.state().posed[0], good.posed[0]);
        let mut descent = Descent::new(&energy, bad.clone());
        assert_eq!(descent.advance(&good, &BACKTRACKING), [1.0, 0.0]);
        assert_eq!(descent.state().posed[0], good.posed[0]);
        let mut descent = Descent::new(&energy, bad.clone());
        assert_eq!(descent.advance(&bad, &BACKTRACKING), [0.0, 0.0]);
    }
}
