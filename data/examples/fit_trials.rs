//! Garments at random scales, axes, turns, places and arm poses, and where `fit` puts them.
//!
//! cargo run --release -p clothcombo-data --example fit_trials -- BODY.npz|mannequin COUNT SEED [FOLDER of OBJ garments]

use clothcombo_data::asset::{Binding, BindingSettings, Body, Category, Garment, Pose};
use clothcombo_data::fit::{FitSettings, Unit, UpAxis, fit};
use clothcombo_data::format::{PolygonMesh, load_mesh};
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings, mannequin};
use clothcombo_physics::vec3::{add, norm, scale, sub};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let body = match args[1].as_str() {
        "mannequin" => mannequin(),
        path => Body::load(path.as_ref(), &Default::default()).unwrap(),
    };
    let (count, seed): (usize, u64) = (args[2].parse().unwrap(), args[3].parse().unwrap());
    let generator = GarmentGenerator::new(&body).unwrap();
    let mut garments: Vec<Garment> = Vec::new();
    match args.get(4) {
        Some(folder) => {
            let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
            files.retain(|f| f.extension().is_some_and(|e| e == "obj"));
            files.sort();
            for f in files {
                let mesh = load_mesh(&f).unwrap().to_tri_mesh(&f).unwrap();
                let name = f.file_stem().unwrap().to_string_lossy().into_owned();
                garments.push(Garment { name, ..Garment::new(Category::guess(&mesh, &body), mesh) });
            }
        }
        None => {
            let settings = GarmentSettings { target_vertices: 1200, ..GarmentSettings::default() };
            for i in 0..count {
                let category = Category::ALL[i % 6];
                if let Ok(g) = generator.generate(category, seed * 1000 + i as u64, &settings) {
                    garments.push(g);
                }
            }
        }
    }
    let only: Option<usize> = std::env::var("ONLY").ok().map(|s| s.parse().unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut good, mut refused, mut wrong, mut warned, mut slowest) = (0, 0, 0, 0, 0.0f64);
    for (i, g) in garments.iter().enumerate() {
        let unit = Unit::ALL[rng.random_range(0..6)];
        let up = UpAxis::ALL[rng.random_range(0..3)];
        let turn = [0.0, 90.0, 180.0, 270.0][rng.random_range(0..4)];
        let d: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let shift = scale(d, rng.random_range(0.0..0.4) / norm(d));
        let arms = if rng.random::<f64>() < 0.5 { 0.0 } else { rng.random_range(20.0..70.0) };
        if only.is_some_and(|o| o != i) {
            continue;
        }
        let pinned = std::env::var("GIVEN").is_ok();
        let (unit, up, turn, shift, arms) =
            if pinned { (Unit::M, UpAxis::Y, 0.0, [0.0; 3], 0.0) } else { (unit, up, turn, shift, arms) };
        let posed = lowered(g, &body, arms);
        let placement = clothcombo_data::fit::Placement {
            unit,
            up,
            turn_degrees: turn,
            translation: shift,
            arm_angle_degrees: arms,
            origin: clothcombo_data::fit::Origin::Elsewhere,
        };
        let m = placement.turn();
        let back = |p: [f64; 3]| -> [f64; 3] {
            let q = scale(sub(p, shift), 1.0 / unit.metres());
            std::array::from_fn(|c| (0..3).map(|r| m[r][c] * q[r]).sum())
        };
        let mut mesh = PolygonMesh::with_positions(posed.iter().map(|p| back(*p)).collect());
        g.rest.faces().iter().for_each(|f| mesh.push(f));
        let clock = Instant::now();
        let result = fit(&mesh, &body, &FitSettings::default());
        let seconds = clock.elapsed().as_secs_f64();
        slowest = slowest.max(seconds);
        let truth = format!(
            "{unit} {up} {turn} arms {arms:.0} shift {:.3} {:.3} {:.3}",
            shift[0], shift[1], shift[2]
        );
        match result {
            Err(e) => {
                refused += 1;
                println!("{i:3} {:24} REFUSED {e} | {truth}", g.name);
            }
            Ok(f) => {
                let mut d: Vec<f64> = f
                    .vertex_of_file
                    .iter()
                    .zip(g.rest.positions())
                    .filter_map(|(v, p)| Some(norm(sub(f.garment.rest.positions()[(*v)? as usize], *p))))
                    .collect();
                d.sort_by(f64::total_cmp);
                let (median, p95) = (d[d.len() / 2], d[d.len() * 95 / 100]);
                let ok = median < 0.02;
                if !f.report.doubts.is_empty() {
                    warned += 1;
                    println!("    {}", f.report.doubts.join(" | "));
                }
                if ok {
                    good += 1
                } else {
                    wrong += 1
                }
                let p = f.report.placement;
                println!(
                    "{i:3} {:24} dy {:5.1} dz {:5.1} {} {:5.1} mm p95 {:5.1} {:4.2} s | {truth} | found {} {} {} {:?} arms {:.0} {:.3?}",
                    g.name,
                    1e3 * (p.translation[1] - shift[1]),
                    1e3 * (p.translation[2] - shift[2]),
                    if ok {
                        "ok   "
                    } else if f.report.doubts.is_empty() {
                        "WRONG"
                    } else {
                        "warned"
                    },
                    1e3 * median,
                    1e3 * p95,
                    seconds,
                    p.unit,
                    p.up,
                    p.turn_degrees,
                    p.origin,
                    p.arm_angle_degrees,
                    p.translation
                );
            }
        }
    }
    println!("good {good} refused {refused} wrong {wrong} warned {warned} slowest {slowest:.2} s");
}

fn lowered(garment: &Garment, body: &Body, degrees: f64) -> Vec<[f64; 3]> {
    let mut pose = Pose::t_pose(body.joint_count());
    for (name, sign) in [("left_shoulder", -1.0), ("right_shoulder", 1.0)] {
        let j = body.joint_names.iter().position(|n| n == name).unwrap();
        pose.rotations[j] = [0.0, 0.0, sign * degrees.to_radians()];
    }
    let bones = body.bone_transforms(&body.joint_template, &pose);
    let binding = Binding::new(garment, body, &BindingSettings::default());
    (garment.rest.positions().iter().zip(binding.skin_weights.chunks_exact(body.joint_count())))
        .map(|(p, w)| {
            bones.iter().zip(w).fold([0.0; 3], |sum, (b, w)| {
                let q: [f64; 3] =
                    std::array::from_fn(|r| b[r][0] * p[0] + b[r][1] * p[1] + b[r][2] * p[2] + b[r][3]);
                add(sum, scale(q, f64::from(*w)))
            })
        })
        .collect()
}
