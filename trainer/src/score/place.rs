//! Whether meshes are in one unit and one place: what is not intersects nothing, which would look like a good result.

use clothcombo_physics::mesh::TriMesh;

/// Larger bodies than this are not in metres (m).
const TALLEST: f64 = 20.0;
/// Sizes of a garment that are refused, as shares of the body's.
const LARGEST_SHARE: f64 = 5.0;
const SMALLEST_SHARE: f64 = 0.02;
/// A garment farther from the body than this share of the body's size is refused.
const NEAR_SHARE: f64 = 0.25;
/// No cloth gets so many times as large as it is at rest, or as small.
const STRETCHED: f64 = 5.0;

/// What tells that `body` is not in metres, if anything does.
pub(crate) fn oversized(body: &TriMesh) -> Option<String> {
    let largest = body.extent();
    (largest > TALLEST)
        .then(|| format!("the body measures {largest:.0} from end to end, which is no human body in metres"))
}

/// What tells that `garment` is in another unit or place than `body`, if anything does.
pub(crate) fn misplaced(garment: &TriMesh, body: &TriMesh) -> Option<String> {
    let (own, whole) = (garment.extent(), body.extent());
    if own > LARGEST_SHARE * whole || own < SMALLEST_SHARE * whole {
        return Some(format!("the garment measures {own:.3}, the body {whole:.3} from end to end"));
    }
    let ((low, high), (body_low, body_high)) = (garment.bounds(), body.bounds());
    let is_apart =
        |k: usize| low[k] > body_high[k] + NEAR_SHARE * whole || high[k] < body_low[k] - NEAR_SHARE * whole;
    let k = (0..3).find(|k| is_apart(*k))?;
    let axis = ["x", "y", "z"][k];
    Some(format!(
        "the garment lies beside the body: {axis} from {:.3} to {:.3}, the body from {:.3} to {:.3}",
        low[k], high[k], body_low[k], body_high[k]
    ))
}

/// What tells that `rest` is in another unit than `draped`, if anything does.
pub(crate) fn rescaled(rest: &TriMesh, draped: &TriMesh) -> Option<String> {
    let [at_rest, now] = [rest, draped].map(TriMesh::extent);
    (now > STRETCHED * at_rest || at_rest > STRETCHED * now)
        .then(|| format!("the rest mesh measures {at_rest:.3} from end to end, the draped one {now:.3}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_physics::mesh::shapes::{icosphere, mapped};

    #[test]
    fn other_units_and_places_are_told() {
        let (body, garment) = (icosphere(0.9, 2), icosphere(0.5, 2));
        assert_eq!(
            (oversized(&body), misplaced(&garment, &body), rescaled(&garment, &garment)),
            (None, None, None)
        );
        let scaled = |by: f64| mapped(&garment, |p| p.map(|x| by * x));
        for by in [100.0, 1000.0, 0.01, 0.001] {
            assert!(misplaced(&scaled(by), &body).unwrap().contains("measures"), "{by}");
            assert!(rescaled(&scaled(by), &garment).is_some() && rescaled(&garment, &scaled(by)).is_some());
        }
        assert!(oversized(&mapped(&body, |p| p.map(|x| 100.0 * x))).is_some());
        let beside = mapped(&garment, |[x, y, z]| [x, y - 3.0, z]);
        assert!(
            misplaced(&beside, &body).unwrap().contains("y from -3.5"),
            "{:?}",
            misplaced(&beside, &body)
        );
    }
}
