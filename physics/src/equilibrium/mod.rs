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
//! **Method.** Limited-memory BFGS (Nocedal and Wright, "Numerical Optimization", algorithm 7.4) whose initial matrix is
//! the sparse Cholesky factor of a positive definite approximation of the Hessian: the terms' Gauss–Newton and tension
//! parts ([`CurvatureSink`](crate::energy::CurvatureSink)) plus a small multiple of the identity, refactorised every few
//! iterations. The factor removes the stiffness of the cloth (membrane against bending) and of the contact, the BFGS pairs
//! learn what it leaves out (compression, curved contact, repulsion); compare Liu, Bouaziz and Kavan, "Quasi-Newton methods
//! for real-time simulation of hyperelastic materials" (ACM TOG 2017). The line search asks for Armijo's decrease and the
//! weak Wolfe slope by bracketing, which also works at the nonsmooth points that contact has (Lewis and Overton, "Nonsmooth
//! optimization via quasi-Newton methods", Math. Prog. 2013): the energy falls in every step.
//!
//! **Relative gradient.** `|Σ_t w_t ∇E_t| / Σ_t |w_t ∇E_t|` over the terms `t`: the force that is left, measured against the
//! forces that balance each other. It is 1 where a single term acts and 0 in equilibrium, knows no unit, and does not
//! depend on the start, as a ratio to the first gradient would.
//!
//! **Nonsmooth points and discontinuities.** The printed repulsion jumps where a pair reaches its radius, which stops any line
//! search:
//! [`EnergySettings::repulsion_continuous`](crate::energy::EnergySettings::repulsion_continuous) has the same forces
//! without it. The nearest-vertex distance jumps where the nearest vertex changes, and
//! [`Distance::ClosestPoint`](crate::query::Distance::ClosestPoint) jumps where the body intersects itself;
//! [`Distance::Union`](crate::query::Distance::Union) is continuous. Against a jump nothing can be balanced: with the other
//! distances the solver may stop as [`Stop::Stalled`]. No distance is smooth where two parts of the body are equally near.
//! Nearest features are looked up anew in every evaluation, nothing is frozen. At a vertex that rests on a nonsmooth point, the gradient
//! in the relative gradient is the subgradient of smallest norm: no gradient vanishes there. From the tenth iteration on,
//! vertices that are driven against a nonsmooth point are put on it, where that lowers the energy, and steps are projected along
//! the nonsmooth sets that their vertices rest on. Where a few vertices before a nonsmooth point make a step short, or allow
//! none, they are held for one step, so that all others go on.
//!
//! **Several garments.** The paper's layer terms jump in every few steps;
//! [`LayerContact::ClosestPoint`](crate::energy::LayerContact::ClosestPoint) only jumps where a vertex is as near to a sheet that
//! it lies over as to one that it lies under, both of the same garment. No force acts across such a discontinuity. A vertex that a step
//! drives against one is held for up to ten steps, with the faces on both sides; its force still counts in the relative gradient,
//! so that outfits seldom end as [`Stop::Converged`].

mod error;
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
