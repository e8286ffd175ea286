//! A garment at rest on the zero body.

use super::body::Body;
use super::category::Category;
use super::garment_material::GarmentMaterial;
use super::provenance::Provenance;
use clothcombo_physics::mesh::TriMesh;

/// A garment: its rest mesh lies on the zero body in T-pose, in the body's frame (m).
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
    /// What it is made of, where that is not what the others are made of.
    pub material: GarmentMaterial,
    /// Where it comes from.
    pub source: Provenance,
}

/// Cloth that hangs lower than this below a crotch (m) is not lifted over it.
const LIFTED: f64 = 0.05;

impl Garment {
    /// A garment without a name or a source whose rim is not held.
    pub fn new(category: Category, rest: TriMesh) -> Self {
        Self {
            name: String::new(),
            category,
            rest,
            holding: false,
            material: GarmentMaterial::default(),
            source: Provenance::default(),
        }
    }

    /// Whether the garment can lie over `inner`. Cloth around each leg cannot lie over cloth that hangs between the legs, such
    /// as a skirt or a long coat: they would have to pass through each other at the crotch.
    fn can_lie_over(&self, inner: &Self) -> bool {
        if self.category != Category::Trousers || inner.category == Category::Trousers {
            return true;
        }
        match (lowest_in_the_middle(&self.rest), lowest_in_the_middle(&inner.rest)) {
            (Some(crotch), Some(hem)) => hem > crotch - LIFTED,
            _ => true,
        }
    }

    /// The paper's rule (§Training, holding loss): a garment whose rest state lies wholly below the collarbone of the zero
    /// body has nothing to hang from, so its rim must be held.
    pub fn needs_holding(rest: &TriMesh, body: &Body) -> bool {
        let top = rest.positions().iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        top < body.collarbone_height()
    }
}

/// The first two of `order`, inner → outer, of which the second cannot lie over the first.
pub fn infeasible_pair<'a>(order: &[&'a Garment]) -> Option<[&'a Garment; 2]> {
    let mut pairs =
        (0..order.len()).flat_map(|outer| (0..outer).map(move |inner| [order[inner], order[outer]]));
    pairs.find(|[inner, outer]| !outer.can_lie_over(inner))
}

/// Height of the lowest cloth in the plane between left and right, x = 0 (m): the crotch of trousers, the hem of everything else.
/// `None` where no cloth crosses it.
fn lowest_in_the_middle(rest: &TriMesh) -> Option<f64> {
    let at = |v: u32| rest.positions()[v as usize];
    let edges = rest.faces().iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let height = |[a, b]: [u32; 2]| {
        let ([left, y, _], [right, other, _]) = (at(a), at(b));
        let crosses = (left < 0.0) != (right < 0.0);
        crosses.then(|| y + left / (left - right) * (other - y))
    };
    edges.filter_map(height).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::mannequin;
    use clothcombo_physics::mesh::shapes::{mapped, tube, union};
    use clothcombo_physics::vec3::add;

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

    /// A tube from height `top` down to `hem` around x = `middle`.
    fn tube_from(middle: f64, radius: f64, top: f64, hem: f64) -> TriMesh {
        let mesh = tube(radius, top - hem, 32, 20);
        let lowest = mesh.positions().iter().map(|p| p[1]).fold(f64::MAX, f64::min);
        mapped(&mesh, |p| add(p, [middle, hem - lowest, 0.0]))
    }

    #[test]
    fn legs_do_not_go_over_cloth_between_them() {
        // Hips down to the crotch at -0.1, and a tube around each leg.
        let trousers = |ankle: f64| {
            let legs = [0.1, -0.1].map(|x| tube_from(x, 0.08, -0.1, ankle));
            let hips = tube_from(0.0, 0.2, 0.2, -0.1);
            Garment::new(Category::Trousers, union(&[&hips, &legs[0], &legs[1]]))
        };
        let (long, short) = (trousers(-0.8), trousers(-0.3));
        let skirt = Garment::new(Category::Skirt, tube_from(0.0, 0.25, 0.1, -0.4));
        let coat = Garment::new(Category::OpenShirt, tube_from(0.0, 0.25, 0.5, -0.4));
        let tee = Garment::new(Category::TShirt, tube_from(0.0, 0.2, 0.5, -0.12));
        for hanging in [&skirt, &coat] {
            assert!(!long.can_lie_over(hanging) && !short.can_lie_over(hanging));
            assert!(hanging.can_lie_over(&long) && hanging.can_lie_over(&tee));
        }
        assert!(long.can_lie_over(&tee) && tee.can_lie_over(&long));
        assert!(short.can_lie_over(&long) && long.can_lie_over(&short));
        let sleeve = Garment::new(Category::Top, tube_from(0.5, 0.1, 0.0, -0.6));
        assert!(long.can_lie_over(&sleeve), "nothing of it is between the legs");
        assert!(infeasible_pair(&[&tee, &long, &coat]).is_none());
        let [inner, outer] = infeasible_pair(&[&coat, &tee, &skirt, &long]).unwrap();
        assert!(std::ptr::eq(inner, &coat) && std::ptr::eq(outer, &long));
    }
}
