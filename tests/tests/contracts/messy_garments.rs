//! Garments as strangers have them: damaged as exporters and modellers do, each either draped, repairs listed, or
//! refused with a reason that names the file. `scripts/fuzz.sh` runs many more.

use clothcombo_data::asset::{Category, Pose};
use clothcombo_data::fit::FitSettings;
use clothcombo_data::generate::GarmentGenerator;
use clothcombo_tests::{fuzz_cases, tiny_config};
use clothcombo_trainer::dataset::Dataset;
use clothcombo_trainer::inference::{BodyState, Draper, DraperSettings, GivenGarment};
use clothcombo_trainer::run::folder::RunDir;
use clothcombo_trainer::system::device::default_device;
use clothcombo_trainer::training::session::Session;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// A draper with networks that have learned nothing.
fn draper(folder: &Path) -> Draper {
    let config = tiny_config(folder, &[]);
    let dataset = Arc::new(Dataset::load(&config, &|_, _, _| {}).unwrap());
    let run = RunDir::create(&folder.join("run"), &config).unwrap();
    let session = Session::new(run, config, dataset, &default_device()).unwrap();
    Draper::load(Some(&session.save().unwrap()), &DraperSettings::default()).unwrap()
}

struct Mesh {
    positions: Vec<[f64; 3]>,
    polygons: Vec<Vec<u32>>,
}

impl Mesh {
    fn obj(&self) -> String {
        let mut text = String::new();
        for [x, y, z] in &self.positions {
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for polygon in &self.polygons {
            let corners: Vec<String> = polygon.iter().map(|v| (v + 1).to_string()).collect();
            writeln!(text, "f {}", corners.join(" ")).unwrap();
        }
        text
    }

    /// One kind of damage.
    fn damage(&mut self, rng: &mut ChaCha8Rng) {
        let any = |count: usize, rng: &mut ChaCha8Rng| rng.random_range(0..count.max(1));
        let (vertex, polygon) = (any(self.positions.len(), rng), any(self.polygons.len(), rng));
        let Some(corners) = self.polygons.get(polygon).cloned() else { return };
        match rng.random_range(0..16) {
            // Another unit, another axis up, another place.
            0 => {
                let factor = [100.0, 1000.0, 39.37, 10.0, 1e6, 1e-4][rng.random_range(0..6)];
                self.positions.iter_mut().flatten().for_each(|x| *x *= factor);
            }
            1 => self.positions.iter_mut().for_each(|p| *p = [p[0], -p[2], p[1]]),
            2 => self.positions.iter_mut().for_each(|p| p[1] += 0.7),
            // Every triangle with vertices of its own.
            3 => {
                let loose: Vec<[f64; 3]> =
                    self.polygons.iter().flatten().map(|v| self.positions[*v as usize]).collect();
                self.polygons.iter_mut().flatten().zip(0..).for_each(|(v, own)| *v = own);
                self.positions = loose;
            }
            // Turned faces, missing ones, a fan on an edge, a doubled face, needles, quads, a polygon of one corner thrice.
            4 => self.polygons[polygon].reverse(),
            5 => self.polygons.iter_mut().step_by(3).for_each(|p| p.reverse()),
            6 => self.polygons.truncate(self.polygons.len() * rng.random_range(1..10) / 10),
            7 => {
                self.positions.push([0.3, 1.0, 0.3]);
                self.polygons.push(vec![corners[0], corners[1], self.positions.len() as u32 - 1]);
            }
            8 => self.polygons.push(corners),
            9 => self.positions[vertex] = self.positions[corners[0] as usize],
            10 => {
                let last = self.polygons.pop().unwrap_or_default();
                let count = self.polygons.len().max(1);
                self.polygons[polygon % count].extend(last.first());
            }
            11 => self.polygons.push(vec![corners[0]; 3]),
            // Stray vertices, a far one, one that is no number.
            12 => self.positions.extend([[0.0; 3]; 7]),
            13 => self.positions[vertex][1] = [1e3, -1e9, 1e300][rng.random_range(0..3)],
            14 => self.positions[vertex][0] = [f64::NAN, f64::INFINITY][rng.random_range(0..2)],
            // Another piece: a button.
            _ => {
                let first = self.positions.len() as u32;
                self.positions.extend([[0.0, 1.2, 0.2], [0.01, 1.2, 0.2], [0.0, 1.21, 0.2]]);
                self.polygons.push(vec![first, first + 1, first + 2]);
            }
        }
    }
}

#[test]
fn messy_garments_are_draped_or_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let draper = draper(folder.path());
    let generator = GarmentGenerator::new(draper.body()).unwrap();
    let (cases, seed) = fuzz_cases(60);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut draped, mut fitted) = (0, 0);
    for case in 0..cases {
        let category = Category::ALL[case % Category::ALL.len()];
        let rest = generator.generate(category, (case / 6) as u64, 250).unwrap().rest;
        let polygons = rest.faces().iter().map(|f| f.to_vec()).collect();
        let mut mesh = Mesh { positions: rest.positions().to_vec(), polygons };
        for _ in 0..rng.random_range(1..4) {
            mesh.damage(&mut rng);
        }
        let path = folder.path().join("messy.obj");
        std::fs::write(&path, mesh.obj()).unwrap();
        let result =
            GivenGarment::read(&path, draper.body(), None, &FitSettings::default()).and_then(|source| {
                let is_fitted = source.fit.is_some();
                let given = mesh.positions.len();
                let outfit = draper.outfit(vec![source.clone()])?;
                let drape = draper.drape(&outfit, &BodyState::new(vec![1.0], Pose::t_pose(22)))?;
                let positions = source.in_given_order(&drape.garments[0].positions);
                assert_eq!(positions.len(), given, "case {case}: a vertex of the file was lost");
                assert!(positions.as_flattened().iter().all(|x| x.is_finite()), "case {case}");
                Ok(is_fitted)
            });
        match result {
            Ok(is_fitted) => {
                draped += 1;
                fitted += usize::from(is_fitted);
            }
            Err(error) => {
                let reason = format!("{:?}", error).replace(['\n', '│'], "");
                assert!(reason.contains("messy"), "case {case}: {reason}");
            }
        }
    }
    println!("{cases} messy garments: {draped} draped ({fitted} of them fitted), {} refused", cases - draped);
    assert!(draped * 5 > cases && draped < cases && fitted > 0, "{draped} of {cases}, {fitted} fitted");
}
