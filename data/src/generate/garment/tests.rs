use super::design::{FlareDesign, Front, Neckline, PleatDesign, SkirtDesign, SleeveDesign, UpperDesign};
use super::*;
use crate::asset::BodyParts;
use crate::generate::mannequin;
use rayon::prelude::*;
use std::collections::HashSet;

/// The guarantees, measured without the generator's own label bookkeeping.
fn assert_guarantees(generator: &GarmentGenerator, garment: &Garment) {
    let quality = generator.quality(&garment.rest);
    let name = &garment.name;
    assert!(quality.is_orientable_manifold, "{name}");
    assert_eq!(quality.components, 1, "{name}");
    assert!((2..=4).contains(&quality.boundary_loops), "{name}");
    assert_eq!(quality.euler_characteristic, 2 - quality.boundary_loops as i64, "{name}");
    assert!(quality.smallest_angle >= 15.0, "{name}: {}", quality.smallest_angle);
    assert!(quality.edge_ratio[0] >= 0.4 && quality.edge_ratio[1] <= 2.5, "{name}: {:?}", quality.edge_ratio);
    assert!(quality.least_gap >= 0.003, "{name}: {}", quality.least_gap);
    assert_eq!((quality.body_triangle_pairs, quality.self_triangle_pairs), (0, 0), "{name}");
    assert!(quality.outward > 0.6, "{name}: {}", quality.outward);
}

#[test]
fn every_category_keeps_the_guarantees_with_a_topology_of_its_own() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    const VERTICES: usize = 700;
    let mut seen = HashSet::new();
    for category in Category::ALL {
        for seed in 0..3 {
            let garment = generator.generate(category, seed, VERTICES).unwrap();
            assert_guarantees(&generator, &garment);
            assert!(seen.insert(garment.rest.faces().to_vec()));
            let vertices = garment.rest.vertex_count();
            assert!((350..1100).contains(&vertices), "{}: {vertices} vertices", garment.name);
        }
    }
}

#[test]
fn the_categories_cover_what_they_should() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    const VERTICES: usize = 500;
    let joint = &body.joint_template;
    for seed in 20..23 {
        for category in Category::ALL {
            let garment = generator.generate(category, seed, VERTICES).unwrap();
            let (low, high) = garment.rest.bounds();
            let at_chest = high[1] > joint[9][1];
            let below_hips = low[1] < joint[1][1];
            match category {
                Category::Dress => assert!(at_chest && below_hips),
                Category::Top | Category::TShirt | Category::OpenShirt => assert!(at_chest),
                Category::Skirt | Category::Trousers => assert!(!at_chest && below_hips),
            }
            // Cloth far out beside the chest; hems may be as wide, but lower.
            let sleeves = garment
                .rest
                .positions()
                .iter()
                .any(|p| p[1] > 0.5 * (joint[9][1] + joint[16][1]) && p[0] > joint[16][0] + 0.05);
            match category {
                Category::TShirt | Category::OpenShirt => assert!(sleeves),
                Category::Top => assert!(!sleeves),
                _ => {}
            }
            assert_eq!(garment.holding, Garment::needs_holding(&garment.rest, &body));
            if matches!(category, Category::Skirt | Category::Trousers) {
                assert!(garment.holding);
            }
        }
    }
}

#[test]
fn trouser_legs_are_apart_and_hems_are_exact_curves() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    const VERTICES: usize = 500;
    for seed in 0..3 {
        let rest = generator.generate(Category::Trousers, seed, VERTICES).unwrap().rest;
        let topology = clothcombo_physics::Topology::new(&rest);
        assert_eq!(topology.boundary_loops.len(), 3);
        let lowest = rest.bounds().0[1];
        // The two leg openings lie on one level, each wholly on its side.
        let hems: Vec<&Vec<u32>> = topology
            .boundary_loops
            .iter()
            .filter(|curve| curve.iter().all(|v| (rest.positions()[*v as usize][1] - lowest).abs() < 1e-3))
            .collect();
        assert_eq!(hems.len(), 2);
        for hem in hems {
            let left = hem.iter().filter(|v| rest.positions()[**v as usize][0] > 0.0).count();
            assert!(left == 0 || left == hem.len());
        }
    }
}

/// The mannequin of another build on the skeleton of SMPL-X, fingers and face without skin of their own.
fn smplx_shaped() -> Body {
    let mannequin = mannequin();
    let shape: Vec<f64> = (0..mannequin.shape_count).map(|k| if k % 2 == 0 { 1.2 } else { -0.8 }).collect();
    let shaped = mannequin.shaped(&shape).unwrap();
    let mut joints = shaped.joints;
    let mut parents = mannequin.parents.clone();
    for (joint, parent) in (22..25).map(|j| (j, 15)).chain((25..55).map(|j| (j, 20 + (j - 25) / 15))) {
        parents.push(Some(parent));
        joints.push(joints[parent]);
        assert_eq!(joints.len(), joint + 1);
    }
    Body::new(BodyParts {
        name: "smplx".into(),
        faces: mannequin.faces.clone(),
        template: shaped.positions,
        shape_directions: Vec::new(),
        shape_count: 0,
        joint_template: joints,
        joint_shape_directions: Vec::new(),
        pose_directions: None,
        skin_weights: mannequin.skin_weights.clone(),
        parents,
        joint_names: crate::asset::skeleton::joint_names(55),
    })
    .unwrap()
}

#[test]
fn garments_of_every_category_keep_the_guarantees_on_two_bodies() {
    const VERTICES: usize = 500;
    for (body, count) in [(mannequin(), 48), (smplx_shaped(), 24)] {
        let generator = GarmentGenerator::new(&body).unwrap();
        (0..count).into_par_iter().with_max_len(1).for_each(|i| {
            let category = Category::ALL[i % Category::ALL.len()];
            let garment = generator.generate(category, 300 + i as u64, VERTICES).unwrap();
            assert_guarantees(&generator, &garment);
        });
    }
}

#[test]
fn a_given_design_is_followed() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    const VERTICES: usize = 900;
    let make = |design: &GarmentDesign| generator.attempt(design, 3, 0, VERTICES).unwrap();
    let mut skirt = SkirtDesign {
        rise: 0.5,
        length: 1.4,
        ease: 0.01,
        hang: 0.8,
        skirt: FlareDesign { flare: 0.2, pleats: None },
        rim_tilt: 0.0,
        hem_tilt: 0.0,
    };
    let plain = make(&GarmentDesign::Skirt(skirt.clone()));
    let mark = generator.fit.landmarks;
    let hem = mark.crotch + 0.4 * (mark.ankle - mark.crotch);
    assert!((plain.bounds().0[1] - hem).abs() < 2e-3);
    // Pleats swing the radius of the hem around; without them it changes slowly.
    let turns = |rest: &TriMesh| {
        let topology = clothcombo_physics::Topology::new(rest);
        let curve = topology
            .boundary_loops
            .iter()
            .find(|curve| curve.iter().all(|v| rest.positions()[*v as usize][1] < hem + 0.01))
            .unwrap();
        let radii: Vec<f64> = curve
            .iter()
            .map(|v| rest.positions()[*v as usize])
            .map(|p| p[0].hypot(p[2] - generator.fit.column.centre(hem)[0]))
            .collect();
        let rises = |i: usize| radii[(i + 1) % radii.len()] > radii[i];
        (0..radii.len()).filter(|i| rises(*i) != rises((i + 1) % radii.len())).count()
    };
    skirt.skirt.pleats = Some(PleatDesign { count: 10, depth: 0.2, formed: 0.3, phase: 0.0 });
    let pleated = make(&GarmentDesign::Skirt(skirt.clone()));
    assert!(turns(&pleated) >= 16 && turns(&plain) < 16, "{} {}", turns(&pleated), turns(&plain));
    assert!(pleated.area() > 1.03 * plain.area());

    // A cuff is narrower than the same sleeve left open; a placket opens the front below the neckline.
    let upper = |cuff: f64, front: Front| {
        GarmentDesign::Upper(UpperDesign {
            category: Category::TShirt,
            length: 0.6,
            looseness: 0.6,
            hang: 0.6,
            skirt: FlareDesign { flare: 0.0, pleats: None },
            hem_tilt: 0.0,
            neckline: Neckline::Neck {
                width: 0.03,
                depth: 0.02,
                depth_back: 0.0,
                power: 2.0,
                armhole: 0.9,
                armhole_drop: 0.02,
            },
            sleeves: Some(SleeveDesign {
                length: 0.9,
                ease: 0.004,
                hang: 0.8,
                flare: 0.01,
                armhole: 0.0,
                tilt: 0.0,
                cuff,
            }),
            front,
        })
    };
    let end = mark.shoulder[0] + 0.9 * (mark.wrist - mark.shoulder[0]);
    let height_of_end = |rest: &TriMesh| {
        let ends = rest.positions().iter().filter(|p| p[0] > end - 2e-3).map(|p| p[1]);
        let (low, high) = ends.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
        high - low
    };
    let (open, cuffed) = (
        make(&upper(0.0, Front::Closed)),
        make(&upper(1.0, Front::Placket { length: 0.15, half_width: 0.015 })),
    );
    assert!(height_of_end(&cuffed) < height_of_end(&open) - 0.015);
    let in_front = |rest: &TriMesh| {
        let chest = rest.positions().iter().filter(|p| p[2] > mark.neck[2] && p[1] > mark.armpit);
        chest.map(|p| p[0].abs()).fold(f64::MAX, f64::min)
    };
    assert!(in_front(&open) < 0.013 && in_front(&cuffed) > 0.013);
}

#[test]
fn the_same_seed_gives_the_same_garment_for_any_number_of_threads() {
    let body = mannequin();
    let make = || generated(&body, Category::TShirt, 11, 400);
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(one.install(make).rest, three.install(make).rest);
    assert_ne!(make().rest, generated(&body, Category::TShirt, 12, 400).rest);
}

#[test]
fn bad_settings_and_bodies_are_refused_with_a_reason() {
    let body = mannequin();
    let generator = GarmentGenerator::new(&body).unwrap();
    const VERTICES: usize = 3;
    let message = generator.generate(Category::Top, 0, VERTICES).unwrap_err().to_string();
    assert!(message.contains("3 vertices") && message.contains("200"), "{message}");
    // A body lying on its back.
    let mut lying = body.clone();
    let parts = &mut *lying;
    for p in parts.template.iter_mut().chain(&mut parts.joint_template) {
        *p = [p[0], -p[2], p[1]];
    }
    let message = GarmentGenerator::new(&lying).unwrap_err().to_string();
    assert!(message.contains("mannequin") && message.contains("T-pose"), "{message}");
}
