//! Elementary functions in f32 that compile to vector code: no branch, no table, no call.
//!
//! They are inlined into kernels compiled once per instruction set, where `mul_add` is one instruction.

/// 1.5·2²³: adding and subtracting it rounds to the nearest integer.
const TO_INTEGER: f32 = 12_582_912.0;

/// Sine and cosine, absolute error below 1.5e-7 for |x| < 10⁴; accuracy fades slowly beyond, NaN stays NaN.
///
/// Reduction by multiples of π/2 in three parts (Cody and Waite), then the minimax polynomials of Cephes on ±π/4.
#[inline(always)]
pub(super) fn sin_cos(x: f32) -> (f32, f32) {
    let rounded = x * std::f32::consts::FRAC_2_PI + TO_INTEGER;
    let quotient = rounded - TO_INTEGER;
    let remainder = quotient.mul_add(-1.570_312_5, x);
    let remainder = quotient.mul_add(-4.837_513e-4, remainder);
    let remainder = quotient.mul_add(-7.549_79e-8, remainder);
    let square = remainder * remainder;
    let sine = (-1.951_529_6e-4_f32).mul_add(square, 8.332_161e-3).mul_add(square, -1.666_665_5e-1);
    let sine = (sine * square).mul_add(remainder, remainder);
    let cosine = 2.443_315_7e-5_f32.mul_add(square, -1.388_731_6e-3).mul_add(square, 4.166_664_6e-2);
    let cosine = (cosine * square).mul_add(square, (-0.5_f32).mul_add(square, 1.0));
    // The last bits of the rounded sum are those of the integer; a conversion, which saturates, would not be vectorised. Beyond
    // 2²² they are not, but such arguments have no meaningful phase in f32 anyway.
    let quadrant = rounded.to_bits() as i32;
    let swapped = quadrant & 1 != 0;
    let (a, b) = if swapped { (cosine, sine) } else { (sine, cosine) };
    let sign = |bit: i32| ((bit & 2) << 30) as u32;
    (
        f32::from_bits(a.to_bits() ^ sign(quadrant)),
        f32::from_bits(b.to_bits() ^ sign(quadrant.wrapping_add(1))),
    )
}

/// e^x, relative error below 2e-7; flushes to zero below −87 and saturates above 88.
#[inline(always)]
pub(super) fn exp(x: f32) -> f32 {
    let clamped = x.clamp(-87.0, 88.0);
    let rounded = clamped.mul_add(std::f32::consts::LOG2_E, TO_INTEGER);
    let power = rounded - TO_INTEGER;
    let rest = power.mul_add(-0.693_145_75, clamped);
    let rest = power.mul_add(-1.428_606_8e-6, rest);
    let series = 1.378_059_4e-3_f32
        .mul_add(rest, 8.373_125e-3)
        .mul_add(rest, 4.166_953_6e-2)
        .mul_add(rest, 1.666_647_2e-1)
        .mul_add(rest, 4.999_998_5e-1)
        .mul_add(rest, 1.0)
        .mul_add(rest, 1.0);
    // The last bits of the rounded sum are those of the integer, and the shift drops the others.
    let scale = f32::from_bits(rounded.to_bits().wrapping_add(127) << 23);
    let value = series * scale;
    if x < -87.0 { 0.0 } else { value }
}

/// Error function, absolute error below 2e-7.
///
/// Polynomial below 0.93, `1 − e^p` above (coefficients after N. Juffa's single-precision erf).
#[inline(always)]
pub(super) fn erf(x: f32) -> f32 {
    let square = x * x;
    let near = (-5.967_617e-4_f32)
        .mul_add(square, 4.991_194_2e-3)
        .mul_add(square, -2.676_813_5e-2)
        .mul_add(square, 1.128_199_25e-1)
        .mul_add(square, -3.761_253_4e-1)
        .mul_add(square, 1.283_791_7e-1)
        .mul_add(x, x);
    // Beyond 4 the function is 1 in f32 while the polynomial would stop being one of it.
    let size = x.abs().min(4.0);
    let far_square = size * size;
    let high = (-1.728_534_7e-5_f32).mul_add(size, 3.831_971_3e-4);
    let low = (-3.883_964_4e-3_f32).mul_add(size, 2.425_462_2e-2);
    let exponent = high
        .mul_add(far_square, low)
        .mul_add(size, -1.067_778_8e-1)
        .mul_add(size, -6.348_468_7e-1)
        .mul_add(size, -1.287_175_1e-1)
        .mul_add(size, -size);
    let far = (1.0 - exp(exponent)).copysign(x);
    if x.abs() > 0.927_734_4 { far } else { near }
}

/// x·Φ(x), Φ the standard normal distribution.
#[inline(always)]
pub(super) fn gelu(x: f32) -> f32 {
    x * normal_distribution(x)
}

/// Derivative of [`gelu`]: Φ(x) + x·φ(x).
#[inline(always)]
pub(super) fn gelu_derivative(x: f32) -> f32 {
    const DENSITY_AT_ZERO: f32 = 0.398_942_3;
    let density = DENSITY_AT_ZERO * exp(-0.5 * x * x);
    x.mul_add(density, normal_distribution(x))
}

#[inline(always)]
fn normal_distribution(x: f32) -> f32 {
    erf(x * std::f32::consts::FRAC_1_SQRT_2).mul_add(0.5, 0.5)
}

/// Hyperbolic tangent, relative error below 5e-7 (rational approximation used by Eigen).
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    let clamped = x.clamp(-7.905_311, 7.905_311);
    let square = clamped * clamped;
    let numerator = (-2.760_768_5e-16_f32)
        .mul_add(square, 2.000_188e-13)
        .mul_add(square, -8.604_672e-11)
        .mul_add(square, 5.122_297e-8)
        .mul_add(square, 1.485_722_4e-5)
        .mul_add(square, 6.372_619_3e-4)
        .mul_add(square, 4.893_524_6e-3);
    let denominator = 1.198_258_4e-6_f32
        .mul_add(square, 1.185_347e-4)
        .mul_add(square, 2.268_434_6e-3)
        .mul_add(square, 4.893_525e-3);
    clamped * numerator / denominator
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(range: f64) -> impl Iterator<Item = f32> {
        (-20_000..=20_000).map(move |step| (f64::from(step) / 20_000.0 * range) as f32)
    }

    /// erf by its everywhere-convergent series in f64 (|x| ≤ 5 needs about 100 terms).
    fn erf_series(x: f64) -> f64 {
        let mut term = x;
        let mut sum = x;
        for n in 1..200 {
            term *= -x * x / f64::from(n);
            sum += term / f64::from(2 * n + 1);
        }
        sum * 2.0 / std::f64::consts::PI.sqrt()
    }

    #[test]
    fn sine_and_cosine_match_f64() {
        for x in points(3_000.0).chain(points(8.0)) {
            let (sine, cosine) = sin_cos(x);
            assert!((f64::from(sine) - f64::from(x).sin()).abs() < 1.5e-7, "sin {x}");
            assert!((f64::from(cosine) - f64::from(x).cos()).abs() < 1.5e-7, "cos {x}");
        }
    }

    #[test]
    fn exponential_matches_f64() {
        for x in points(86.0) {
            let expected = f64::from(x).exp();
            assert!((f64::from(exp(x)) - expected).abs() < 2e-7 * expected, "exp {x}");
        }
        assert_eq!(exp(-200.0), 0.0);
    }

    #[test]
    fn error_function_matches_its_series() {
        for x in points(4.5) {
            let expected = erf_series(f64::from(x));
            assert!((f64::from(erf(x)) - expected).abs() < 2e-7, "erf {x}: {} {expected}", erf(x));
        }
        assert_eq!((erf(40.0), erf(-40.0)), (1.0, -1.0));
    }

    #[test]
    fn tanh_matches_f64() {
        for x in points(12.0).chain(points(0.01)) {
            let expected = f64::from(x).tanh();
            assert!((f64::from(tanh(x)) - expected).abs() <= 5e-7 * expected.abs(), "tanh {x}");
        }
    }

    #[test]
    fn gelu_derivative_is_the_slope_of_the_exact_form() {
        let exact = |x: f64| 0.5 * x * (1.0 + erf_series(x * std::f64::consts::FRAC_1_SQRT_2));
        // The series loses its digits to cancellation further out.
        for x in points(4.5) {
            let x64 = f64::from(x);
            assert!((f64::from(gelu(x)) - exact(x64)).abs() < 1e-6, "gelu {x}");
            let slope = (exact(x64 + 1e-4) - exact(x64 - 1e-4)) / 2e-4;
            assert!((f64::from(gelu_derivative(x)) - slope).abs() < 1e-6, "gelu' {x}");
        }
    }

    #[test]
    fn not_a_number_stays_one() {
        let nan = f32::NAN;
        assert!(sin_cos(nan).0.is_nan() && erf(nan).is_nan() && gelu(nan).is_nan() && tanh(nan).is_nan());
    }
}
