//! Sums over elements (triangles, hinges) with their gradient at the vertices, the same for any number of threads.

use rayon::prelude::*;

use crate::real::Real;
use crate::rows::CompressedRows;
use crate::vec3;

/// Work items per task: enough to pay for a task, few enough to share.
pub(crate) const GRAIN: usize = 256;

/// A gradient to add to, and the weight with which to add.
#[derive(Debug)]
pub struct Weighted<'a, T> {
    /// Factor on everything that is added.
    pub weight: f64,
    /// Gradient per vertex `[V, 3]`.
    pub gradient: &'a mut [[T; 3]],
}

impl<T: Real> Weighted<'_, T> {
    /// `gradient[v] += weight·g`.
    #[inline(always)]
    pub(crate) fn add(&mut self, v: usize, g: [f64; 3]) {
        vec3::accumulate(&mut self.gradient[v], vec3::from_f64(vec3::scale(g, self.weight)));
    }
}

/// Energy (J) of one element and its derivative at the element's corners.
pub(crate) struct Response<T, const N: usize> {
    pub energy: f64,
    pub gradient: [[T; 3]; N],
}

/// `Σ element(e).energy` for `e < count`, and the gradient of the sum at the vertices.
///
/// Elements are independent of each other and collected in order, the sum runs over them in order, and each vertex gathers
/// its corners in order: how the work was shared leaves no trace.
pub(crate) fn sum_elements<T: Real, const N: usize>(
    count: usize,
    corners_at: &CompressedRows<u32>,
    element: impl Fn(usize) -> Response<T, N> + Send + Sync,
    target: Option<Weighted<'_, T>>,
) -> f64 {
    let Some(target) = target else {
        let energies: Vec<f64> =
            (0..count).into_par_iter().with_min_len(GRAIN).map(|e| element(e).energy).collect();
        return energies.iter().sum();
    };
    let responses: Vec<Response<T, N>> =
        (0..count).into_par_iter().with_min_len(GRAIN).map(element).collect();
    let weight = T::from_f64(target.weight);
    target.gradient.par_iter_mut().with_min_len(GRAIN).enumerate().for_each(|(v, gradient)| {
        let mut sum = vec3::zero();
        for &slot in corners_at.row(v) {
            let slot = slot as usize;
            vec3::accumulate(&mut sum, responses[slot / N].gradient[slot % N]);
        }
        vec3::axpy(gradient, weight, sum);
    });
    responses.iter().map(|r| r.energy).sum()
}
