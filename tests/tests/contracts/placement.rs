//! Garments in any unit, with any axis up, turned, shifted and in A-pose come back to where they were, or are doubted.
//!
//! `CLOTHCOMBO_FUZZ_CASES=60 CLOTHCOMBO_FUZZ_SEED=2 cargo test --release --workspace --test contracts placement:: -- --nocapture`
//! tries more.

use clothcombo_data::asset::{Binding, BindingSettings, Body, BodyFileSettings, Category, Garment, Pose};
use clothcombo_data::fit::{FileOrigin, FitSettings, Placement, Unit, UpAxis, fit};
use clothcombo_data::format::PolygonMesh;
use clothcombo_data::generate::{GarmentGenerator, mannequin};
use clothcombo_physics::vec3::{add, norm, scale, sub};
use clothcombo_tests::fuzz_cases;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

/// A garment is back if half of its vertices, and all but a twentieth, are nearer than this to where they were (m).
const BACK: [f64; 2] = [0.02, 0.05];
/// Largest shift of an origin (m), and range of arm angles (degrees).
const SHIFT: f64 = 0.4;
const ARMS: [f64; 2] = [20.0, 70.0];

/// Positions (m) with both arms lowered by linear blend skinning, as draping does it.
fn lowered(garment: &Garment, body: &Body, degrees: f64) -> Vec<[f64; 3]> {
    let mut pose = Pose::t_pose(body.joint_count());
    for (name, sign) in [("left_shoulder", -1.0), ("right_shoulder", 1.0)] {
        let joint = body.joint_names.iter().position(|n| n == name).unwrap();
        pose.rotations[joint] = [0.0, 0.0, sign * degrees.to_radians()];
    }
    let bones = body.bone_transforms(&body.joint_template, &pose);
    let binding = Binding::new(garment, body, &BindingSettings::default());
    let weights = binding.skin_weights.chunks_exact(body.joint_count());
    let skinned = |(p, weights): (&[f64; 3], &[f32])| {
        bones.iter().zip(weights).fold([0.0; 3], |sum, (bone, weight)| {
            let moved = bone.map(|[x, y, z, t]| x * p[0] + y * p[1] + z * p[2] + t);
            add(sum, scale(moved, f64::from(*weight)))
        })
    };
    garment.rest.positions().iter().zip(weights).map(skinned).collect()
}

/// A random convention of a file, as the placement that undoes it.
fn convention(rng: &mut ChaCha8Rng) -> Placement {
    let direction: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
    let shift = rng.random_range(0.0..SHIFT) / norm(direction);
    Placement {
        unit: Unit::ALL[rng.random_range(0..Unit::ALL.len())],
        up: UpAxis::USUAL[rng.random_range(0..UpAxis::USUAL.len())],
        turn_degrees: 90.0 * f64::from(rng.random_range(0..4)),
        origin: FileOrigin::Elsewhere,
        translation: scale(direction, shift),
        leg_angle_degrees: 0.0,
        arm_angle_degrees: if rng.random::<bool>() { rng.random_range(ARMS[0]..ARMS[1]) } else { 0.0 },
    }
}

/// The file of a garment under that convention.
fn file(garment: &Garment, body: &Body, placement: &Placement) -> PolygonMesh {
    let turn = placement.turn();
    let in_file = |p: [f64; 3]| {
        let turned = scale(sub(p, placement.translation), 1.0 / placement.unit.metres());
        std::array::from_fn(|column| (0..3).map(|row| turn[row][column] * turned[row]).sum())
    };
    let posed = lowered(garment, body, placement.arm_angle_degrees);
    let mut mesh = PolygonMesh::with_positions(posed.into_iter().map(in_file).collect());
    garment.rest.faces().iter().for_each(|f| mesh.push(f));
    mesh
}

#[test]
fn garments_come_back_from_any_convention_or_are_doubted() {
    let (cases, seed) = fuzz_cases(24);
    let body = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default/body.npz");
    let body = Body::load(&body, &BodyFileSettings::default()).unwrap();
    let generator = GarmentGenerator::new(&body).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut back, mut doubted, mut silent) = (0, 0, Vec::new());
    for case in 0..cases {
        let category = Category::ALL[case % Category::ALL.len()];
        let design = 1000 * seed + case as u64;
        let garment = generator.generate(category, design, 1200).unwrap();
        let wanted = convention(&mut rng);
        let Ok(fitted) = fit(&file(&garment, &body, &wanted), &body, &FitSettings::default()) else {
            doubted += 1;
            continue;
        };
        let rest = fitted.garment.rest.positions();
        let became = fitted.vertex_of_file.iter().zip(garment.rest.positions());
        let mut off: Vec<f64> =
            became.filter_map(|(v, p)| Some(norm(sub(rest[(*v)? as usize], *p)))).collect();
        off.sort_by(f64::total_cmp);
        let off = [off.len() / 2, off.len() * 19 / 20].map(|at| off[at]);
        let found = fitted.report.placement;
        let text = format!("{}: {off:.3?} m off; {wanted:?} read as {found:?}", garment.name);
        match (off[0] < BACK[0] && off[1] < BACK[1], fitted.report.doubts.is_empty()) {
            (true, _) => back += 1,
            (false, false) => doubted += 1,
            (false, true) => silent.push(text),
        }
    }
    println!(
        "{cases} garments of seed {seed}: {back} back within {:.0} mm, {doubted} doubted or refused, {} not",
        1e3 * BACK[0],
        silent.len()
    );
    println!("{}", silent.join("\n"));
    assert!(silent.is_empty(), "silently elsewhere:\n{}", silent.join("\n"));
    assert!(10 * back >= 9 * cases, "{back} of {cases}");
}

#[test]
fn garments_of_another_body_keep_limbs_front_and_category_or_say_so() {
    let body = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default/body.npz");
    let (body, made_on) = (Body::load(&body, &BodyFileSettings::default()).unwrap(), mannequin());
    let generator = GarmentGenerator::new(&made_on).unwrap();
    for (category, design) in [
        (Category::Dress, 5),
        (Category::Top, 12),
        (Category::Top, 18),
        (Category::Skirt, 15),
        (Category::Skirt, 21),
        (Category::Trousers, 16),
    ] {
        let garment = generator.generate(category, design, 900).unwrap();
        let mesh = file(&garment, &made_on, &Placement::AS_GIVEN);
        let report = fit(&mesh, &body, &FitSettings::default()).unwrap().report;
        let Placement { turn_degrees, arm_angle_degrees, leg_angle_degrees, .. } = report.placement;
        let is_kept = (turn_degrees, arm_angle_degrees, leg_angle_degrees) == (0.0, 0.0, 0.0)
            && report.category == garment.category;
        let is_told = |word: &str| report.doubts.iter().any(|doubt| doubt.contains(word));
        assert!(
            is_kept || is_told("turned by 180°") || is_told("rest pose") || is_told("--category"),
            "{report}"
        );
        assert!(turn_degrees == 0.0 || is_told("--turn"), "{report}");
    }
}
