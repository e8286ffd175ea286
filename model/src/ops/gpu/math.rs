//! The elementary functions of [`math`](super::super::math) on a GPU: the same reductions and polynomials, because the graphics
//! APIs promise an error of 2⁻¹¹ for a sine and nothing for an error function.

use burn_cubecl::cubecl;
use cubecl::prelude::*;

/// Sine, and cosine, of each lane.
#[cube]
pub(super) fn sin_cos<N: Size>(x: Vector<f32, N>) -> (Vector<f32, N>, Vector<f32, N>) {
    let mut sines = Vector::<f32, N>::empty();
    let mut cosines = Vector::<f32, N>::empty();
    #[unroll]
    for lane in 0..N::value() {
        let x = x.extract(lane);
        let quotient = f32::round(x * 0.636_619_77_f32);
        let remainder = fma(quotient, -1.570_312_5_f32, x);
        let remainder = fma(quotient, -4.837_513e-4_f32, remainder);
        let remainder = fma(quotient, -7.549_79e-8_f32, remainder);
        let square = remainder * remainder;
        let sine = fma(fma(-1.951_529_6e-4_f32, square, 8.332_161e-3_f32), square, -1.666_665_5e-1_f32);
        let sine = fma(sine * square, remainder, remainder);
        let cosine = fma(fma(2.443_315_7e-5_f32, square, -1.388_731_6e-3_f32), square, 4.166_664_6e-2_f32);
        let cosine = fma(cosine * square, square, fma(-0.5_f32, square, 1.0_f32));
        let quadrant = i32::cast_from(quotient);
        let swapped = quadrant & 1 != 0;
        let a = select(swapped, cosine, sine);
        let b = select(swapped, sine, cosine);
        sines.insert(lane, select(quadrant & 2 != 0, -a, a));
        cosines.insert(lane, select((quadrant + 1) & 2 != 0, -b, b));
    }
    (sines, cosines)
}

/// Distribution function Φ of the standard normal distribution.
#[cube]
pub(super) fn normal_distribution(x: f32) -> f32 {
    fma(erf(x * std::f32::consts::FRAC_1_SQRT_2), 0.5_f32, 0.5_f32)
}

/// Derivative of x·Φ(x).
#[cube]
pub(super) fn gelu_derivative(x: f32) -> f32 {
    let density = 0.398_942_3_f32 * f32::exp(-0.5_f32 * x * x);
    fma(x, density, normal_distribution(x))
}

#[cube]
fn erf(x: f32) -> f32 {
    let square = x * x;
    let near = fma(-5.967_617e-4_f32, square, 4.991_194_2e-3_f32);
    let near = fma(near, square, -2.676_813_5e-2_f32);
    let near = fma(near, square, 1.128_199_25e-1_f32);
    let near = fma(near, square, -3.761_253_4e-1_f32);
    let near = fma(near, square, 1.283_791_7e-1_f32);
    let near = fma(near, x, x);
    let absolute = f32::abs(x);
    let size = f32::min(absolute, 4.0_f32);
    let high = fma(-1.728_534_7e-5_f32, size, 3.831_971_3e-4_f32);
    let low = fma(-3.883_964_4e-3_f32, size, 2.425_462_2e-2_f32);
    let exponent = fma(high, size * size, low);
    let exponent = fma(exponent, size, -1.067_778_8e-1_f32);
    let exponent = fma(exponent, size, -6.348_468_7e-1_f32);
    let exponent = fma(exponent, size, -1.287_175_1e-1_f32);
    let exponent = fma(exponent, size, -size);
    let far = 1.0_f32 - f32::exp(exponent);
    let far = select(x < 0.0_f32, -far, far);
    select(absolute > 0.927_734_4_f32, far, near)
}

/// Hyperbolic tangent of each lane.
#[cube]
pub(super) fn tanh<N: Size>(x: Vector<f32, N>) -> Vector<f32, N> {
    let mut result = Vector::<f32, N>::empty();
    #[unroll]
    for lane in 0..N::value() {
        let x = x.extract(lane);
        let clamped = select(x > 7.905_311_f32, 7.905_311_f32, x);
        let clamped = select(clamped < -7.905_311_f32, -7.905_311_f32, clamped);
        let square = clamped * clamped;
        let numerator = fma(-2.760_768_5e-16_f32, square, 2.000_188e-13_f32);
        let numerator = fma(numerator, square, -8.604_672e-11_f32);
        let numerator = fma(numerator, square, 5.122_297e-8_f32);
        let numerator = fma(numerator, square, 1.485_722_4e-5_f32);
        let numerator = fma(numerator, square, 6.372_619_3e-4_f32);
        let numerator = fma(numerator, square, 4.893_524_6e-3_f32);
        let denominator = fma(1.198_258_4e-6_f32, square, 1.185_347e-4_f32);
        let denominator = fma(denominator, square, 2.268_434_6e-3_f32);
        let denominator = fma(denominator, square, 4.893_525e-3_f32);
        result.insert(lane, clamped * numerator / denominator);
    }
    result
}
