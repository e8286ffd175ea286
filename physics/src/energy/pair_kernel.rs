//! The inner loop of the repulsion: one vertex against a list of candidates, in fixed lanes.

use std::ops::Range;

use crate::real::Real;
use crate::vec3::{accumulate, from_f64, scale, sub, zero};

/// δ (m): below this distance, a fifth of the cloth's thickness, the logarithm continues as a line in `d²`.
pub const CONTACT_DISTANCE: f64 = 1e-4;

/// Candidates per step of the inner loop.
const PAIR_LANES: usize = 16;

/// Steps after which products of squared distances move to `f64`: four squares of at least δ² = 1e-8 stay above the smallest
/// normal `f32`, and so do four of at most 1, or of a radius below 1e4 m, below the largest.
const STEPS_PER_PRODUCT: usize = 4;

/// The pair energy in the caller's scalar.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel<T> {
    pub radius: f64,
    /// Every pair has at least this energy; negative, hence no bound to use, for a radius above 1 m.
    pub least_energy: f64,
    radius_squared: T,
    contact_squared: T,
    /// What `d²` is multiplied with inside the logarithm (1/m²).
    unit: T,
}

/// Runs `kernel`, compiled once per vector width, with the widest the processor has. What it calls must be `#[inline(always)]`.
#[inline(always)]
fn vectorised(kernel: impl FnOnce()) {
    // Named instruction sets instead of `pulp::Arch::dispatch`, through which the kernel is not inlined and stays narrow.
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V4::try_new() {
        return simd.vectorize(kernel);
    } else if let Some(simd) = pulp::x86::V3::try_new() {
        return simd.vectorize(kernel);
    }
    kernel();
}

/// What one vertex collects from its partners: `Σ −log d²`, and the derivative with respect to its position.
pub(super) type VertexResponse<T> = (f64, [T; 3]);

impl<T: Real> Kernel<T> {
    /// Pairs closer than `radius` (m) count `−log(unit·d²)`.
    pub fn new(radius: f64, unit: f64) -> Self {
        Self {
            radius,
            least_energy: -2.0 * radius.ln() - unit.ln(),
            unit: T::from_f64(unit),
            radius_squared: T::from_f64(radius * radius),
            contact_squared: T::from_f64(CONTACT_DISTANCE * CONTACT_DISTANCE),
        }
    }

    /// A few partners one by one, with one logarithm.
    #[inline(always)]
    pub fn few(&self, p: [T; 3], partners: impl Iterator<Item = [T; 3]>) -> VertexResponse<T> {
        let (mut energy, mut product, mut pull) = (0.0, 1.0f64, zero());
        for q in partners {
            let offset = sub(p, q);
            let squared = crate::vec3::norm_squared(offset);
            if squared >= self.radius_squared || squared.is_nan() {
                continue;
            }
            let guarded = squared.max(self.contact_squared);
            energy += (guarded - squared).to_f64() / self.contact_squared.to_f64();
            product *= (guarded * self.unit).to_f64();
            if !(1e-200..1e200).contains(&product) {
                energy -= product.ln();
                product = 1.0;
            }
            accumulate(&mut pull, scale(offset, T::from_f64(-2.0) / guarded));
        }
        (energy - product.ln(), pull)
    }

    /// What every one of `points` collects from all candidates.
    pub fn all(&self, points: &[[T; 3]], candidates: &Candidates<T>) -> Vec<VertexResponse<T>> {
        let mut responses = vec![(0.0, zero()); points.len()];
        vectorised(
            #[inline(always)]
            || {
                for (response, p) in responses.iter_mut().zip(points) {
                    *response = self.candidates(*p, candidates);
                }
            },
        );
        responses
    }

    /// All candidates, whose number is a multiple of [`PAIR_LANES`], at once.
    #[inline(always)]
    fn candidates(&self, p: [T; 3], candidates: &Candidates<T>) -> VertexResponse<T> {
        let mut pull = [[T::zero(); PAIR_LANES]; 3];
        let mut excess = [T::zero(); PAIR_LANES];
        let mut product = [T::one(); PAIR_LANES];
        let mut logarithm = ProductLogarithm::new();
        let [xs, ys, zs] = candidates.axes.each_ref().map(|axis| axis.as_chunks::<PAIR_LANES>().0);
        for (step, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
            for lane in 0..PAIR_LANES {
                let (dx, dy, dz) = (p[0] - x[lane], p[1] - y[lane], p[2] - z[lane]);
                let squared = dx * dx + dy * dy + dz * dz;
                let inside = squared < self.radius_squared;
                let guarded = if squared > self.contact_squared { squared } else { self.contact_squared };
                let inverse = guarded.recip();
                let inverse = if inside { inverse } else { T::zero() };
                pull[0][lane] += dx * inverse;
                pull[1][lane] += dy * inverse;
                pull[2][lane] += dz * inverse;
                product[lane] *= if inside { guarded * self.unit } else { T::one() };
                excess[lane] += if inside { guarded - squared } else { T::zero() };
            }
            if step % STEPS_PER_PRODUCT == STEPS_PER_PRODUCT - 1 {
                logarithm.multiply(product);
                product = [T::one(); PAIR_LANES];
            }
        }
        logarithm.multiply(product);
        let sum = |lanes: [T; PAIR_LANES]| lanes.into_iter().map(Real::to_f64).sum::<f64>();
        let energy = sum(excess) / self.contact_squared.to_f64() - logarithm.value();
        (energy, from_f64(pull.map(|lanes| -2.0 * sum(lanes))))
    }
}

/// `log Π x` over many positive factors in lanes, without a logarithm per factor.
struct ProductLogarithm {
    /// Each in [1, 2).
    mantissas: [f64; PAIR_LANES],
    /// Sum of the biased exponents that were split off.
    exponents: [u64; PAIR_LANES],
    count: u64,
}

impl ProductLogarithm {
    const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    const BIAS: u64 = f64::MAX_EXP as u64 - 1;

    #[inline(always)]
    fn new() -> Self {
        Self { mantissas: [1.0; PAIR_LANES], exponents: [0; PAIR_LANES], count: 0 }
    }

    /// Factors must be positive and normal `f64` that stay normal when doubled.
    #[inline(always)]
    fn multiply<T: Real>(&mut self, factors: [T; PAIR_LANES]) {
        for lane in 0..PAIR_LANES {
            let bits = (self.mantissas[lane] * factors[lane].to_f64()).to_bits();
            self.exponents[lane] += bits >> Self::MANTISSA_BITS;
            let mantissa = bits & ((1 << Self::MANTISSA_BITS) - 1);
            self.mantissas[lane] = f64::from_bits(mantissa | (Self::BIAS << Self::MANTISSA_BITS));
        }
        self.count += PAIR_LANES as u64;
    }

    #[inline(always)]
    fn value(&self) -> f64 {
        // The product of sixteen mantissas is below 2¹⁶.
        let exponent = self.exponents.iter().sum::<u64>() as i64 - (self.count * Self::BIAS) as i64;
        exponent as f64 * std::f64::consts::LN_2 + self.mantissas.iter().product::<f64>().ln()
    }
}

/// Coordinates of the vertices around a cell, padded with far points to a multiple of [`PAIR_LANES`].
#[derive(Debug, Default)]
pub(super) struct Candidates<T> {
    axes: [Vec<T>; 3],
}

impl<T: Real> Candidates<T> {
    pub fn clear(&mut self) {
        self.axes.iter_mut().for_each(Vec::clear);
    }

    /// Appends the points `range` of lists of coordinates.
    pub fn extend(&mut self, axes: &[Vec<T>; 3], range: Range<usize>) {
        for (to, from) in self.axes.iter_mut().zip(axes) {
            to.extend_from_slice(&from[range.clone()]);
        }
    }

    pub fn pad(&mut self) {
        // Finite, so that its offset times a zero weight is zero; its square is infinite or nearly so, hence outside.
        let far = T::max_value().sqrt();
        let padded = self.axes[0].len().next_multiple_of(PAIR_LANES);
        self.axes.iter_mut().for_each(|axis| axis.resize(padded, far));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::SplitMix;

    fn near(count: usize) -> Vec<[f32; 3]> {
        let mut random = SplitMix::new(7);
        (0..count).map(|_| std::array::from_fn(|_| 0.1 * random.symmetric() as f32)).collect()
    }

    #[test]
    fn a_list_gives_the_sum_of_its_pairs() {
        let kernel = Kernel::<f32>::new(0.1, 1.0);
        let mut points = near(777);
        // Closer than the contact distance, and at the same place.
        points.extend([[2e-5, 0.0, 0.0], [0.0; 3], [5e-5, 5e-5, 0.0]]);
        let mut candidates = Candidates::default();
        let axes = [0, 1, 2].map(|axis| points.iter().map(|p| p[axis]).collect());
        candidates.extend(&axes, 0..points.len());
        candidates.pad();
        let from = [[0.0f32; 3], [0.03, -0.02, 0.01], [5.0, 0.0, 0.0]];
        for (p, (energy, pull)) in from.iter().zip(kernel.all(&from, &candidates)) {
            let (expected, expected_pull) = kernel.few(*p, points.iter().copied());
            let expected_pull = crate::vec3::to_f64(expected_pull);
            assert!((energy - expected).abs() <= 1e-5 * expected.abs(), "{energy} {expected}");
            let size = crate::vec3::norm(expected_pull).max(1.0);
            for axis in 0..3 {
                assert!((f64::from(pull[axis]) - expected_pull[axis]).abs() <= 1e-4 * size);
            }
        }
    }

    #[test]
    fn the_logarithm_of_a_product_is_the_sum_of_logarithms() {
        let mut random = SplitMix::new(3);
        let mut product = ProductLogarithm::new();
        let mut expected = 0.0;
        for _ in 0..500 {
            let factors: [f64; PAIR_LANES] =
                std::array::from_fn(|_| 10f64.powf(16.0 * random.symmetric() - 16.0));
            expected += factors.iter().map(|x| x.ln()).sum::<f64>();
            product.multiply(factors);
        }
        assert!((product.value() / expected - 1.0).abs() < 1e-12);
        assert_eq!(ProductLogarithm::new().value(), 0.0);
    }
}
