//! The post-process: separates draped garments from the body and from each other, and certifies the result.
//!
//! All garments of an outfit are resolved together, so that an outer one can move an inner one. The fast pass ([`fast_pass`])
//! separates slight intersections. What it does not clear goes on:
//!
//! 1. **Vertices.** The closest point of the body (of the union of its parts, [`crate::query::UnionDistance`]) gives a vertex a
//!    half-space. Along its outward direction a vertex sees the sheets of inner garments and has to stay over the outermost one
//!    ([`layer_constraint`]); past a hem there is none.
//! 2. **Triangles.** Vertices outside are not enough where cloth is coarser than the body. For each intersecting triangle pair,
//!    found exactly ([`detect`]), the overlapping part of one has to lie above the other; heights are linear, so conditions at
//!    the corners suffice. The outward directions decide which one is above: the outer garment, or, where two sheets face each
//!    other (a sleeve and the side of the chest), each stays on its own side, whichever garments they belong to.
//! 3. **Self-intersections.** Sheets of one garment that intersect and have no such order are separated as most of their vertices
//!    lie ([`self_intersections`]); crumples are smoothed.
//! 4. **Relaxation.** Vertices that violate a condition and their neighbourhood move by a displacement from the input that is
//!    smooth, aims at the original edge lengths and meets all conditions within the limits ([`relax`]); all other vertices keep
//!    their positions bit for bit. Conditions of an intersection are kept. Rounds repeat until no pair is left or none
//!    improves; the best state is taken.
//! 5. **Certificate.** All pairs are counted anew by the exact predicates.
//!
//! **Pinched regions**, where the body lies inside itself, are counted apart ([`BodyObstacle`](obstacle::BodyObstacle) states the
//! rule). If intersections remain there, or where hardly any cloth fits between two parts, the body yields ([`clearance`]);
//! afterwards garments leave that clearance again where they can ([`withdrawal`]).
//!
//! **Continued attempts.** If few intersections remain, the result is resolved like a new drape ([`attempt`]).
//!
//! **Strain.** If the strain energy has risen, edges relax without making an intersection ([`strain_relaxation`]).
//!
//! **Bent limbs.** If intersections remain, [`resolve_along`] takes the garments from the T-pose, where their order is plain,
//! step by step to the pose ([`continuation`], [`path`]); in short steps cloth keeps its [`contact_orientation`].

mod attempt;
mod body;
mod budget;
mod certificate;
mod clearance;
mod condition;
mod contact_orientation;
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
mod packed_cloth;
mod path;
mod path_sample;
mod relax;
mod resolved;
mod self_intersections;
mod settings;
mod step_lengths;
mod strain_relaxation;
mod task;
#[cfg(test)]
mod tests;
mod untangle;
mod withdrawal;

pub use certificate::{
    Certificate, GarmentCertificate, IntersectedSurface, LayerCertificate, PinchedPairs, RemainingPair,
};
pub use continuation::{resolve_after, resolve_along};
pub use count::certify;
pub use defects::Defects;
pub use error::ResolveError;
pub use garment::{FARTHEST_POSITION, Layer, RestGarment};
pub use path_sample::{ContactState, PathSample};
pub use resolved::{GarmentWork, Resolved};
pub use settings::ResolveSettings;

use crate::query::Surface;
use attempt::resolved_further;

/// Takes `layers`, innermost first, out of `body` and out of each other. Deterministic for any number of threads (without a
/// time limit in the settings); a clean input comes back to the bit.
///
/// # Errors
/// When a setting is out of range, positions do not fit their garment or are not finite, a garment has a face twice, or
/// the body has no surface. Intersections that cannot be mended are no error: the certificate lists them.
pub fn resolve(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Result<Resolved, ResolveError> {
    resolved_further(body, layers, settings, usize::MAX, |_, found, _| Ok(found))
}
