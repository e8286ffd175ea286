//! The post-process: takes draped garments out of the body and out of each other, and proves what it reached.
//!
//! All garments of an outfit are resolved together, so that an inner one gives way to an outer one. First of all the fast pass
//! ([`fast_pass()`]) parts what is only slightly wrong. What it does not clear goes on:
//!
//! 1. **Vertices.** The closest point of the body (of the union of its parts, [`crate::query::UnionDistance`]) leaves a vertex a
//!    half-space. Along its own direction away from the body it sees the sheets of inner garments, and has to stay over the
//!    outermost ([`layer_constraint`]); past a hem there is none.
//! 2. **Triangles.** Vertices outside are not enough where cloth is coarser than the body. Every pair of triangles that crosses,
//!    found exactly ([`detect`]), asks the part of one over the other to lie above it; linear heights make that sufficient. Which
//!    one is above is told by the directions away from the body: the outer garment, or, where two sheets look at each other
//!    (a sleeve and the side of the chest), each on its own part's side, whichever garments they belong to.
//! 3. **Self-intersections.** Sheets of one garment that cross and have no such order are parted by what most of their vertices say
//!    ([`self_intersections`]), crumples are smoothed.
//! 4. **Relaxation.** Vertices on the wrong side and their neighbourhood move by a displacement from the input that is smooth,
//!    aims at the edge lengths there were, and meets all conditions as far as vertices may move ([`relax`]); everything
//!    else keeps its position to the bit. Conditions of a crossing are kept for good. Repeated until no pair is left or
//!    nothing gets better; the best state is taken.
//! 5. **Certificate.** All pairs are counted again, from nothing, by the exact predicates.
//!
//! **Pinched regions**, where the body lies inside itself, are told apart by a stated rule: `BodyObstacle`. There, and where
//! hardly any cloth fits between two parts, the body gives way ([`clearance`]) where crossings are left otherwise; in the
//! end garments are brought out of it again where they can.
//!
//! **Once more.** Where few crossings are left, what was reached is resolved like a new drape.
//!
//! **Strain.** Where the strain energy has risen, cloth gives back what it can without crossing anything ([`strain_relaxation`]).
//!
//! **Bent limbs.** Where crossings are left, [`resolve_along`] takes the garments from the T-pose, where their order is plain,
//! step by step to the pose ([`continuation`], [`path`]); in short steps cloth keeps the sides it was on before ([`sides`]).

mod attempt;
mod body;
mod budget;
mod certificate;
mod clearance;
mod contact;
mod continuation;
mod count;
mod defects;
mod detect;
mod error;
mod fast_pass;
mod garment;
mod layer_constraint;
mod near;
mod obstacle;
mod outfit;
mod path;
mod path_sample;
mod relax;
mod resolved;
mod self_intersections;
mod settings;
mod sides;
mod stages;
mod step_lengths;
mod strain_relaxation;
#[cfg(test)]
mod tests;
mod untangle;
mod withdrawal;

pub use certificate::{
    Certificate, Crossed, GarmentCertificate, LayerCertificate, PinchedPairs, RemainingPair,
};
pub use continuation::{resolve_after, resolve_along};
pub use count::certify;
pub use defects::Defects;
pub use error::ResolveError;
pub use fast_pass::fast_pass;
use fast_pass::passed_near;
pub use garment::{FARTHEST, Layer, RestGarment};
pub use path_sample::{PathSample, Reached};
pub use resolved::{GarmentWork, Resolved};
pub use settings::ResolveSettings;

use crate::query::Surface;
use attempt::resolved_further;

/// Takes `layers`, innermost first, out of `body` and out of each other. Deterministic for any number of threads (without a
/// time limit in the settings); a clean input comes back to the bit.
///
/// # Errors
/// When a setting is out of range, positions do not fit their garment or are not finite, a garment has a face twice, or
/// the body has no surface. Crossings that cannot be mended are no error: the certificate lists them.
pub fn resolve(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Result<Resolved, ResolveError> {
    resolved_further(body, layers, settings, usize::MAX, |_, found, _| Ok(found))
}
