//! What the shape of a body means to networks that were trained on another one.
//!
//! A shape parameter means something in the space of its own body model only. The networks see the shape of *their*
//! body: where another body is dressed, the shape of theirs that looks most like it. What is geometry (surface,
//! skinning, shape transfer) comes from the body itself.

use clothcombo_data::asset::{Body, ShapeMatch, match_shape};
use std::sync::{Mutex, PoisonError};

/// The shape space of the body that is dressed, as the networks know it.
pub(super) enum ShapeSpace {
    /// Their own.
    Own,
    /// Another one; their own body, if it is at hand, and the range of shapes they were trained on.
    Other { model_body: Option<Box<Body>>, range: [f64; 2], last: Mutex<Option<(Vec<f64>, Vec<f64>)>> },
}

/// Bodies are the same where they differ by no more than rounding (m).
const SAME_POSITION: f64 = 1e-5;

impl ShapeSpace {
    /// That of `body`, for networks trained on `model_body`.
    pub fn new(body: &Body, model_body: Option<Body>, range: [f64; 2]) -> Self {
        match model_body {
            Some(own) if is_same_space(body, &own) => Self::Own,
            own => Self::Other { model_body: own.map(Box::new), range, last: Mutex::new(None) },
        }
    }

    /// The `count` shape parameters that the networks see for `shape` of `body`.
    pub fn seen(&self, body: &Body, shape: &[f64], count: usize) -> Vec<f64> {
        let mut seen = match self {
            Self::Own => shape.to_vec(),
            Self::Other { model_body: None, .. } => Vec::new(),
            Self::Other { model_body: Some(own), range, last } => {
                let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
                match &*last {
                    Some((of, found)) if of == shape => found.clone(),
                    _ => {
                        let found = matched(own, *range, body, shape);
                        *last = Some((shape.to_vec(), found.clone()));
                        found
                    }
                }
            }
        };
        // A body with fewer components than the networks know has the others at their mean.
        seen.resize(count, 0.0);
        seen
    }
}

fn matched(own: &Body, range: [f64; 2], body: &Body, shape: &[f64]) -> Vec<f64> {
    // A shape that the body does not have is refused elsewhere, by name.
    let Ok(shaped) = body.shaped(shape) else { return Vec::new() };
    let ShapeMatch { shape: found, mean_distance } =
        match_shape(own, range, shaped.positions, body.faces.clone());
    let numbers: Vec<String> = found.iter().take(4).map(|b| format!("{b:.2}")).collect();
    tracing::info!(
        "body '{}' has another shape space than the model's: the networks see the shape of '{}' that looks most like it, [{}, …], \
         {:.1} mm away on average",
        body.name,
        own.name,
        numbers.join(", "),
        1e3 * mean_distance
    );
    found
}

/// Whether equal parameters make equal bodies, in the components that both have.
fn is_same_space(a: &Body, b: &Body) -> bool {
    let near = |x: f64, y: f64| (x - y).abs() < SAME_POSITION;
    let k = a.shape_count.min(b.shape_count);
    // A body without shapes is the mean body.
    if a.vertex_count() != b.vertex_count() {
        return false;
    }
    let is_same_template =
        a.template.as_flattened().iter().zip(b.template.as_flattened()).all(|(x, y)| near(*x, *y));
    let rows = |body: &Body, i: usize| {
        (0..k).map(|n| f64::from(body.shape_directions[i * body.shape_count + n])).collect::<Vec<_>>()
    };
    is_same_template
        && (0..3 * a.vertex_count()).all(|i| rows(a, i).iter().zip(rows(b, i)).all(|(x, y)| near(*x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::asset::skeleton::joint_names;
    use clothcombo_data::generate::mannequin;

    const RANGE: [f64; 2] = [-2.0, 2.0];

    #[test]
    fn joints_are_no_part_of_the_shape_space() {
        let body = mannequin();
        for other in [body.clone(), body.clone().with_joints(&joint_names(55)).unwrap()] {
            let space = ShapeSpace::new(&other, Some(body.clone()), RANGE);
            assert!(matches!(space, ShapeSpace::Own));
            assert_eq!(space.seen(&other, &[1.5, -0.5], 3), [1.5, -0.5, 0.0]);
        }
        let fewer = body.clone().with_shape_components(2);
        assert!(matches!(ShapeSpace::new(&fewer, Some(body), RANGE), ShapeSpace::Own));
    }

    #[test]
    fn shapes_of_another_body_are_those_of_the_models_that_look_like_it() {
        let own = mannequin();
        // The same bodies with the signs of all shapes turned, and the vertices in another order.
        let mut other = own.clone();
        other.shape_directions.iter_mut().for_each(|d| *d = -*d);
        other.joint_shape_directions.iter_mut().for_each(|d| *d = -*d);
        let space = ShapeSpace::new(&other, Some(own.clone()), RANGE);
        let seen = space.seen(&other, &[1.0, -0.5], own.shape_count);
        assert!((seen[0] + 1.0).abs() < 0.35, "{seen:?}");
        assert_eq!(seen, space.seen(&other, &[1.0, -0.5], own.shape_count));
        let mean = space.seen(&other, &[], own.shape_count);
        assert!(mean.iter().all(|b| b.abs() < 0.05), "{mean:?}");
        // Where their body is not at hand, the networks see its mean.
        let unknown = ShapeSpace::new(&other, None, RANGE);
        assert_eq!(unknown.seen(&other, &[1.0], 3), [0.0; 3]);
    }
}
