//! Dressing: garments in their order on the body they were made on, from rest meshes that know nothing of each other.
//!
//! In the T-pose the sides are plain: along the directions away from the body an outer garment lies beyond an inner one, as far as
//! they cover each other. What comes out depends on garments and order alone, so that it can be kept; shape and pose come later.

use std::time::{Duration, Instant};

use super::body::with_drawn;
use super::fast_pass::{FastPass, ORDER_VIOLATIONS, contact_mesh};
use super::garment::{at, check};
use super::outfit::Outfit;
use super::{Certificate, Layer, ResolveError, ResolveSettings};
use crate::contact::FilterWork;
use crate::query::Surface;

/// How often a garment is tried from where it came to: lengths are then measured anew.
const ATTEMPTS: usize = 3;

/// Garments in their order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dressed {
    /// Positions of every garment, `[V, 3]` (m).
    pub positions: Vec<Vec<[f64; 3]>>,
    /// What is left; of an order that cannot be worn only the garments up to the first that is blocked.
    pub certificate: Certificate,
    /// Garments (inner, outer) that block each other, those with most intersections first; none if all are dressed.
    pub blocked: Vec<(usize, usize)>,
    /// Rounds of relaxation.
    pub rounds: usize,
    /// What the step filter did.
    pub filter: FilterWork,
    /// Wall time of all.
    pub time: Duration,
}

impl Dressed {
    /// Whether all garments are in their order and intersect neither the body nor each other.
    pub fn is_clear(&self) -> bool {
        self.certificate.is_clear() && self.blocked.is_empty()
    }
}

/// Brings `layers`, innermost first and where they lie at rest, into their order on `body`, the one they were made on.
/// Deterministic for any number of threads.
///
/// # Errors
/// Those of [`super::resolve`]. An order that cannot be worn is no error: [`Dressed::blocked`] lists it.
pub fn dress(
    body: &Surface<f64>,
    layers: &[Layer<'_>],
    settings: &ResolveSettings,
) -> Result<Dressed, ResolveError> {
    settings.check()?;
    check(body, layers)?;
    let start = Instant::now();
    let mut found = Dressed::default();
    for count in 1..=layers.len() {
        let worn = &layers[..count];
        // From the inside out: the next garment comes over those that are in order already, which may give way.
        found.positions.push(layers[count - 1].positions.to_vec());
        for _ in 0..ATTEMPTS {
            found.attempt(body, &at(worn, &found.positions.clone()), settings);
            if found.is_clear() {
                break;
            }
        }
        if !found.certificate.is_clear() {
            // Nothing comes over what is not in order: the others stay at rest.
            found.positions.extend(layers[count..].iter().map(|layer| layer.positions.to_vec()));
            break;
        }
    }
    found.certificate.compare_strain(&layers[..found.certificate.garments.len()]);
    found.time = start.elapsed();
    Ok(found)
}

impl Dressed {
    /// Brings `layers` into their order from where they are.
    fn attempt(&mut self, body: &Surface<f64>, layers: &[Layer<'_>], settings: &ResolveSettings) {
        with_drawn(body, layers, |drawn| {
            let outfit = Outfit::new(layers);
            let mesh = contact_mesh(&outfit, &drawn);
            let mut pass = FastPass::new(&outfit, &drawn, &mesh, settings, true);
            self.rounds += pass.run();
            self.positions = pass.garments();
            self.filter = self.filter.and(pass.filter.work);
            self.certificate = pass.certificate(&self.positions);
            self.blocked = blocked(&self.certificate);
        });
    }
}

fn blocked(certificate: &Certificate) -> Vec<(usize, usize)> {
    let is_blocked = |pairs: usize, violations: f64| pairs > 0 || violations > ORDER_VIOLATIONS;
    let mut found: Vec<_> = certificate
        .layers
        .iter()
        .filter(|layer| is_blocked(layer.triangle_pairs, layer.order_violations))
        .collect();
    found.sort_by_key(|layer| std::cmp::Reverse(layer.triangle_pairs));
    found.into_iter().map(|layer| (layer.inner, layer.outer)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::resolve::RestGarment;
    use crate::mesh::TriMesh;
    use crate::mesh::shapes;
    use crate::vec3::norm;

    fn dressed(radii: &[f64]) -> (Dressed, Vec<f64>) {
        let trunk = shapes::icosphere(0.15, 3);
        let tube = |(i, radius): (usize, &f64)| {
            let tube = shapes::tube(*radius, 0.1, 40 + 3 * i, 9 + i);
            shapes::mapped(&tube, |[x, y, z]| [x, y - 0.05, z])
        };
        let tubes: Vec<TriMesh> = radii.iter().enumerate().map(tube).collect();
        let garments: Vec<RestGarment> = tubes.iter().map(RestGarment::new).collect();
        let layers: Vec<Layer<'_>> = garments
            .iter()
            .zip(&tubes)
            .map(|(garment, mesh)| Layer { garment, positions: mesh.positions() })
            .collect();
        let found = dress(&Surface::from_mesh(&trunk), &layers, &ResolveSettings::default()).unwrap();
        let mean =
            |p: &Vec<[f64; 3]>| p.iter().map(|[x, _, z]| norm([*x, 0.0, *z])).sum::<f64>() / p.len() as f64;
        let means = found.positions.iter().map(mean).collect();
        (found, means)
    }

    /// No two of them intersect where they lie at rest.
    #[test]
    fn garments_come_into_their_order_though_they_rest_in_the_opposite_one() {
        let (found, radii) = dressed(&[0.17, 0.163, 0.156]);
        assert!(found.is_clear(), "{:?}", found.blocked);
        assert!(radii[0] < radii[1] && radii[1] < radii[2], "{radii:?}");
    }

    #[test]
    fn garments_in_order_stay_to_the_bit() {
        let (found, radii) = dressed(&[0.156, 0.16]);
        assert!(found.is_clear() && found.filter == FilterWork::default());
        assert!(found.certificate.strain_added.is_none() && radii[0] < radii[1]);
    }
}
