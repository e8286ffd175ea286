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
fn dressed<R>(meshes: &[TriMesh], with: impl FnOnce(&Outfit<'_>, Vec<[f64; 3]>) -> R) -> R {
    let garments: Vec<RestGarment> = meshes.iter().map(RestGarment::new).collect();
    let layers = layers(&garments, meshes.iter().map(TriMesh::positions));
    with(&Outfit::new(&layers), meshes.iter().flat_map(TriMesh::positions).copied().collect())
}

fn intersections(outfit: &Outfit<'_>, positions: &[[f64; 3]]) -> usize {
    let [lower, upper] = [0, 1].map(|g| (outfit.part(positions, g), outfit.layers[g].garment.faces()));
    triangle_pairs(lower.0, lower.1, upper.0, upper.1).len()
}

/// Enforces contacts until all are met.
fn enforced(contacts: &[Contact], positions: &mut [[f64; 3]], may_move: &[bool]) {
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
    dressed(&sheets(2.0 * WATCH), |outfit, before| {
        let orientation = ContactOrientation::of(outfit, &before, None);
        assert!(orientation.vertices.is_empty() && orientation.edges.is_empty());
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
        for (f, g) in intersected {
            assert!(orientation.is_unknown(f, g) && orientation.is_unknown(g, f));
            let (f, g) = (outfit.faces[f as usize], outfit.faces[g as usize]);
            assert!(!orientation.vertices.iter().any(|s| s.face == g && f.contains(&s.vertex)));
            let is_of = |edge: &[u32; 2], face: [u32; 3]| edges_of(face).contains(edge);
            assert!(!orientation.edges.iter().any(|s| is_of(&s.edges[0], f) && is_of(&s.edges[1], g)));
        }
        // Away from where they cross, every vertex near the other sheet knows its side.
        assert!(
            orientation.vertices.iter().any(|s| s.side > 0.0)
                && orientation.vertices.iter().any(|s| s.side < 0.0)
        );
        let heights =
            orientation.vertices.iter().filter(|s| s.vertex as usize >= outfit.part(&before, 0).len());
        for s in heights.filter(|s| s.gap > 1e-9) {
            let is_over = before[s.vertex as usize][0] > 0.05;
            let looks_up = before[s.face[0] as usize][2] == 0.0;
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
            let is_up =
                |of: &&VertexOverFace| of.vertex as usize >= upper && before[of.face[0] as usize][2] == 0.0;
            orientation.vertices.iter().filter(is_up).filter(|of| of.side > 0.0).count()
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

/// The edges of all garments, numbered through, and those of every face.
#[test]
fn faces_know_their_edges() {
    dressed(&sheets(0.01), |outfit, _| {
        let edges = Edges::of(outfit);
        let distinct: HashSet<[u32; 2]> = edges.all.iter().copied().collect();
        assert_eq!(distinct.len(), edges.all.len());
        for (face, of_face) in outfit.faces.iter().zip(&edges.of_face) {
            assert_eq!(edges_of(*face), of_face.map(|e| edges.all[e as usize]));
        }
    });
}
