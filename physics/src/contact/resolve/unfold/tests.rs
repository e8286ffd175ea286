//! Sheets with folds.

use std::time::Duration;

use super::super::budget::Budget;
use super::super::{ResolveSettings, Resolved, RestGarment, certify};
use super::places::STRAINED;
use super::*;
use crate::mesh::{TriMesh, shapes};
use crate::vec3::{add_scaled, norm, sub};

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
    let ball = |x: f64| shapes::mapped(&shapes::icosphere(0.1, 3), |p| [p[0] + 0.07 + x, p[1] - 0.11, p[2]]);
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

#[test]
fn what_a_result_still_has_of_a_fold_is_laid_out_and_resolved() {
    let mesh = sheet();
    let garment = RestGarment::new(&mesh);
    let (body, skinned, draped) = (elsewhere(), vec![mesh.positions().to_vec()], folded_sheet(&mesh));
    let layers = [Layer { garment: &garment, positions: &draped }];
    let certificate = certify(&body, &layers).unwrap();
    let folded = Resolved { positions: vec![draped.clone()], certificate, ..Resolved::default() };
    let lay_out = |resolved: &mut Resolved, settings: &ResolveSettings| {
        resolved.lay_out(&body, &layers, &skinned, settings, &Budget::new(settings, 1))
    };
    let late = ResolveSettings { time: Some(Duration::ZERO), ..ResolveSettings::default() };
    let mut kept = folded.clone();
    assert!(!lay_out(&mut kept, &late) && kept == folded);
    let mut resolved = folded;
    assert!(lay_out(&mut resolved, &ResolveSettings::default()));
    assert_eq!(certify(&body, &at(&layers, &resolved.positions)).unwrap().pairs(), 0);
    assert_eq!(resolved.certificate.pairs(), 0);
    let flat = resolved.clone();
    assert!(!lay_out(&mut resolved, &ResolveSettings::default()) && resolved == flat, "nothing is folded");
}
