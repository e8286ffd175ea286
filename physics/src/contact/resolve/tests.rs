//! Every result is judged by all pairs of triangles, none left out by a tree.

use super::*;
use crate::contact::{mesh_triangles_intersect, triangles_intersect};
use crate::mesh::TriMesh;
use crate::mesh::shapes::{self, SplitMix};
use crate::vec3::{self, add, add_scaled, norm, scale};
use std::f64::consts::FRAC_PI_2;
use std::time::Duration;

mod certificate;

fn moved(mesh: &TriMesh, by: [f64; 3]) -> TriMesh {
    shapes::mapped(mesh, |p| add(p, by))
}

/// A flat sheet in the plane y = `height`, centred, normals along +y.
fn sheet(size: f64, cells: usize, height: f64) -> TriMesh {
    let grid = shapes::irregular_grid(size, size, cells, cells, 0.25, 4);
    shapes::mapped(&grid, |[x, y, _]| [y - 0.5 * size, height, x - 0.5 * size])
}

fn corners(positions: &[[f64; 3]], face: [u32; 3]) -> [[f64; 3]; 3] {
    face.map(|v| positions[v as usize])
}

/// Pairs between all meshes and within each but the first, by looking at every two triangles.
fn brute_force_pairs(meshes: &[(&[[f64; 3]], &[[u32; 3]])]) -> usize {
    let mut pairs = 0;
    for (i, (p, f)) in meshes.iter().enumerate() {
        for (q, g) in &meshes[i + 1..] {
            for a in f.iter().map(|a| corners(p, *a)) {
                pairs += g.iter().filter(|b| triangles_intersect(&a, &corners(q, **b))).count();
            }
        }
        if i > 0 {
            for a in 0..f.len() {
                pairs += (a + 1..f.len()).filter(|&b| mesh_triangles_intersect(p, f[a], f[b])).count();
            }
        }
    }
    pairs
}

/// Every garment at its positions.
pub(super) fn layers<'a>(
    garments: &'a [RestGarment],
    positions: impl IntoIterator<Item = &'a [[f64; 3]]>,
) -> Vec<Layer<'a>> {
    let pairs = garments.iter().zip(positions);
    pairs.map(|(garment, positions)| Layer { garment, positions }).collect()
}

struct Scene {
    body: Surface<f64>,
    garments: Vec<RestGarment>,
    positions: Vec<Vec<[f64; 3]>>,
}

impl Scene {
    fn new(body: &TriMesh, garments: &[TriMesh]) -> Self {
        Self {
            body: Surface::from_mesh(body),
            garments: garments.iter().map(RestGarment::new).collect(),
            positions: garments.iter().map(|g| g.positions().to_vec()).collect(),
        }
    }

    fn layers(&self) -> Vec<Layer<'_>> {
        layers(&self.garments, self.positions.iter().map(Vec::as_slice))
    }

    fn pairs(&self, positions: &[Vec<[f64; 3]>]) -> usize {
        let garments = self.garments.iter().zip(positions).map(|(g, p)| (p.as_slice(), g.faces()));
        let body = (self.body.positions.as_slice(), &*self.body.faces);
        brute_force_pairs(&std::iter::once(body).chain(garments).collect::<Vec<_>>())
    }

    fn resolved(&self) -> Resolved {
        resolve(&self.body, &self.layers(), &ResolveSettings::default()).unwrap()
    }

    /// Resolves, and checks the certificate and the pairs by brute force: some before, none after.
    fn must_clear(&self) -> Resolved {
        assert!(self.pairs(&self.positions) > 0, "nothing to do");
        let done = self.resolved();
        assert_eq!(self.pairs(&done.positions), 0, "{:?} {:?}", done.certificate, done.garments);
        assert_eq!(done.certificate.pairs(), 0);
        assert_eq!(done.certificate.max_depth_mm, 0.0);
        assert_eq!(done.certificate.order_violations, 0.0);
        done
    }
}

#[test]
fn a_sheet_that_cuts_a_ball_comes_to_lie_over_it() {
    let scene = Scene::new(&shapes::icosphere(0.2, 3), &[sheet(0.5, 28, 0.17)]);
    let done = scene.must_clear();
    let work = done.garments[0];
    assert!(work.largest_move < 0.06, "{work:?}");
    // Far from the ball nothing moves, to the bit.
    let far = |p: &[f64; 3]| norm([p[0], 0.0, p[2]]) > 0.32;
    let (before, after) = (&scene.positions[0], &done.positions[0]);
    assert!(before.iter().zip(after).all(|(p, q)| !far(p) || p == q));
    // What has to come up does not drag what is beside it along the sheet.
    let sideways = before.iter().zip(after).map(|(p, q)| norm([q[0] - p[0], 0.0, q[2] - p[2]]));
    assert!(sideways.fold(0.0, f64::max) < 0.02);
}

#[test]
fn cloth_coarser_than_the_body_is_lifted_off_its_peaks() {
    // Every vertex of the sheet is outside; the ball pokes through the triangles.
    let ball = shapes::icosphere(0.05, 4);
    let scene = Scene::new(&ball, &[sheet(0.6, 5, 0.04)]);
    let outside = scene.positions[0].iter().filter(|p| norm(**p) > 0.052).count();
    assert_eq!(outside, scene.positions[0].len());
    scene.must_clear();
}

#[test]
fn a_tight_tube_is_widened_over_a_trunk() {
    let trunk = shapes::icosphere(0.2, 4);
    let tube = moved(&shapes::tube(0.19, 0.2, 60, 14), [0.0, -0.1, 0.0]);
    let done = Scene::new(&trunk, &[tube]).must_clear();
    assert!(done.certificate.strain_added.is_none());
}

#[test]
fn layers_that_intersect_are_parted_in_order() {
    let trunk = shapes::icosphere(0.15, 3);
    // A straight tube, and one that waves in and out through it.
    let inner = moved(&shapes::tube(0.165, 0.2, 48, 16), [0.0, -0.1, 0.0]);
    let outer = shapes::mapped(&inner, |[x, y, z]| {
        let factor = 1.0 + 0.03 * (60.0 * y).sin();
        [x * factor, y * 1.05, z * factor]
    });
    let scene = Scene::new(&trunk, &[inner, outer]);
    let done = scene.must_clear();
    assert!(done.garments[1].largest_move < 0.02, "{:?}", done.garments);
}

#[test]
fn reversed_layers_change_places() {
    let trunk = shapes::icosphere(0.15, 3);
    let wide = moved(&shapes::tube(0.175, 0.2, 48, 16), [0.0, -0.1, 0.0]);
    let narrow = moved(&shapes::tube(0.165, 0.2, 44, 15), [0.0, -0.1, 0.0]);
    // The narrow one is to lie over the wide one: nothing intersects, but the order is wrong.
    let scene = Scene::new(&trunk, &[wide, narrow]);
    let before = certify(&scene.body, &scene.layers()).unwrap();
    assert!(before.is_clear() && before.order_violations > 0.9, "{before:?}");
    let [pair] = before.layers[..] else { panic!("one pair of layers: {:?}", before.layers) };
    assert_eq!((pair.inner, pair.outer, pair.triangle_pairs), (0, 1, 0));
    assert_eq!(pair.order_violations, before.order_violations);
    let done = scene.resolved();
    assert_eq!(scene.pairs(&done.positions), 0, "{:?}", done.certificate);
    assert_eq!(done.certificate.order_violations, 0.0);
    // Inside out makes no difference: the body says which side is out.
    let wide = moved(&shapes::tube(0.175, 0.2, 48, 16), [0.0, -0.1, 0.0]);
    let narrow = moved(&shapes::tube(0.165, 0.2, 44, 15), [0.0, -0.1, 0.0]);
    let scene = Scene::new(&trunk, &[wide.turned(), narrow.turned()]);
    let done = scene.resolved();
    assert_eq!((scene.pairs(&done.positions), done.certificate.order_violations), (0, 0.0));
}

#[test]
fn a_hem_is_laid_over_the_garment_it_cuts() {
    let trunk = shapes::mapped(&shapes::icosphere(0.12, 3), |[x, y, z]| [x, 2.0 * y, z]);
    // A skirt that flares out through the hem of a jacket.
    let skirt = shapes::mapped(&shapes::tube(0.14, 0.25, 60, 20), |[x, y, z]| {
        let flare = 1.0 + 1.2 * (0.25 - y).max(0.0);
        [x * flare, y - 0.25, z * flare]
    });
    let jacket = moved(&shapes::tube(0.155, 0.25, 52, 18), [0.0, -0.12, 0.0]);
    let scene = Scene::new(&trunk, &[skirt, jacket]);
    let done = scene.must_clear();
    // The skirt gives way a little under the hem; where it ends, well below, it stays as it was.
    assert!(done.garments.iter().all(|work| work.largest_move < 0.03), "{:?}", done.garments);
    let is_low = |p: &&[f64; 3]| p[1] < -0.245;
    let low = |positions: &[Vec<[f64; 3]>]| -> Vec<[f64; 3]> {
        positions[0].iter().filter(is_low).copied().collect()
    };
    assert_eq!(low(&done.positions), low(&scene.positions));
}

#[test]
fn two_folds_of_one_garment_are_parted() {
    let trunk = shapes::icosphere(0.05, 3);
    // A sheet folded like a hairpin whose upper half dips through the lower one.
    let fold = shapes::mapped(&shapes::grid(0.4, 0.2, 40, 20), |[x, y, _]| {
        let s = x - 0.2;
        let angle = (s / 0.012).clamp(-FRAC_PI_2, FRAC_PI_2);
        let straight = (s.abs() - 0.012 * FRAC_PI_2).max(0.0);
        let dip = 0.018 * (-((straight - 0.09) / 0.02).powi(2) - ((y - 0.1) / 0.03).powi(2)).exp();
        let height = 0.012 * angle.sin() - if s > 0.0 { dip * 1.6 } else { 0.0 };
        [0.012 * angle.cos() - straight, 0.3 + height, y]
    });
    let scene = Scene::new(&trunk, &[fold]);
    scene.must_clear();
}

#[test]
fn a_clean_outfit_comes_back_to_the_bit() {
    let trunk = shapes::icosphere(0.15, 4);
    let inner = moved(&shapes::tube(0.16, 0.2, 48, 16), [0.0, -0.1, 0.0]);
    let outer = moved(&shapes::tube(0.165, 0.2, 44, 15), [0.0, -0.1, 0.0]);
    let scene = Scene::new(&trunk, &[inner, outer]);
    let done = scene.resolved();
    assert_eq!(done.positions, scene.positions);
    assert!(done.garments.iter().all(|w| w.moved == 0 && w.rounds == 0));
    // And what was resolved is clean.
    let cut = Scene::new(&shapes::icosphere(0.2, 3), &[sheet(0.5, 28, 0.17)]);
    let once = cut.resolved();
    let again = Scene { positions: once.positions.clone(), ..cut };
    assert_eq!(again.resolved().positions, once.positions);
}

#[test]
fn the_same_for_any_number_of_threads() {
    let trunk = shapes::icosphere(0.15, 4);
    let inner = moved(&shapes::tube(0.148, 0.2, 64, 20), [0.0, -0.1, 0.0]);
    let outer = shapes::mapped(&inner, |[x, y, z]| [x * (1.0 + 0.04 * (50.0 * y).sin()), y, z]);
    let scene = Scene::new(&trunk, &[inner, outer]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let done = pool.install(|| scene.resolved());
        (done.positions, done.certificate)
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(4));
}

#[test]
fn nested_tubes_with_random_bulges_are_untangled() {
    let trunk = shapes::icosphere(0.15, 4);
    for seed in 0..6 {
        let mut random = SplitMix::new(100 + seed);
        // Three tubes, each 4 mm over the one before, whose radii swing by up to 6 mm.
        let garments: Vec<TriMesh> = (0..3)
            .map(|layer| {
                let tube =
                    moved(&shapes::tube(0.155 + 0.004 * f64::from(layer), 0.16, 52, 14), [0.0, -0.08, 0.0]);
                let waves: Vec<[f64; 3]> = (0..3)
                    .map(|_| [0.002 * random.symmetric(), 40.0 * random.symmetric(), random.symmetric()])
                    .collect();
                shapes::mapped(&tube, |[x, y, z]| {
                    let angle = z.atan2(x);
                    let swing: f64 =
                        waves.iter().map(|[a, k, t]| a * (k * y + 2.0 * angle + 6.0 * t).sin()).sum();
                    let factor = 1.0 + swing / 0.155;
                    [x * factor, y, z * factor]
                })
            })
            .collect();
        let scene = Scene::new(&trunk, &garments);
        if scene.pairs(&scene.positions) > 0 {
            let done = scene.must_clear();
            assert!(done.garments.iter().all(|w| w.largest_move < 0.015), "{:?}", done.garments);
        }
    }
}

#[test]
fn a_sleeve_and_the_chest_stay_on_their_own_sides() {
    // An arm beside a trunk, each in its own tube of one garment, and the tubes run into each other in between.
    let limb =
        |radius, at| moved(&shapes::mapped(&shapes::icosphere(radius, 4), |[x, y, z]| [x, 2.0 * y, z]), at);
    let body = shapes::union(&[&limb(0.1, [0.0; 3]), &limb(0.04, [0.158, 0.0, 0.0])]);
    let tube = |radius, cells, x| moved(&shapes::tube(radius, 0.12, cells, 10), [x, -0.06, 0.0]);
    let garment = shapes::union(&[&tube(0.109, 44, 0.0), &tube(0.052, 24, 0.158)]);
    let scene = Scene::new(&body, &[garment]);
    assert!(certify(&scene.body, &scene.layers()).unwrap().self_triangle_pairs > 0);
    scene.must_clear();
}

#[test]
fn no_vertex_goes_farther_and_no_edge_gets_longer_than_allowed() {
    // A tube far too tight for the ball: it cannot be mended within the limits.
    let tube = moved(&shapes::tube(0.15, 0.36, 40, 16), [0.0, -0.18, 0.0]);
    let scene = Scene::new(&shapes::icosphere(0.2, 3), &[tube]);
    let settings =
        ResolveSettings { farthest: 0.03, stretch: 1.1, loosened: 1.0, ..ResolveSettings::default() };
    let done = resolve(&scene.body, &scene.layers(), &settings).unwrap();
    assert!(!done.certificate.is_clear());
    assert!(done.garments[0].largest_move <= 0.03 + 1e-12, "{:?}", done.garments);
    // A wider second attempt is not wide enough either, but attempts that begin where it ended are.
    let widened = ResolveSettings { loosened: 2.0, ..settings };
    let done = resolve(&scene.body, &scene.layers(), &widened).unwrap();
    assert_eq!(scene.pairs(&done.positions), 0, "{:?} {:?}", done.certificate, done.garments);
    assert!(done.garments[0].largest_move > 0.03);
    // Without limits the first one is.
    let free = ResolveSettings { farthest: 1.0, stretch: 100.0, ..ResolveSettings::default() };
    let done = resolve(&scene.body, &scene.layers(), &free).unwrap();
    assert_eq!(scene.pairs(&done.positions), 0, "{:?} {:?}", done.certificate, done.garments);
}

#[test]
fn arms_inside_a_trunk_are_pinched_and_told_apart() {
    // Two overlapping balls, each in its own bag: where the balls overlap the bags cannot but intersect.
    let left = moved(&shapes::icosphere(0.1, 3), [-0.06, 0.0, 0.0]);
    let right = moved(&shapes::icosphere(0.1, 3), [0.06, 0.0, 0.0]);
    let body = shapes::union(&[&left, &right]);
    let bag = |by: f64| moved(&shapes::icosphere(0.105, 3), [by, 0.0, 0.0]);
    let scene = Scene::new(&body, &[shapes::union(&[&bag(-0.06), &bag(0.06)])]);
    let found = certify(&scene.body, &scene.layers()).unwrap();
    assert!(found.pinched.body_triangle_pairs > 0, "{found:?}");
    assert_eq!(
        found.remaining.len(),
        found.pairs() + found.pinched.body_triangle_pairs + found.pinched.self_triangle_pairs
    );
}

#[test]
fn no_input_makes_it_panic() {
    let mut random = SplitMix::new(17);
    let body = shapes::icosphere(0.15, 2);
    for round in 0..60 {
        let inner = moved(&shapes::tube(0.15, 0.2, 12, 5), [0.0, -0.1, 0.0]);
        let outer = moved(&shapes::tube(0.16, 0.2, 10, 4), [0.0, -0.1, 0.0]);
        let mut scene = Scene::new(&body, &[inner, outer]);
        for positions in &mut scene.positions {
            for _ in 0..round {
                let v = (random.symmetric().abs() * positions.len() as f64) as usize % positions.len();
                let shift: [f64; 3] = std::array::from_fn(|_| random.symmetric());
                positions[v] = match round % 4 {
                    // Crumpled, collapsed, far away, broken.
                    0 => add_scaled(positions[v], 0.1, shift),
                    1 => positions[(v + 1) % positions.len()],
                    2 => scale(shift, 900.0),
                    _ => [f64::NAN, shift[0], f64::INFINITY],
                };
            }
        }
        let settings = ResolveSettings { rounds: 6, ..ResolveSettings::default() };
        match resolve(&scene.body, &scene.layers(), &settings) {
            Ok(done) => assert!(done.positions.iter().flatten().all(|p| vec3::is_finite(*p))),
            Err(ResolveError::Position { .. }) => assert!(round % 4 == 3),
            Err(other) => panic!("{other}"),
        }
    }
}

#[test]
fn wrong_input_is_named() {
    let scene = Scene::new(&shapes::icosphere(0.1, 2), &[sheet(0.3, 4, 0.2)]);
    let short = [Layer { garment: &scene.garments[0], positions: &scene.positions[0][1..] }];
    let found = resolve(&scene.body, &short, &ResolveSettings::default());
    assert!(matches!(found, Err(ResolveError::Count { garment: 0, expected: 25, found: 24 })));
    let settings = ResolveSettings { gap: 0.0, ..ResolveSettings::default() };
    let found = resolve(&scene.body, &scene.layers(), &settings);
    assert!(matches!(found, Err(ResolveError::Setting { setting: "gap", .. })));
    let body = Surface::new(vec![[f64::NAN; 3]; 3], [[0, 1, 2]].as_slice().into());
    let found = resolve(&body, &scene.layers(), &ResolveSettings::default());
    assert_eq!(found.unwrap_err(), ResolveError::EmptyBody);
    let cloth = sheet(0.3, 4, 0.2);
    let [a, b, c] = cloth.faces()[7];
    for again in [[c, a, b], [a, c, b]] {
        let faces = [cloth.faces(), &[again]].concat();
        let doubled = TriMesh::new(cloth.positions().to_vec(), faces).unwrap();
        let scene = Scene::new(&shapes::icosphere(0.1, 2), &[cloth.clone(), doubled]);
        let found = resolve(&scene.body, &scene.layers(), &ResolveSettings::default());
        assert_eq!(found.unwrap_err(), ResolveError::DoubledFace { garment: 1, face: 32, first: 7 });
    }
}

#[test]
fn of_two_results_the_one_with_fewer_defects_counts_and_the_work_of_both() {
    let result = |body_triangle_pairs, narrow_triangle_pairs, layer_triangle_pairs, rounds| Resolved {
        certificate: Certificate {
            body_triangle_pairs,
            narrow_triangle_pairs,
            layer_triangle_pairs,
            ..Certificate::default()
        },
        garments: vec![GarmentWork { rounds, time: Duration::from_secs(1), ..GarmentWork::default() }],
        steps: 3,
        ..Resolved::default()
    };
    let with_strain = |mut of: Resolved, strain| {
        of.certificate.strain_added = Some(strain);
        of
    };
    let strained = |strain| with_strain(result(0, 0, 0, 0), strain);
    // A clear state comes first, then less excess strain, then intersections and narrow pairs.
    let (intersected, narrow, clear) = (result(8, 0, 0, 1), result(10, 10, 0, 2), result(0, 0, 0, 4));
    for (first, second, best) in [
        (&intersected, &narrow, &narrow),
        (&narrow, &intersected, &narrow),
        (&narrow, &clear, &clear),
        (&clear, &narrow, &clear),
        (&result(2, 2, 1, 0), &result(1, 0, 0, 0), &result(1, 0, 0, 0)),
        (&strained(0.9), &narrow, &strained(0.9)),
        (&strained(1.1), &strained(0.4), &strained(0.4)),
        // A little more strain is no reason to take another result.
        (&strained(0.4), &strained(0.1), &strained(0.4)),
        (&intersected, &strained(30.0), &strained(30.0)),
        (&intersected, &with_strain(result(1, 0, 0, 0), 30.0), &intersected),
        (&intersected, &with_strain(narrow.clone(), 0.4), &with_strain(narrow.clone(), 0.4)),
    ] {
        let found = first.clone().or(second.clone());
        assert_eq!(found.certificate, best.certificate);
        assert_eq!(found.garments[0].rounds, first.garments[0].rounds + second.garments[0].rounds);
        assert_eq!((found.garments[0].time, found.steps), (Duration::from_secs(2), 6));
    }
}
