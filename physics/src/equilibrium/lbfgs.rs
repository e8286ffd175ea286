//! The limited-memory BFGS matrix (Nocedal and Wright, "Numerical Optimization", algorithm 7.4).

use std::collections::VecDeque;

use crate::vec3::dot;

/// Pairs whose curvature `s·y` is below this times `|s||y|` say nothing that rounding or a nonsmooth point could not have said.
const SMALLEST_CURVATURE: f64 = 1e-8;

/// Remembered steps `s` and gradient changes `y`, oldest first.
pub(super) struct Lbfgs {
    capacity: usize,
    pairs: VecDeque<Pair>,
}

struct Pair {
    s: Vec<[f64; 3]>,
    y: Vec<[f64; 3]>,
    /// `1/(s·y)`.
    rho: f64,
}

impl Lbfgs {
    pub fn new(capacity: usize) -> Self {
        Self { capacity, pairs: VecDeque::with_capacity(capacity) }
    }

    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    pub fn clear(&mut self) {
        self.pairs.clear();
    }

    /// Learns from a step, unless its curvature is not positive.
    pub fn push(&mut self, s: Vec<[f64; 3]>, y: Vec<[f64; 3]>) {
        let curvature = product(&s, &y);
        let scale = (product(&s, &s) * product(&y, &y)).sqrt();
        // A NaN is not curved enough either.
        let is_curved = curvature > SMALLEST_CURVATURE * scale;
        if self.capacity == 0 || !is_curved {
            return;
        }
        if self.pairs.len() == self.capacity {
            self.pairs.pop_front();
        }
        self.pairs.push_back(Pair { s, y, rho: 1.0 / curvature });
    }

    /// `−H g`, `initial` being the product with the initial inverse Hessian, in place.
    pub fn direction(&self, gradient: &[[f64; 3]], initial: impl FnOnce(&mut [[f64; 3]])) -> Vec<[f64; 3]> {
        let mut q = gradient.to_vec();
        let mut alphas = Vec::with_capacity(self.pairs.len());
        for pair in self.pairs.iter().rev() {
            let alpha = pair.rho * product(&pair.s, &q);
            add_scaled(&mut q, -alpha, &pair.y);
            alphas.push(alpha);
        }
        initial(&mut q);
        for (pair, alpha) in self.pairs.iter().zip(alphas.into_iter().rev()) {
            let beta = pair.rho * product(&pair.y, &q);
            add_scaled(&mut q, alpha - beta, &pair.s);
        }
        for x in q.as_flattened_mut() {
            *x = -*x;
        }
        q
    }
}

/// Scalar product over all coordinates, summed in order.
pub(super) fn product(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| dot(*a, *b)).sum()
}

/// `y ← y + s·x`.
pub(super) fn add_scaled(y: &mut [[f64; 3]], s: f64, x: &[[f64; 3]]) {
    for (y, x) in y.iter_mut().zip(x) {
        crate::vec3::axpy(y, s, *x);
    }
}
