//! Small operations on implicit fields shared by the mannequin and the garments.

/// Smooth union: the minimum, rounded where both values differ by less than `k` (polynomial of Quilez). Never larger
/// than the plain minimum.
pub(crate) fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h * 0.25 / k
}

/// Cubic step from 0 at `from` to 1 at `to`; `from` may be the larger one.
pub(crate) fn smooth_step(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Forward-difference gradient together with the value.
pub(crate) fn gradient(field: impl Fn([f64; 3]) -> f64, p: [f64; 3]) -> (f64, [f64; 3]) {
    const GRADIENT_STEP: f64 = 1e-5;
    let value = field(p);
    let slope = std::array::from_fn(|axis| {
        let mut q = p;
        q[axis] += GRADIENT_STEP;
        (field(q) - value) / GRADIENT_STEP
    });
    (value, slope)
}

/// Newton steps along the gradient to the zero level set, each limited to `reach`.
pub(crate) fn project(
    field: impl Fn([f64; 3]) -> f64,
    mut p: [f64; 3],
    steps: usize,
    reach: f64,
) -> [f64; 3] {
    for _ in 0..steps {
        let (value, slope) = gradient(&field, p);
        let squared = slope.iter().map(|g| g * g).sum::<f64>();
        if squared < 1e-6 {
            break;
        }
        let length = value.abs() / squared.sqrt();
        if length < 1e-7 {
            break;
        }
        let factor = value / squared * (reach / length).min(1.0);
        for axis in 0..3 {
            p[axis] -= factor * slope[axis];
        }
    }
    p
}
