//! Cloth that a drape folds into itself is laid out, before anything else.
//!
//! What a network adds to a skinned garment is smooth, but where it folds cloth: on a body unlike those it was trained on, or
//! where garments press on each other. No sheet over such a fold can tell its outside from its inside. Around it what is added
//! is replaced by what is smoothest between its surroundings, a harmonic function on the edges: the fold goes, the distance to
//! the body and to other garments stays about what it is next to it.

use rayon::prelude::*;

use super::body::with_drawn;
use super::obstacle::BodyObstacle;
use super::outfit::Outfit;
use super::{Layer, Waypoint, at};
use crate::contact::self_triangle_pairs;
use crate::query::Surface;
use crate::vec3::{add, add_scaled, scale, sub};

/// How far around crossings cloth is laid out [m]: farther where some are left.
const REACH: [f64; 3] = [0.03, 0.06, 0.12];
/// Crossings so near to those of the skinned garment, and to others where the body is pinched, are left [m]: in a closed crease
/// skinning folds cloth as well, and is of no help.
const CREASE: f64 = 0.06;
/// A place is laid out if at most this share of its crossings is left.
const LEFT: f64 = 0.5;
/// Fewest and most rings of neighbours for these distances.
const RINGS: (usize, usize) = (2, 40);
/// What is laid out in one place may raise the strain energy of a garment by this share: a fold that holds more is none to take
/// away. The cloth under a bust that a network folds up over it holds 15 to 30 % in a tight garment…
const STRAINED: f64 = 0.5;
/// …but where the body is pinched there is hardly any room to lay cloth out in.
const STRAINED_WHERE_PINCHED: f64 = 0.1;
/// Sweeps of the smoothing…
const SWEEPS: usize = 100;
/// …and its over-relaxation.
const OVER: f64 = 1.7;

/// Where garments are to be laid out: vertices of each, ascending.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Folds(Vec<Vec<u32>>);

impl Folds {
    /// Around crossings of every garment with itself, where at most half of them are left when it is laid out on `body`.
    pub fn of(body: &Surface<f64>, layers: &[Layer<'_>], skinned: &[Vec<[f64; 3]>]) -> Self {
        let folded = |body: BodyObstacle<'_>| {
            layers.par_iter().zip(skinned).map(|(layer, skinned)| folded(&body, *layer, skinned)).collect()
        };
        Self(with_drawn(body, layers, folded))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(Vec::is_empty)
    }

    /// Adds those of the same garments in another pose, so that what is laid out in one is in the other.
    pub fn add(&mut self, others: &Self) {
        for (folds, more) in self.0.iter_mut().zip(&others.0) {
            folds.extend(more);
            folds.sort_unstable();
            folds.dedup();
        }
    }

    /// The garments without them.
    pub fn laid_out(&self, layers: &[Layer<'_>], skinned: &[Vec<[f64; 3]>]) -> Vec<Vec<[f64; 3]>> {
        let garments = layers.par_iter().zip(skinned).zip(&self.0);
        let laid_out = garments.map(|((layer, skinned), region)| match region.as_slice() {
            [] => layer.positions.to_vec(),
            region => smoothed(&Outfit::new(std::slice::from_ref(layer)), skinned, region),
        });
        laid_out.collect()
    }

    /// The drape of `layers` at `stage` without them.
    pub fn laid_out_at(&self, mut stage: Waypoint, layers: &[Layer<'_>]) -> Waypoint {
        if !self.is_empty() {
            stage.draped = self.laid_out(&at(layers, &stage.draped), &stage.skinned);
        }
        stage
    }
}

/// The folds of one garment.
fn folded(body: &BodyObstacle<'_>, layer: Layer<'_>, skinned: &[[f64; 3]]) -> Vec<u32> {
    let garment = layer.garment;
    let faces = garment.faces();
    let all = self_triangle_pairs(layer.positions, faces);
    if all.is_empty() {
        return Vec::new();
    }
    let outfit = Outfit::new(std::slice::from_ref(&layer));
    let length = garment.edge_lengths.iter().sum::<f64>() / garment.edge_lengths.len() as f64;
    let rings = |reach: f64| ((reach / length).ceil() as usize).clamp(RINGS.0, RINGS.1);
    let near = |pairs: &[(u32, u32)]| {
        let mut is_near = vec![false; skinned.len()];
        let around = outfit.neighbourhood(&corners(pairs, faces), rings(CREASE));
        around.iter().for_each(|&v| is_near[v as usize] = true);
        is_near
    };
    let skinned_too = self_triangle_pairs(skinned, faces);
    let pinched_of = |pairs: &[(u32, u32)], positions| pinched(body, pairs, positions, faces);
    let closed = [pinched_of(&all, layer.positions), pinched_of(&skinned_too, skinned)].concat();
    let is_crease: Vec<bool> =
        near(&closed).into_iter().zip(near(&skinned_too)).map(|(a, b)| a && b).collect();
    let is_outside = |f: u32| !faces[f as usize].iter().any(|&v| is_crease[v as usize]);
    let crossings = |positions: &[[f64; 3]]| {
        let mut pairs = self_triangle_pairs(positions, faces);
        pairs.retain(|&(f, g)| is_outside(f) && is_outside(g));
        pairs
    };
    let found = crossings(layer.positions);
    let pinched = pinched_of(&found, layer.positions);
    let energy = garment.strain_energy(layer.positions);
    let count = |pairs: &[(u32, u32)], place: &[u32]| count_at(pairs, place, &outfit);
    let (mut seeds, mut region) = (Vec::new(), Vec::new());
    let (mut laid_out, mut left) = (layer.positions.to_vec(), found.clone());
    for reach in REACH {
        if left.is_empty() {
            break;
        }
        seeds.extend(corners(&left, faces));
        let around = places(&outfit, &outfit.neighbourhood(&seeds, rings(reach)));
        let mut wider = region.clone();
        around.into_iter().filter(|place| count(&left, place) > 0).for_each(|place| wider.extend(place));
        wider.sort_unstable();
        wider.dedup();
        // No edge joins two places: what is smoothest in one does not depend on the others.
        let smooth = smoothed(&outfit, skinned, &wider);
        let mut now = laid_out.clone();
        let mut take = |place: &[u32], from: &[[f64; 3]]| {
            place.iter().for_each(|&v| now[v as usize] = from[v as usize]);
            garment.strain_energy(&now)
        };
        let mut strained = take(&[], &smooth);
        let is_slack = |place: &Vec<u32>| {
            let allowed = if count(&pinched, place) > 0 { STRAINED_WHERE_PINCHED } else { STRAINED };
            let then = take(place, &smooth);
            let is_slack = then <= strained + allowed * energy;
            strained = if is_slack { then } else { take(place, &laid_out) };
            is_slack
        };
        let tried: Vec<Vec<u32>> = places(&outfit, &wider).into_iter().filter(is_slack).collect();
        let then = crossings(&now);
        for place in tried {
            let [before, last, then] = [&found, &left, &then].map(|pairs| count(pairs, &place));
            if then < last && then as f64 <= LEFT * before as f64 {
                region.extend(place);
            } else {
                place.iter().for_each(|&v| now[v as usize] = laid_out[v as usize]);
            }
        }
        region.sort_unstable();
        region.dedup();
        left = crossings(&now);
        laid_out = now;
    }
    // What is laid out in one place may be in the way of another one.
    if self_triangle_pairs(&laid_out, faces).len() < all.len() { region } else { Vec::new() }
}

/// Those of `pairs` of faces, at `positions`, of which one lies where `body` is pinched.
fn pinched(
    body: &BodyObstacle<'_>,
    pairs: &[(u32, u32)],
    positions: &[[f64; 3]],
    faces: &[[u32; 3]],
) -> Vec<(u32, u32)> {
    let is_pinched = |f: u32| body.is_pinch_at(&faces[f as usize].map(|v| positions[v as usize]));
    pairs.iter().copied().filter(|&(f, g)| is_pinched(f) || is_pinched(g)).collect()
}

/// The vertices of all `pairs` of faces.
fn corners(pairs: &[(u32, u32)], faces: &[[u32; 3]]) -> Vec<u32> {
    pairs.iter().flat_map(|&(f, g)| [f, g]).flat_map(|f| faces[f as usize]).collect()
}

/// How many `pairs` of faces of the lone garment of `outfit` have a vertex in `place`.
fn count_at(pairs: &[(u32, u32)], place: &[u32], outfit: &Outfit<'_>) -> usize {
    let faces = outfit.layers[0].garment.faces();
    let mut is_here = vec![false; outfit.vertex_count()];
    place.iter().for_each(|&v| is_here[v as usize] = true);
    let is_in = |f: u32| faces[f as usize].iter().any(|&v| is_here[v as usize]);
    pairs.iter().filter(|&&(f, g)| is_in(f) || is_in(g)).count()
}

/// The parts of a region of the lone garment of `outfit` that hang together.
fn places(outfit: &Outfit<'_>, region: &[u32]) -> Vec<Vec<u32>> {
    let mut is_left = vec![false; outfit.vertex_count()];
    region.iter().for_each(|&v| is_left[v as usize] = true);
    let mut places = Vec::new();
    for &start in region {
        if !std::mem::replace(&mut is_left[start as usize], false) {
            continue;
        }
        let (mut place, mut next) = (vec![start], 0);
        while let Some(&v) = place.get(next) {
            place.extend(outfit.ring(v).filter(|&n| std::mem::replace(&mut is_left[n as usize], false)));
            next += 1;
        }
        places.push(place);
    }
    places
}

/// The lone garment of `outfit` with what it adds to `skinned` harmonic in `region`: over-relaxed Gauss–Seidel in a fixed order.
fn smoothed(outfit: &Outfit<'_>, skinned: &[[f64; 3]], region: &[u32]) -> Vec<[f64; 3]> {
    let mut positions = outfit.layers[0].positions.to_vec();
    let mut added: Vec<[f64; 3]> = positions.iter().zip(skinned).map(|(p, s)| sub(*p, *s)).collect();
    for _ in 0..SWEEPS {
        for &v in region {
            let ring = outfit.ring(v);
            let share = 1.0 / ring.len().max(1) as f64;
            let mean = scale(ring.fold([0.0; 3], |sum, n| add(sum, added[n as usize])), share);
            let now = added[v as usize];
            added[v as usize] = add_scaled(now, OVER, sub(mean, now));
        }
    }
    for &v in region {
        positions[v as usize] = add(skinned[v as usize], added[v as usize]);
    }
    positions
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::RestGarment;
    use super::*;
    use crate::mesh::{TriMesh, shapes};
    use crate::vec3::norm;

    /// A sheet of 40 cm in the plane y = 0, around the origin.
    fn sheet() -> TriMesh {
        let grid = shapes::irregular_grid(0.4, 0.4, 24, 24, 0.25, 4);
        shapes::mapped(&grid, |[x, y, _]| [x - 0.2, 0.0, y - 0.2])
    }

    /// `p` 1 cm higher, and pushed up to 8 cm along x where it lies around `centre`, over what lies there and back under it.
    pub fn folded_at(p: [f64; 3], centre: [f64; 3]) -> [f64; 3] {
        let from = sub(p, centre);
        let push = 0.08 * (-(norm(from) / 0.04).powi(2)).exp();
        [p[0] + push, 0.01 - 0.5 * push * from[0], p[2]]
    }

    /// A body that no sheet is near to.
    fn elsewhere() -> Surface<f64> {
        Surface::from_mesh(&shapes::mapped(&shapes::tetrahedron(), |[x, y, z]| [x, y - 9.0, z]))
    }

    /// The sheet with a fold in its middle.
    fn folded_sheet(sheet: &TriMesh) -> Vec<[f64; 3]> {
        sheet.positions().iter().map(|p| folded_at(*p, [0.0; 3])).collect()
    }

    #[test]
    fn a_fold_is_laid_out_at_the_height_of_its_surroundings_and_nothing_else_moves() {
        let mesh = sheet();
        let garment = RestGarment::new(&mesh);
        let (skinned, draped) = (vec![mesh.positions().to_vec()], folded_sheet(&mesh));
        let layers = [Layer { garment: &garment, positions: &draped }];
        assert!(self_triangle_pairs(&draped, garment.faces()).len() > 20);
        let folds = Folds::of(&elsewhere(), &layers, &skinned);
        let flat = &folds.laid_out(&layers, &skinned)[0];
        assert!(self_triangle_pairs(flat, garment.faces()).is_empty());
        let (mut moved, mut kept) = (0, 0);
        for (v, (p, q)) in draped.iter().zip(flat).enumerate() {
            if folds.0[0].contains(&(v as u32)) {
                assert!((q[1] - 0.01).abs() < 0.002, "{q:?}");
                moved += 1;
            } else {
                assert_eq!(p, q);
                kept += 1;
            }
        }
        assert!(moved > 50 && kept > 200, "{moved} {kept}");
    }

    #[test]
    fn what_does_not_cross_or_crosses_as_much_when_it_is_skinned_stays() {
        let mesh = sheet();
        let garment = RestGarment::new(&mesh);
        let (flat, folded) = (mesh.positions().to_vec(), folded_sheet(&mesh));
        let crossings = |positions: &[[f64; 3]]| self_triangle_pairs(positions, garment.faces()).len();
        // The fold, but for a share.
        let partly = |share: f64| -> Vec<[f64; 3]> {
            flat.iter().zip(&folded).map(|(p, q)| add_scaled(*p, share, sub(*q, *p))).collect()
        };
        let (much, little) = (partly(0.9), partly(0.62));
        let [all, most, few] = [&folded, &much, &little].map(|p| crossings(p));
        assert!(0 < few && 3 * few < all && 2 * most > all && most < all, "{few} {most} {all}");
        for (draped, skinned, is_laid_out) in [
            (&flat, &folded, false),
            (&folded, &folded, false),
            (&folded, &much, false),
            (&folded, &little, true),
            (&folded, &flat, true),
        ] {
            let layers = [Layer { garment: &garment, positions: draped }];
            let folds = Folds::of(&elsewhere(), &layers, std::slice::from_ref(skinned));
            let now = &folds.laid_out(&layers, std::slice::from_ref(skinned))[0];
            assert_eq!((!folds.is_empty(), now != draped), (is_laid_out, is_laid_out));
            assert!(!is_laid_out || 2 * crossings(now) <= crossings(draped));
        }
    }

    /// Over two balls, which lie in each other under the tip of the fold, or do not. Skinned, the sheet hardly crosses itself.
    #[test]
    fn a_fold_stays_in_a_crease_where_the_body_is_pinched() {
        let mesh = sheet();
        let garment = RestGarment::new(&mesh);
        let (flat, draped) = (mesh.positions(), folded_sheet(&mesh));
        let partly = |(p, q): (&[f64; 3], &[f64; 3])| add_scaled(*p, 0.62, sub(*q, *p));
        let (flat, creased) = (flat.to_vec(), flat.iter().zip(&draped).map(partly).collect::<Vec<_>>());
        assert!(!self_triangle_pairs(&creased, garment.faces()).is_empty());
        let layers = [Layer { garment: &garment, positions: &draped }];
        let ball =
            |x: f64| shapes::mapped(&shapes::icosphere(0.1, 3), |p| [p[0] + 0.07 + x, p[1] - 0.11, p[2]]);
        for (apart, skinned, is_laid_out) in
            [(0.06, &creased, false), (0.06, &flat, true), (0.15, &creased, true), (0.15, &flat, true)]
        {
            let body = Surface::from_mesh(&shapes::union(&[&ball(-apart), &ball(apart)]));
            let folds = Folds::of(&body, &layers, std::slice::from_ref(skinned));
            assert_eq!(!folds.is_empty(), is_laid_out, "{apart}");
        }
    }

    /// Two folds; around the second one skinning pulls a long spike out of the sheet.
    #[test]
    fn a_fold_stays_where_cloth_would_be_stretched_without_it() {
        let mesh = sheet();
        let garment = RestGarment::new(&mesh);
        let centres = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]];
        let fold = |p: &[f64; 3]| folded_at(*p, centres[usize::from(p[0] > 0.0)]);
        let draped: Vec<[f64; 3]> = mesh.positions().iter().map(fold).collect();
        let spike = |p: &[f64; 3]| [p[0], 0.5 * (-(norm(sub(*p, centres[1])) / 0.02).powi(2)).exp(), p[2]];
        let skinned = vec![mesh.positions().iter().map(spike).collect::<Vec<_>>()];
        let layers = [Layer { garment: &garment, positions: &draped }];
        let folds = Folds::of(&elsewhere(), &layers, &skinned);
        assert!(folds.0[0].len() > 20);
        assert!(folds.0[0].iter().all(|v| mesh.positions()[*v as usize][0] < 0.05));
        let flat = &folds.laid_out(&layers, &skinned)[0];
        assert!(garment.strain_energy(flat) <= (1.0 + STRAINED) * garment.strain_energy(&draped));
        let left = self_triangle_pairs(flat, garment.faces());
        assert!(!left.is_empty() && left.len() < self_triangle_pairs(&draped, garment.faces()).len());
    }

    /// A place that is folded in one pose is laid out in all of them.
    #[test]
    fn folds_of_two_poses_add_up() {
        let mesh = sheet();
        let garment = RestGarment::new(&mesh);
        let skinned = vec![mesh.positions().to_vec()];
        let folds_at = |centre: [f64; 3]| {
            let draped: Vec<_> = mesh.positions().iter().map(|p| folded_at(*p, centre)).collect();
            Folds::of(&elsewhere(), &[Layer { garment: &garment, positions: &draped }], &skinned)
        };
        let [left, right] = [-0.1, 0.08].map(|x| folds_at([x, 0.0, 0.0]));
        let mut both = left.clone();
        both.add(&right);
        assert!(both.0[0].len() > left.0[0].len().max(right.0[0].len()));
        assert!(left.0[0].iter().chain(&right.0[0]).all(|v| both.0[0].contains(v)));
        assert!(both.0[0].is_sorted_by(|a, b| a < b));
    }
}
