//! The scalar types of the crate.

use std::fmt::{Debug, Display};
use std::iter::Sum;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use num_traits::{Float, FloatConst, NumAssign};

/// A floating-point scalar: `f32` (training) or `f64` (reference, precompute).
///
/// Everything numerical in this crate that is evaluated in both precisions is written once over this trait.
pub trait Real:
    Float + FloatConst + NumAssign + Sum + Default + Debug + Display + Send + Sync + 'static
{
    /// The kd-tree over points of this scalar. Use it through [`crate::VertexIndex`].
    #[doc(hidden)]
    type Tree: Debug + Send + Sync;

    /// Rounds an `f64` to this type.
    fn from_f64(value: f64) -> Self;

    /// Widens to `f64` (exact).
    fn to_f64(self) -> f64;

    /// Builds the tree; `None` for no points. Item `i` is the position in `points`, which must be finite.
    #[doc(hidden)]
    fn build_tree(points: &[[Self; 3]]) -> Option<Self::Tree>;

    /// Item and squared distance of the nearest point; any one of several equally near.
    #[doc(hidden)]
    fn nearest(tree: &Self::Tree, point: [Self; 3]) -> (u32, Self);

    /// Calls `visit` for every item at a squared distance of at most `radius_squared`, in no particular order.
    #[doc(hidden)]
    fn visit_within(tree: &Self::Tree, point: [Self; 3], radius_squared: Self, visit: impl FnMut(u32));
}

macro_rules! impl_real {
    ($scalar:ty) => {
        impl Real for $scalar {
            type Tree = ImmutableKdTree<$scalar, 3>;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            fn build_tree(points: &[[Self; 3]]) -> Option<Self::Tree> {
                // The one error of an immutable tree is more points than `u32` can number, which no mesh has.
                if points.is_empty() { None } else { ImmutableKdTree::new_from_slice(points).ok() }
            }

            fn nearest(tree: &Self::Tree, point: [Self; 3]) -> (u32, Self) {
                let found = tree.query(&point).nearest_one::<SquaredEuclidean<$scalar>>().execute();
                (found.item, found.distance)
            }

            fn visit_within(
                tree: &Self::Tree,
                point: [Self; 3],
                radius_squared: Self,
                mut visit: impl FnMut(u32),
            ) {
                tree.query(&point)
                    .within::<SquaredEuclidean<$scalar>>(radius_squared)
                    .unsorted()
                    .visit(|found| visit(found.item));
            }
        }
    };
}

impl_real!(f32);
impl_real!(f64);
