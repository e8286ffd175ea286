use super::*;
use crate::mesh::shapes::{self, SplitMix};
use crate::query::{Distance, Surface, brute_force};

fn buried(union: &UnionDistance) -> usize {
    union.sides().iter().filter(|side| **side == FaceSide::Buried).count()
}

#[test]
fn the_distance_is_continuous_and_its_sign_that_of_the_union() {
    let mesh = shapes::overlapping_balls();
    let surface = Surface::<f64>::from_mesh(&mesh);
    let union = UnionDistance::new(mesh.positions(), mesh.faces());
    assert!(buried(&union) > 1280, "the small ball and the lenses: {}", buried(&union));
    let mut jumps_of_the_closest_point = 0;
    for p in SplitMix::new(11).points(300, 0.9) {
        // Along a line from p to the centre.
        let line: Vec<[f64; 3]> = (0..=400).map(|i| scale(p, 1.0 - f64::from(i) / 400.0)).collect();
        let gaps = |distance| -> Vec<f64> { line.iter().map(|q| surface.gap(*q, distance).gap).collect() };
        let step = vec3::norm(p) / 400.0 + 1e-12;
        let all = gaps(Distance::Union);
        assert!(all.windows(2).all(|w| (w[1] - w[0]).abs() <= step), "a jump towards {p:?}");
        let inside = brute_force::winding_number(mesh.positions(), mesh.faces(), p) > 0.5;
        assert_eq!(all[0] < 0.0, inside);
        let closest = gaps(Distance::ClosestPoint);
        jumps_of_the_closest_point += usize::from(closest.windows(2).any(|w| (w[1] - w[0]).abs() > step));
        // Outside, nothing is nearer than the whole surface.
        if !inside {
            let expected = brute_force::distance_to_surface(mesh.positions(), mesh.faces(), p);
            assert!((all[0] - expected).abs() < 1e-12);
        }
    }
    assert!(jumps_of_the_closest_point > 50, "{jumps_of_the_closest_point}");
}

/// A fine ball through a coarse one, cut where the seam between them goes on: pieces must not run together there.
#[test]
fn a_seam_that_leaves_the_part_still_parts_inside_from_outside() {
    let fine = shapes::mapped(&shapes::icosphere(0.4, 4), |p| vec3::add(p, [0.05, 0.3, 0.1]));
    let mesh = shapes::union(&[&shapes::icosphere(0.5, 1), &fine]);
    let (positions, faces) = (mesh.positions(), mesh.faces());
    let whole = UnionDistance::new(positions, faces);
    for cut in (-6..6).map(|i| 0.05 * f64::from(i)) {
        let is_part = |f: u32| faces[f as usize].iter().any(|&v| positions[v as usize][0] > cut);
        let part = UnionDistance::of_tree(&TriangleTree::of_part(positions, faces, |f, _| is_part(f)));
        for f in (0..faces.len() as u32).filter(|f| is_part(*f)) {
            let (expected, found) = (whole.sides()[f as usize], part.sides()[f as usize]);
            // A face that only intersects what was left out is no seam any more.
            assert!(expected == found || expected == FaceSide::Seam, "cut {cut}, face {f}: {found:?}");
        }
    }
}

#[test]
fn a_part_answers_as_the_whole_does_near_it() {
    let mesh = shapes::overlapping_balls();
    let (positions, faces) = (mesh.positions(), mesh.faces());
    let whole = UnionDistance::new(positions, faces);
    let is_part = |f: u32| faces[f as usize].iter().any(|&v| positions[v as usize][0] > 0.1);
    let part = UnionDistance::of_tree(&TriangleTree::of_part(positions, faces, |f, _| is_part(f)));
    assert!(buried(&part) > 0 && buried(&part) < buried(&whole));
    let mut asked = 0;
    for p in SplitMix::new(17).points(400, 0.9).into_iter().filter(|p| p[0] > 0.2) {
        let (a, is_inside) = whole.project(p).unwrap();
        // The part is all there is in reach.
        if a.distance_squared.sqrt() < p[0] - 0.1 {
            let (b, is_inside_part) = part.project(p).unwrap();
            assert_eq!((a.position, is_inside), (b.position, is_inside_part));
            // Which face may be either of two, on an edge.
            assert!(is_part(b.face));
            asked += 1;
        }
    }
    assert!(asked > 50, "{asked}");
    let judged = |f: &u32| is_part(*f) && whole.sides()[*f as usize] == FaceSide::Buried;
    let buried = (0..faces.len() as u32).filter(judged);
    assert!(buried.into_iter().all(|f| part.sides()[f as usize] == FaceSide::Buried));
}

#[test]
fn without_intersections_nothing_differs() {
    let mesh = shapes::icosphere(0.5, 3);
    let surface = Surface::<f64>::from_mesh(&mesh);
    assert_eq!(buried(surface.union_distance()), 0);
    for p in SplitMix::new(5).points(300, 0.9) {
        let (a, b) = (surface.gap(p, Distance::Union), surface.gap(p, Distance::ClosestPoint));
        assert_eq!((a.gap, a.gradient), (b.gap, b.gradient));
    }
    assert!(surface.gap([f64::NAN, 0.0, 0.0], Distance::Union).gap.is_nan());
    assert!(UnionDistance::new(&[[0.0; 3]], &[]).project([0.0; 3]).is_none());
}
