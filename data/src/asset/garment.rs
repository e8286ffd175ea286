//! A garment at rest on the zero body.

use super::body::Body;
use super::category::Category;
use super::provenance::Provenance;
use clothcombo_physics::mesh::TriMesh;

/// A garment: its rest mesh lies on the zero body in T-pose, in the body's frame [m].
#[derive(Clone, Debug)]
pub struct Garment {
    /// Name, unique within a dataset.
    pub name: String,
    /// Category.
    pub category: Category,
    /// Rest mesh on the zero body.
    pub rest: TriMesh,
    /// Whether the holding loss keeps its upper rim in place.
    pub holding: bool,
    /// Where it comes from.
    pub source: Provenance,
}

impl Garment {
    /// The paper's rule (§Training, holding loss): a garment whose rest state lies wholly below the collarbone of the zero
    /// body has nothing to hang from, so its rim must be held.
    pub fn needs_holding(rest: &TriMesh, body: &Body) -> bool {
        let top = rest.positions().iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        top < body.collarbone_height()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::mesh::shapes::tube;

    #[test]
    fn only_what_lies_below_the_collarbone_is_held() {
        let body = mannequin();
        let height = body.collarbone_height();
        assert!(height > body.joint_template[9][1] && height < body.joint_template[15][1]);
        let ring = tube(0.2, 0.3, 16, 4);
        let top = ring.positions().iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        for (offset, held) in [(-0.01, true), (0.01, false)] {
            let moved = ring.positions().iter().map(|p| [p[0], p[1] - top + height + offset, p[2]]).collect();
            assert_eq!(Garment::needs_holding(&ring.with_positions(moved).unwrap(), &body), held);
        }
    }
}
