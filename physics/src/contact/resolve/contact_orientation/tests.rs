use super::super::RestGarment;
use super::super::tests::layers;
use super::*;
use crate::contact::triangle_pairs;
use crate::mesh::TriMesh;
use crate::mesh::shapes::{self, SplitMix};
use crate::vec3::add;

/// Two sheets, the second `gap` over the first, with triangulations that do not fit each other.
fn sheets(gap: f64) -> [TriMesh; 2] {
    let lower = shapes::irregular_grid(0.1, 0.1, 8, 8, 0.3, 3);
    let upper = shapes::mapped(&shapes::irregular_grid(0.1, 0.1, 9, 7, 0.3, 8), |p| add(p, [0.0, 0.0, gap]));
    [lower, upper]
}

/// Calls `with` the outfit of meshes, and their positions one behind the other.
fn dressed<R>(meshes: &[TriMesh], with: impl FnOnce(&PackedCloth<'_>, Vec<[f64; 3]>) -> R) -> R {
    let garments: Vec<RestGarment> = meshes.iter().map(RestGarment::new).collect();
    let layers = layers(&garments, meshes.iter().map(TriMesh::positions));
    with(&PackedCloth::new(&layers), meshes.iter().flat_map(TriMesh::positions).copied().collect())
}

fn intersections(outfit: &PackedCloth<'_>, positions: &[[f64; 3]]) -> usize {
    let [lower, upper] = [0, 1].map(|g| (outfit.part(positions, g), outfit.layers[g].garment.faces()));
    triangle_pairs(lower.0, lower.1, upper.0, upper.1).len()
}

/// Enforces contacts until all are met.
fn enforced(contacts: &[Condition], positions: &mut [[f64; 3]], may_move: &[bool]) {
    for _ in 0..2000 {
        let mut is_violated = false;
        for contact in contacts {
            is_violated |= contact.enforce(positions, may_move);
        }
        if !is_violated {
            break;
        }
    }
}

/// Whichever way the sheets lie, and wherever small moves take their vertices: what keeps their orientation takes them apart
/// again.
#[test]
fn sheets_that_were_pushed_through_each_other_come_back_to_the_side_they_were_on() {
    for gap in [1e-3, -1e-3, 4e-3] {
        dressed(&sheets(gap), |outfit, before| {
            let orientation = ContactOrientation::of(outfit, &before, None);
            assert_eq!(intersections(outfit, &before), 0);
            let mut random = SplitMix::new(7);
            let mut positions = before.clone();
            for (v, p) in positions.iter_mut().enumerate() {
                let through = if v < outfit.part(&before, 0).len() { 0.0 } else { -1.5 * gap };
                let jitter: [f64; 3] = std::array::from_fn(|_| 4e-4 * random.symmetric());
                *p = add(*p, add(jitter, [0.0, 0.0, through]));
            }
            let may_move = vec![true; positions.len()];
            for _ in 0..20 {
                let mut contacts = Vec::new();
                orientation.contacts(&positions, &may_move, 1e-3, &mut contacts);
                enforced(&contacts, &mut positions, &may_move);
            }
            assert_eq!(intersections(outfit, &positions), 0);
            let height = |g: usize| {
                let part = outfit.part(&positions, g);
                part.iter().map(|p| p[2]).sum::<f64>() / part.len() as f64
            };
            assert_eq!((height(1) - height(0)).signum(), gap.signum());
        });
    }
}

#[test]
fn nothing_is_asked_of_what_is_far_or_held() {
    dressed(&sheets(2.0 * ORIENTED_WITHIN), |outfit, before| {
        let orientation = ContactOrientation::of(outfit, &before, None);
        assert!(orientation.pairs.is_empty());
    });
    dressed(&sheets(4e-4), |outfit, before| {
        let orientation = ContactOrientation::of(outfit, &before, None);
        let asked = |is_in: bool| {
            let mut contacts = Vec::new();
            orientation.contacts(&before, &vec![is_in; before.len()], 1e-3, &mut contacts);
            contacts
        };
        assert!(asked(false).is_empty());
        // Within the gap already, they keep the distance that they have.
        let contacts = asked(true);
        assert!(contacts.len() > 100);
        let mut positions = before.clone();
        enforced(&contacts, &mut positions, &vec![true; before.len()]);
        for (p, q) in before.iter().zip(&positions) {
            assert!(norm_squared(sub(*q, *p)) < 1e-20);
        }
    });
}

#[test]
fn faces_that_intersect_have_no_sides() {
    let tilted = |mesh: &TriMesh| shapes::mapped(mesh, |[x, y, z]| [x, y, z + 0.2 * (x - 0.05)]);
    let [lower, upper] = sheets(0.0);
    dressed(&[lower, tilted(&upper)], |outfit, before| {
        let orientation = ContactOrientation::of(outfit, &before, None);
        let intersected = TriangleTree::new(&before, &outfit.faces).self_pairs();
        assert!(intersected.len() > 10);
        let known: HashSet<ElementKey> = orientation.pairs.iter().map(|of| of.pair.key()).collect();
        for (f, g) in intersected {
            assert!(orientation.is_unknown(f, g) && orientation.is_unknown(g, f));
            let mut keys = element_keys(outfit.faces[f as usize], outfit.faces[g as usize]);
            assert!(!keys.any(|key| known.contains(&key)));
        }
        // Away from where they cross, every vertex near the other sheet knows its side.
        let over_faces: Vec<&OrientedPair> = over_faces(&orientation).collect();
        assert!(over_faces.iter().any(|s| s.side > 0.0) && over_faces.iter().any(|s| s.side < 0.0));
        let is_upper = |s: &&&OrientedPair| s.pair.vertices[0] as usize >= outfit.part(&before, 0).len();
        for s in over_faces.iter().filter(is_upper).filter(|s| s.gap > 1e-9) {
            let [vertex, corner, ..] = s.pair.vertices;
            let is_over = before[vertex as usize][0] > 0.05;
            let looks_up = before[corner as usize][2] == 0.0;
            assert!(!looks_up || (s.side > 0.0) == is_over);
        }
    });
}

/// Some vertices of a sheet go through another one: what was before_orientation before brings them back; without that they have
/// no side.
#[test]
fn what_intersects_keeps_the_side_it_had_before() {
    let gap = 2e-3;
    dressed(&sheets(gap), |outfit, before| {
        let before_orientation = ContactOrientation::of(outfit, &before, None);
        let upper = outfit.part(&before, 0).len();
        let mut through = before.clone();
        let is_in_the_middle = |p: &[f64; 3]| p[..2].iter().all(|x| (x - 0.05).abs() < 0.008);
        for p in through[upper..].iter_mut().filter(|p| is_in_the_middle(p)) {
            p[2] -= 1.2 * gap;
        }
        let intersected = intersections(outfit, &through);
        assert!(intersected > 10);
        let unknown = ContactOrientation::of(outfit, &through, None);
        let known = ContactOrientation::of(outfit, &through, Some(&before_orientation));
        // And so on from step to step.
        let known = ContactOrientation::of(outfit, &through, Some(&known));
        assert!(known.not_oriented.is_empty() && unknown.not_oriented.len() == 2 * intersected);
        let over = |orientation: &ContactOrientation| {
            let is_up = |of: &&OrientedPair| {
                let [vertex, corner, ..] = of.pair.vertices;
                vertex as usize >= upper && before[corner as usize][2] == 0.0
            };
            over_faces(orientation).filter(is_up).filter(|of| of.side > 0.0).count()
        };
        assert!(over(&known) > over(&unknown));
        let mut positions = through.clone();
        for _ in 0..20 {
            let mut contacts = Vec::new();
            known.contacts(&positions, &vec![true; before.len()], 1e-3, &mut contacts);
            enforced(&contacts, &mut positions, &vec![true; before.len()]);
        }
        assert_eq!(intersections(outfit, &positions), 0);
    });
}

/// The pairs of a vertex and a face.
fn over_faces(orientation: &ContactOrientation) -> impl Iterator<Item = &OrientedPair> {
    orientation.pairs.iter().filter(|of| of.pair.has_face)
}

/// The edges of all garments, numbered through, and those of every face.
#[test]
fn faces_know_their_edges() {
    dressed(&sheets(0.01), |outfit, _| {
        let edges = Edges::of(outfit);
        let distinct: HashSet<[u32; 2]> = edges.all.iter().copied().collect();
        assert_eq!(distinct.len(), edges.all.len());
        for (face, of_face) in outfit.faces.iter().zip(&edges.of_face) {
            let [a, b, c] = *face;
            let expected = [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]);
            assert_eq!(expected, of_face.map(|e| edges.all[e as usize]));
        }
    });
}
