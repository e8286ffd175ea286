//! Static equilibrium: the drape of lowest energy near a start, by direct minimisation over the vertices.
//!
//! It gives "error" a meaning. A network is trained to lower [`SceneEnergy`](crate::energy::SceneEnergy); the minimum that
//! this solver finds of the *same* sum says how much of it was left, and how far (mm) the vertices are from where they
//! would come to rest. The same steps refine a network's drape.
//!
//! **Unknowns** are the posed positions `[ΣV, 3]`. The one term about heights before skinning (holding) reads them off posed
//! positions ([`SceneEnergy::pulled_back`](crate::energy::SceneEnergy::pulled_back)), as in training. So the energy is a
//! function of posed positions only, whoever made them: a solver, a network with learned skin weights, or another program;
//! and a vertex weighs the same wherever its bones have turned.
//!
//! **Method.** Gauss–Newton steps with a Levenberg shift (Nocedal and Wright, "Numerical Optimization", chapter 10): in
//! every step the sparse Cholesky factor of a positive semidefinite approximation of the Hessian, the terms'
//! Gauss–Newton and tension parts ([`CurvatureSink`](crate::energy::CurvatureSink)), plus a multiple of the identity
//! that falls after a full step and rises after one that had to be shortened. Nothing is remembered from step to step:
//! quasi-Newton pairs, which learn a curvature that contact has changed by then, made two to three times as many steps
//! necessary. Steps are shortened until the energy falls by Armijo's share: it falls in every step. The order of
//! elimination is found once for a garment, and for an outfit again whenever garments touch where they did not before;
//! the faces of the body near every contact point are remembered for as long as no other can be nearer.
//!
//! **Relative gradient.** `|Σ_t w_t ∇E_t| / Σ_t |w_t ∇E_t|` over the terms `t`: the force that is left, measured against the
//! forces that balance each other. It is 1 where a single term acts and 0 in equilibrium, knows no unit, and does not
//! depend on the start, as a ratio to the first gradient would.
//!
//! **Creases and discontinuities.** The printed repulsion jumps where a pair reaches its radius, which stops any line
//! search: [`EnergySettings::repulsion_continuous`](crate::energy::EnergySettings::repulsion_continuous) has the same
//! forces without it. The nearest-vertex distance jumps where the nearest vertex changes, and
//! [`Distance::ClosestPoint`](crate::query::Distance::ClosestPoint) jumps where the body intersects itself;
//! [`Distance::Union`](crate::query::Distance::Union) is continuous. Against a jump nothing can be balanced: with the
//! other distances the solver may stop as [`Stop::Stalled`]. No distance is smooth where two parts of the body are
//! equally near: there the contact has a crease, on which cloth comes to rest and no gradient vanishes. In the relative
//! gradient, the forces of both sides are combined so that least is left. Steps see creases smooth, over a small part
//! of their length. The solver knows the sides of a crease that a vertex has been on, in steps taken and in those found
//! too long (`energy/creases.rs`).
//!
//! **Intersections.** With [`SolverSettings::margin`], a step filter shortens every step where it would make triangles
//! intersect that do not (`contact/step_filter`); the direction that is left has to be one of descent. So nothing
//! intersects at the end that did not at the start.
//!
//! **Several garments.** The paper's layer terms jump in every few steps;
//! [`LayerContact::ClosestPoint`](crate::energy::LayerContact::ClosestPoint) only jumps where a vertex is as near to a
//! sheet that it lies over as to one that it lies under, both of the same garment. No force acts across such a
//! discontinuity, and creases between garments are not known to the solver: outfits seldom end as [`Stop::Converged`].

mod error;
mod filtered_steps;
mod hessian;
mod line_search;
mod problem;
mod settings;
mod solution;
mod solve;
#[cfg(test)]
mod tests;

pub use error::EquilibriumError;
pub use problem::Problem;
pub use settings::SolverSettings;
pub use solution::{Progress, Solution, Step, Stop};
pub use solve::solve;
