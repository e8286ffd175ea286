//! How many sampled, recorded and augmented poses make the body intersect itself, and what the test costs.
//!
//! ```text
//! pose_self_intersections [BODY.npz [MOTIONS [COUNT = 300]]]
//! ```
//! The columns are the share of poses in which far-apart parts of the body intersect, the shares above 0.05, 0.1, 0.2
//! and 0.4 m of intersection curves (`data.poses.max_self_intersection` is such a limit) and the mean time per pose
//! (ms). Without a body it takes the mannequin. Without a folder of motions it measures sampled poses only.

use clothcombo_data::asset::{Body, BodyFileSettings, Pose};
use clothcombo_data::folders::load_motion_folder;
use clothcombo_data::generate::{PoseAugmentation, PoseSampler, SelfContact, mannequin};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let body = match arguments.first() {
        Some(file) => Body::load(Path::new(file), &BodyFileSettings { shape_components: usize::MAX })?,
        None => mannequin(),
    };
    let count: usize = arguments.get(2).map_or(Ok(300), |n| n.parse())?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let sampler = PoseSampler;
    let sampled = (0..count).map(|_| sampler.sample(&mut rng)).collect();
    let mut groups: Vec<(&str, Vec<Pose>)> = vec![("sampled", sampled)];
    if let Some(folder) = arguments.get(1) {
        let frames: Vec<Pose> =
            load_motion_folder(Path::new(folder))?.into_iter().flat_map(|m| m.poses).collect();
        let any = |rng: &mut ChaCha8Rng| frames[rng.random_range(0..frames.len())].clone();
        groups.push(("recorded", (0..count).map(|_| any(&mut rng)).collect()));
        let augmentation = PoseAugmentation::default();
        let mut augmented = || {
            let (pose, other) = (any(&mut rng), any(&mut rng));
            augmentation.apply(&pose, &other, &mut rng)
        };
        groups.push(("augmented", (0..count).map(|_| augmented()).collect()));
    }
    let contact = SelfContact::new(&body);
    println!("poses      count  touching   >0.05    >0.1    >0.2    >0.4      ms");
    for (name, poses) in groups {
        let start = Instant::now();
        let lengths =
            poses.iter().map(|pose| contact.of_pose(&body, pose)).collect::<Result<Vec<f64>, _>>()?;
        let count = poses.len().max(1) as f64;
        let milliseconds = start.elapsed().as_secs_f64() * 1e3 / count;
        let share = |limit: f64| 100.0 * lengths.iter().filter(|l| **l > limit).count() as f64 / count;
        let [touching, a, b, c, d] = [0.0, 0.05, 0.1, 0.2, 0.4].map(share);
        println!(
            "{name:<10} {:>5} {touching:>7.1} % {a:>5.1} % {b:>5.1} % {c:>5.1} % {d:>5.1} % {milliseconds:>7.2}",
            poses.len()
        );
    }
    Ok(())
}
