//! A bank of training poses, made once: recorded ones, recombined limbs, and uniform ones within the joint limits.

use super::draw::PoseDraw;
use crate::config::{Config, PoseBankConfig};
use crate::dataset::body::with_body;
use clothcombo_data::asset::Pose;
use clothcombo_data::cache::{ArrayCache, Key, KeyBuilder, get_poses, put_poses};
use clothcombo_data::check::is_possible;
use clothcombo_data::generate::{LimbDensity, uniform_pose};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Called with the poses made and all poses.
pub type BankProgress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Poses drawn before the least self-intersecting one is taken as it is.
const BANK_ATTEMPTS: usize = 64;

/// The bank of a library: how it is made, and what it holds once it is.
pub(super) struct Bank {
    config: PoseBankConfig,
    seed: u64,
    /// Folder and largest size (bytes) of the cache.
    cache: Option<(PathBuf, u64)>,
    poses: OnceLock<Vec<Pose>>,
}

/// Where a pose of the bank comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PoseOrigin {
    Recorded,
    Recombined,
    Uniform,
}

impl Bank {
    /// The bank that `config` asks for.
    pub fn new(config: &Config) -> Option<Self> {
        let cache = &config.data.cache;
        Some(Self {
            config: config.data.poses.bank.clone()?,
            seed: config.seed,
            cache: cache.folder.clone().map(|folder| (folder, config.data.cache_limit())),
            poses: OnceLock::new(),
        })
    }

    fn origin(&self, index: usize) -> PoseOrigin {
        let PoseBankConfig { size, recorded, recombined, .. } = self.config;
        let share = (index as f64 + 0.5) / size as f64;
        match share {
            share if share < recorded => PoseOrigin::Recorded,
            share if share < recorded + recombined => PoseOrigin::Recombined,
            _ => PoseOrigin::Uniform,
        }
    }

    /// The poses: from the cache, or made from `draw` and stored there.
    pub fn poses(&self, draw: &PoseDraw, progress: BankProgress<'_>) -> &[Pose] {
        self.poses.get_or_init(|| {
            let key = self.key(draw);
            let cache = self.cache.as_ref().and_then(|(folder, limit)| {
                ArrayCache::open(folder, *limit)
                    .map_err(|e| tracing::warn!("{e}; going on without a cache"))
                    .ok()
            });
            let stored = cache.as_ref().and_then(|cache| get_poses(cache, key));
            stored.filter(|poses| poses.len() == self.config.size).unwrap_or_else(|| {
                let poses = self.make(draw, progress);
                if let Some(Err(e)) = cache.as_ref().map(|cache| put_poses(cache, key, &poses)) {
                    tracing::warn!("{e}; the poses are made again at the next start");
                }
                poses
            })
        })
    }

    /// Everything the poses are made from.
    fn key(&self, draw: &PoseDraw) -> Key {
        let PoseBankConfig { size, recorded, recombined, uniform } = self.config;
        let limit = draw.filter.as_ref().map_or(f64::INFINITY, |filter| filter.limit);
        // The number changes with how a bank is made.
        let mut key = KeyBuilder::new("pose bank 1")
            .number(self.seed)
            .number(size as u64)
            .array(&[recorded, recombined, uniform, limit])
            .number(u64::from(draw.augmentation.is_some()))
            .number(u64::from(draw.remove_heading));
        if let Some(filter) = &draw.filter {
            key = with_body(key, &filter.body);
        }
        for (pose, weight) in draw.weighted_frames() {
            key = key.array(&[weight]).array(pose.rotations.as_flattened());
        }
        key.finish()
    }

    /// Makes all poses; each has a random stream of its own.
    fn make(&self, draw: &PoseDraw, progress: BankProgress<'_>) -> Vec<Pose> {
        let start = Instant::now();
        // What no joint does is a fault of the recording, and no limb to recombine.
        let frames = draw.weighted_frames().filter(|(pose, _)| is_possible(pose));
        let density = LimbDensity::new(frames);
        let (done, drawn) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let make = |index: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
            rng.set_stream(index as u64);
            let mut one = || {
                drawn.fetch_add(1, Ordering::Relaxed);
                match (self.origin(index), &density) {
                    (PoseOrigin::Uniform, _) => uniform_pose(&mut rng),
                    (PoseOrigin::Recombined, Some(density)) => draw.facing_forward(&density.sample(&mut rng)),
                    _ => draw.unfiltered(1.0, &mut rng),
                }
            };
            let pose = draw.least_intersecting(BANK_ATTEMPTS, is_possible, &mut one);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, self.config.size);
            pose
        };
        let poses: Vec<Pose> = (0..self.config.size).into_par_iter().map(make).collect();
        tracing::info!(
            "pose bank: {} poses of {} drawn in {:.0} s",
            poses.len(),
            drawn.into_inner(),
            start.elapsed().as_secs_f64()
        );
        poses
    }
}

#[cfg(test)]
mod tests {
    use super::super::PoseLibrary;
    use super::*;
    use crate::config::parse;
    use crate::dataset::HeldOut;
    use clothcombo_data::asset::{BODY_JOINT_COUNT, Motion, Provenance};
    use clothcombo_data::generate::{PoseSampler, SelfContact, mannequin};
    use std::path::Path;
    use std::sync::Arc;

    /// A library over a minute of sampled poses, with these settings of the bank.
    fn library(folder: &Path, bank: &str, seed: u64) -> PoseLibrary {
        let motions = folder.join("motions");
        std::fs::create_dir_all(&motions).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let poses = (0..600).map(|_| PoseSampler.sample(&mut rng)).collect();
        let (name, source) = ("walk".to_owned(), Provenance::default());
        Motion { name, frame_rate: 10.0, poses, source }.save(&motions.join("walk.npz")).unwrap();
        let text = format!(
            "seed = {seed}\n[data]\ncache = {{ folder = {:?} }}\n[[data.garments]]\ngenerate = {{ count = 2 }}\n\
             [data.poses]\nmotions = {motions:?}\nbank = {bank}\n[[stages]]\nname = \"single\"\ntrains = \"single\"\nsteps = 1\n",
            folder.join("cache")
        );
        let config = parse(&text, Path::new("bank.toml"), &[]).unwrap();
        PoseLibrary::new(&config.data.poses, &Arc::new(mannequin())).unwrap().with_bank(&config)
    }

    const SMALL: &str = "{ size = 20, recorded = 0.5, recombined = 0.3, uniform = 0.2 }";

    fn poses(library: &PoseLibrary) -> &[Pose] {
        library.bank.as_ref().unwrap().poses(&library.draw, &|_, _| ())
    }

    #[test]
    fn a_bank_is_made_once_and_its_poses_are_possible_and_clear_of_themselves() {
        let folder = tempfile::tempdir().unwrap();
        let first = library(folder.path(), SMALL, 1);
        let made = AtomicUsize::new(0);
        first.make_bank(&|_, _| {
            made.fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!((made.into_inner(), poses(&first).len()), (20, 20));
        let (body, contact) = (mannequin(), SelfContact::new(&mannequin()));
        for pose in poses(&first) {
            assert!(is_possible(pose) && contact.of_pose(&body, pose).unwrap() <= 0.1);
            assert!(pose.without_heading().1.abs() < 1e-9);
        }
        let bank = first.bank.as_ref().unwrap();
        let count = |origin| (0..20).filter(|i| bank.origin(*i) == origin).count();
        assert_eq!(
            [PoseOrigin::Recorded, PoseOrigin::Recombined, PoseOrigin::Uniform].map(count),
            [10, 6, 4]
        );

        // Read again, to the bit; another seed or mixture makes another.
        let again = library(folder.path(), SMALL, 1);
        again.make_bank(&|_, _| panic!("made again"));
        assert_eq!(poses(&again), poses(&first));
        let key = |library: &PoseLibrary| library.bank.as_ref().unwrap().key(&library.draw);
        let shares = SMALL.replace("recorded = 0.5, recombined = 0.3", "recorded = 0.4, recombined = 0.4");
        for other in [library(folder.path(), SMALL, 2), library(folder.path(), &shares, 1)] {
            assert_ne!(key(&other), key(&first));
        }
    }

    #[test]
    fn training_draws_from_the_bank_and_scales_it_and_nothing_else_does() {
        let folder = tempfile::tempdir().unwrap();
        let library = library(folder.path(), SMALL, 1);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for scale in [1.0, 0.25] {
            let drawn = library.sample_training(scale, &mut rng);
            assert!(poses(&library).iter().any(|pose| pose.scaled(scale) == drawn));
        }
        let held_out = library.sample_held_out(HeldOut::Windows, &mut rng);
        assert!(poses(&library).iter().all(|pose| *pose != held_out));
        assert_eq!(poses(&library)[0].rotations.len(), BODY_JOINT_COUNT);
    }
}
