use super::*;
use crate::energy::tests::scenes::{narrowed, scene_garment};
use crate::energy::{EnergySettings, Term, TermMap};
use crate::mesh::{Topology, TriMesh, shapes};
use crate::vec3::{distance_squared, normalized, sub};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Garments of the given shapes at rest, on a body.
struct TestScene {
    scene: SceneEnergy<f32>,
    rings: Vec<Rings>,
    posed: Vec<[f32; 3]>,
}

impl TestScene {
    fn new(body: &TriMesh, garments: &[TriMesh]) -> Self {
        let settings = EnergySettings::default();
        let garment = |mesh| scene_garment(mesh, &settings, TermMap::filled(1.0), false);
        let scene = SceneEnergy {
            body: Arc::new(Surface::from_mesh(body)),
            garments: garments.iter().map(garment).collect(),
            layers: Vec::new(),
            settings,
        };
        let rings = garments.iter().map(|mesh| Rings::new(&Topology::new(mesh))).collect();
        Self { scene, rings, posed: garments.iter().flat_map(narrowed).collect() }
    }

    fn features(&self, interactions: &[(usize, usize)]) -> ContactFeatures {
        ContactFeatures::new(&self.scene, &self.rings.iter().collect::<Vec<_>>(), &self.posed, interactions)
    }

    fn strain(&self) -> f64 {
        self.scene.only(Term::Strain).expect("a weight").value(&self.posed, &[]).total
    }
}

/// Centimetres that the mean over tangent planes within 1.5 edges (7 mm) lies off on a sphere of 10 cm, at most.
const CURVED: f32 = 0.08;

fn spheres(radii: [f64; 2]) -> [TriMesh; 2] {
    radii.map(|radius| shapes::icosphere(radius, 4))
}

/// The local features of row `v`: of the garments under it and over it.
fn local(found: &ContactFeatures, v: usize) -> [&[f32]; 2] {
    let row = &found.features[FEATURES * v..FEATURES * (v + 1)];
    [&row[..LAYER_FEATURES], &row[LAYER_FEATURES..2 * LAYER_FEATURES]]
}

#[test]
fn a_centimetre_of_air_is_a_feature_of_both_garments() {
    let body = shapes::icosphere(0.09, 4);
    let scene = TestScene::new(&body, &spheres([0.10, 0.11]));
    let found = scene.features(&[(0, 1)]);
    let count = scene.posed.len() / 2;
    assert_eq!(found.features.len(), 2 * count * FEATURES);
    for v in 0..count {
        let [[_, none, _, nothing, ..], over] = local(&found, v) else { panic!("seven numbers") };
        assert_eq!((*none, *nothing), (0.0, MOST as f32), "the inner one has none under it");
        assert!((over[3] - 1.0).abs() < CURVED, "{over:?}");
        let [under, [_, none, ..]] = local(&found, count + v) else { panic!("seven numbers") };
        assert!((under[3] - 1.0).abs() < CURVED && under[0] == 0.0 && *none == 0.0, "{under:?}");
        let radial = normalized(to_f64(scene.posed[count + v]));
        assert!(distance_squared(to_f64(found.directions[0][count + v]), radial) < 1e-3);
        assert!(distance_squared(to_f64(found.directions[2][count + v]), radial) < 1e-3);
        assert_eq!(found.directions[1][count + v], [0.0; 3]);
    }
    let gap = |v: usize| found.features[FEATURES * v + 14];
    assert!((0..count).all(|v| (gap(v) - 1.0).abs() < CURVED && (gap(count + v) - 2.0).abs() < CURVED));
}

#[test]
fn what_is_missing_to_the_right_order_is_a_feature_of_both() {
    let scene = TestScene::new(&shapes::icosphere(0.05, 3), &spheres([0.11, 0.10]));
    let found = scene.features(&[(0, 1)]);
    let count = scene.posed.len() / 2;
    for v in 0..count {
        // A centimetre and the height wanted, by how near the sheet is.
        let expected = 1.4 * (1.0_f32 - 0.01 / 0.08).powi(2);
        for side in [local(&found, v)[1], local(&found, count + v)[0]] {
            assert!((side[0] - expected).abs() < CURVED && side[0] == side[1], "{side:?}");
            assert!((side[3] + 1.0).abs() < CURVED);
        }
    }
}

#[test]
fn rigid_motions_change_no_feature() {
    let (sine, cosine) = 0.7_f64.sin_cos();
    let moved =
        |p: [f64; 3]| [cosine * p[0] - sine * p[2] + 0.3, p[1] - 0.8, sine * p[0] + cosine * p[2] + 0.1];
    // Irregular, so that no two vertices are equally near to a third.
    let bumpy = |mesh: TriMesh| {
        let wave = |x: f64| 0.003 * x.sin();
        shapes::mapped(&mesh, |[x, y, z]| {
            [x + wave(41.0 * y + 17.0 * z), y + wave(37.0 * x + 11.0 * z), z + wave(31.0 * x + 23.0 * y)]
        })
    };
    let garments = [shapes::tube(0.1, 0.3, 24, 14), shapes::tube(0.105, 0.2, 20, 12)].map(bumpy);
    let body = bumpy(shapes::tube(0.08, 0.5, 20, 30));
    let here = TestScene::new(&body, &garments).features(&[(0, 1)]);
    let there =
        TestScene::new(&shapes::mapped(&body, moved), &garments.each_ref().map(|g| shapes::mapped(g, moved)))
            .features(&[(0, 1)]);
    for (a, b) in here.features.iter().zip(&there.features) {
        assert!((a - b).abs() < 2e-3, "{a} {b}");
    }
    for (a, b) in here.directions.iter().flatten().zip(there.directions.iter().flatten()) {
        let turned = sub(moved(to_f64(*a)), moved([0.0; 3]));
        assert!(distance_squared(turned, to_f64(*b)) < 1e-5, "{turned:?} {b:?}");
    }
    assert!(here.features.iter().any(|x| *x != 0.0));
}

#[test]
fn far_cloth_and_cloth_that_faces_backwards_count_for_nothing() {
    let sheet = shapes::grid(0.2, 0.2, 11, 11);
    let at = |height: f64, flip: bool| {
        let moved = shapes::mapped(&sheet, |p| [p[0], p[1], p[2] + height]);
        if flip { moved.turned() } else { moved }
    };
    let body = shapes::tetrahedron();
    let near = |other: TriMesh| {
        let found = TestScene::new(&body, &[sheet.clone(), other]).features(&[(0, 1)]);
        local(&found, 60)[1][2]
    };
    assert!(near(at(0.01, false)) > 0.5);
    assert_eq!(near(at(0.01, true)), 0.0);
    assert_eq!(near(at(0.09, false)), 0.0);
}

#[test]
fn height_over_a_plane_is_exact_and_beyond_the_hem_is_beside() {
    let sheet = shapes::mapped(&shapes::irregular_grid(0.4, 0.4, 21, 21, 0.3, 2), |p| [p[0], p[1], 0.0]);
    let rings = Rings::new(&Topology::new(&sheet));
    let sheet = PosedGarment::new(Surface::from_mesh(&sheet), &rings, sheet.median_edge_length());
    for k in 0..40 {
        let (sine, cosine) = (TAU * f64::from(k) / 40.0).sin_cos();
        let p = [0.2 + 0.15 * cosine, 0.2 + 0.15 * sine, 0.02 * sine];
        let found = height(&sheet, p, [0.0, 0.0, 1.0]).expect("the sheet is near");
        assert!((found.height - p[2]).abs() < 1e-6);
        assert!(found.beside < 0.01, "within half an edge: {}", found.beside);
    }
    let beyond = height(&sheet, [-0.05, 0.2, 0.01], [0.0, 0.0, 1.0]).expect("the hem is near");
    assert!((beyond.height - 0.01).abs() < 1e-6 && (0.05..0.08).contains(&beyond.beside));
}

#[test]
fn a_vertex_that_is_nowhere_spoils_no_other() {
    let mut scene = TestScene::new(&shapes::icosphere(0.05, 3), &spheres([0.10, 0.11]));
    let whole = scene.features(&[(0, 1)]);
    scene.posed[7] = [f32::NAN, 0.0, 0.0];
    let found = scene.features(&[(0, 1)]);
    assert_eq!(found.features.len(), whole.features.len());
    let count = scene.posed.len() / 2;
    let p = spheres([0.10, 0.11])[0].positions()[7].map(|x| -x);
    let distance = |v: usize| distance_squared(to_f64(scene.posed[v]), p);
    let others = (0..count).filter(|v| *v != 7);
    let opposite = others.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).expect("a vertex");
    let row = FEATURES * opposite..FEATURES * (opposite + 1);
    assert_eq!(found.features[row.clone()], whole.features[row]);
}

#[test]
fn means_keep_constants_and_patches_are_two_edges_wide() {
    let sheet = shapes::irregular_grid(0.3, 0.3, 9, 7, 0.2, 4);
    let topology = Topology::new(&sheet);
    let rings = Rings::new(&topology);
    let constant = vec![[2.0, -3.0]; sheet.vertex_count()];
    let averaged = rings.averaged(&constant);
    assert!(averaged.iter().flatten().zip(constant.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12));
    for v in 0..sheet.vertex_count() as u32 {
        let within_two = |u: u32| {
            u == v
                || topology.ring(u as usize).contains(&v)
                || topology.ring(u as usize).iter().any(|&n| topology.ring(n as usize).contains(&v))
        };
        let expected: Vec<u32> = (0..sheet.vertex_count() as u32).filter(|&u| within_two(u)).collect();
        assert_eq!(rings.patch(v), expected);
    }
}

#[test]
fn cloth_at_rest_has_no_forces_and_those_of_stretched_cloth_lead_back() {
    let sheet = shapes::irregular_grid(0.3, 0.3, 16, 16, 0.2, 3);
    let mut scene = TestScene::new(&shapes::tetrahedron(), std::slice::from_ref(&sheet));
    let forces =
        |found: &ContactFeatures| -> Vec<Vec<[f32; 3]>> { found.directions[OUTWARD_DIRECTIONS..].to_vec() };
    let still = forces(&scene.features(&[])).concat().concat();
    assert!(still.iter().all(|f| f.abs() < 1e-3));
    // Stretched by a tenth, and shaken by a millimetre.
    let mut random = shapes::SplitMix::new(4);
    for p in &mut scene.posed {
        *p = p.map(|x| 1.1 * x + 1e-3 * random.symmetric() as f32);
    }
    let before = scene.strain();
    let stretched = scene.posed.clone();
    for (scale, forces) in forces(&scene.features(&[])).into_iter().enumerate() {
        scene.posed = stretched.clone();
        for (p, f) in scene.posed.iter_mut().zip(&forces) {
            // A fifth of the displacement that the force stands for.
            *p = std::array::from_fn(|k| p[k] + 0.2 * 0.002 * f[k]);
        }
        assert!(scene.strain() < 0.99 * before, "scale {scale}: {} of {before}", scene.strain());
        assert!(forces.iter().all(|f| norm(to_f64(*f)) < 5.0));
    }
}
