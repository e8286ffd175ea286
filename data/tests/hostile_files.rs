//! Ten thousand damaged files per format of bodies, motions and simulations, alone and through the importers that read them:
//! no panic, no hang, no memory beyond the file's worth, always a reason.

mod fixture;
mod hostile;

use clothcombo_data::asset::{BindingSettings, Body, BodyFileSettings, Motion};
use clothcombo_data::format::{MatFile, NpzFile};
use clothcombo_data::import::{
    AmassSettings, Cloth3dBodies, Cloth3dSettings, RetargetSettings, Summary, Thinning, acclaim, bvh,
    import_amass, import_cloth3d, import_deepmimic, import_smpl_family,
};
use fixture::{fixture, no_progress};
use hostile::{damaged, survive};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::fs;
use std::io::{Cursor, Read, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

const MEGABYTE: usize = 1 << 20;

fn bytes_of(name: &str) -> Vec<u8> {
    fs::read(fixture(name)).unwrap()
}

fn reason<T>(result: Result<T, impl std::fmt::Display>) -> Result<(), String> {
    result.map(drop).map_err(|e| e.to_string())
}

/// What an importer of one file did with it: taken, or why not.
fn outcome(result: Result<Summary, impl std::fmt::Display>) -> Result<(), String> {
    let summary = result.map_err(|e| e.to_string())?;
    match summary.skipped.first() {
        Some((file, why)) => Err(format!("{file}: {why}")),
        None => Ok(()),
    }
}

/// Damages an archive, or, behind its checksums, one of its arrays.
fn damaged_npz(whole: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    if rng.random_range(0..3) == 0 {
        return damaged(whole, rng);
    }
    let mut archive = ZipArchive::new(Cursor::new(whole)).unwrap();
    let victim = rng.random_range(0..archive.len());
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for i in 0..archive.len() {
        let mut member = archive.by_index(i).unwrap();
        let mut bytes = Vec::new();
        member.read_to_end(&mut bytes).unwrap();
        if i == victim {
            // Half of them in the header, where every byte counts.
            let header = bytes.len().min(128);
            bytes = match rng.random_range(0..2) {
                0 => [damaged(&bytes[..header], rng), bytes[header..].to_vec()].concat(),
                _ => damaged(&bytes, rng),
            };
        }
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        writer.start_file(member.name().unwrap(), stored).unwrap();
        writer.write_all(&bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A folder for one file that is written anew in every round.
struct Slot {
    folder: TempDir,
    path: PathBuf,
}

impl Slot {
    fn new(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        Self { folder, path }
    }

    fn with(&self, bytes: &[u8]) -> &Path {
        fs::write(&self.path, bytes).unwrap();
        &self.path
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }
}

#[test]
fn archives_of_arrays() {
    let slot = Slot::new("arrays.npz");
    let seeds = ["expected_amass.npz", "amass/CMU/02/jump_poses.npz", "amass/CMU/01/shape.npz"].map(bytes_of);
    survive("arrays.npz", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged_npz, |bytes| {
        let mut file = NpzFile::open(slot.with(bytes)).map_err(|e| e.to_string())?;
        for key in file.keys() {
            if file.numbers(&key, "").is_err() {
                reason(file.strings(&key, ""))?;
            }
        }
        Ok(())
    });
}

#[test]
fn bodies_and_motions() {
    let slot = Slot::new("body.npz");
    let seeds = [bytes_of("cloth3d_bodies/body_neutral.npz")];
    survive("body.npz", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged_npz, |bytes| {
        reason(Body::load(slot.with(bytes), &BodyFileSettings::default()))
    });
    let slot = Slot::new("motion.npz");
    let made = Slot::new("x.npz");
    let body = Body::load(&fixture("cloth3d_bodies/body_neutral.npz"), &BodyFileSettings::default()).unwrap();
    let text = [fixture("deepmimic/humanoid3d_random.txt")];
    import_deepmimic(&text, &body, &made.out(), &RetargetSettings::default(), &mut no_progress()).unwrap();
    let seeds = [fs::read(made.out().join("humanoid3d_random.npz")).unwrap()];
    survive("motion.npz", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged_npz, |bytes| {
        reason(Motion::load(slot.with(bytes)))
    });
}

#[test]
fn smpl_bodies() {
    let slot = Slot::new("SMPL.npz");
    let seeds = [bytes_of("smplh_tiny.npz"), bytes_of("smplx_tiny.npz")];
    survive("SMPL.npz", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged_npz, |bytes| {
        let settings = BodyFileSettings::default();
        // What it skips are keys that no draped body needs.
        reason(import_smpl_family(slot.with(bytes), &slot.out(), &settings, &mut no_progress()))
    });
}

#[test]
fn motions_of_others() {
    const WALK: &[u8] = include_bytes!("hostile/walk.bvh");
    survive("walk.bvh", &[WALK.to_vec()], 0.2..1.0, 16 * MEGABYTE, damaged, |bytes| {
        // As the importer reads it: any bytes.
        reason(bvh::parse(&String::from_utf8_lossy(bytes), Path::new("walk.bvh")))
    });
    let body = Body::load(&fixture("cloth3d_bodies/body_neutral.npz"), &BodyFileSettings::default()).unwrap();
    for name in ["07.asf", "07_01.amc"] {
        let slot = Slot::new(name);
        let [skeleton, motion] = ["07.asf", "07_01.amc"].map(|file| fixture("acclaim/07").join(file));
        survive(
            name,
            &[bytes_of(&format!("acclaim/07/{name}"))],
            0.2..1.0,
            16 * MEGABYTE,
            damaged,
            |bytes| {
                let file = slot.with(bytes);
                match name.ends_with("asf") {
                    true => reason(acclaim::load(file, &motion, 120.0)),
                    false => reason(acclaim::load(&skeleton, file, 120.0)),
                }
            },
        );
    }
    let slot = Slot::new("spin.txt");
    let seeds = [bytes_of("deepmimic/humanoid3d_random.txt")];
    survive("spin.txt", &seeds, 0.2..1.0, 16 * MEGABYTE, damaged, |bytes| {
        let files = [slot.with(bytes).to_owned()];
        let settings = RetargetSettings::default();
        outcome(import_deepmimic(&files, &body, &slot.out(), &settings, &mut no_progress()))
    });
    let slot = Slot::new("jump_poses.npz");
    let seeds = [bytes_of("amass/CMU/02/jump_poses.npz")];
    survive("jump_poses.npz", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged_npz, |bytes| {
        let files = [slot.with(bytes).to_owned()];
        outcome(import_amass(&files, &slot.out(), &AmassSettings::default(), &mut no_progress()))
    });
}

#[test]
fn matrices() {
    let seeds = ["mat/kinds.mat", "mat/kinds_compressed.mat", "cloth3d/00001/info.mat"].map(bytes_of);
    survive("info.mat", &seeds, 0.2..1.0, 64 * MEGABYTE, damaged, |bytes| {
        reason(MatFile::parse(bytes, Path::new("info.mat")))
    });
}

#[test]
fn simulated_samples() {
    let body = Body::load(&fixture("cloth3d_bodies/body_neutral.npz"), &BodyFileSettings::default()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let sample = folder.path().join("00001");
    fs::create_dir(&sample).unwrap();
    let names = ["Top.obj", "Trousers.obj", "info.mat"];
    let whole = names.map(|name| bytes_of(&format!("cloth3d/00001/{name}")));
    let settings = Cloth3dSettings {
        binding: BindingSettings { smooth: false, ..BindingSettings::default() },
        thinning: Thinning { frame_rate: 30.0, static_threshold: 0.0 },
        ..Cloth3dSettings::default()
    };
    // A sample travels as one blob: the number of the damaged file, then its bytes.
    let seeds: Vec<Vec<u8>> =
        (0u8..).zip(&whole).map(|(i, bytes)| [&[i], bytes.as_slice()].concat()).collect();
    let damage = |blob: &[u8], rng: &mut ChaCha8Rng| [&blob[..1], &damaged(&blob[1..], rng)].concat();
    survive("00001", &seeds, 0.2..1.0, 64 * MEGABYTE, damage, |blob| {
        for (i, name) in names.iter().enumerate() {
            let bytes = if i == usize::from(blob[0]) { &blob[1..] } else { &whole[i] };
            fs::write(sample.join(name), bytes).unwrap();
        }
        let bodies = Cloth3dBodies { target: &body, female: Some(&body), male: Some(&body) };
        let out = folder.path().join("out");
        outcome(import_cloth3d(std::slice::from_ref(&sample), &bodies, &out, &settings, &mut no_progress()))
    });
}
