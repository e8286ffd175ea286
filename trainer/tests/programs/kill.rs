//! `kill -9` at any moment, then `--resume`: the same networks as without it, bit for bit.
//!
//! `scripts/kill_test.sh` does the same twenty times with one and with two threads.

use crate::common::{TINY, resume, start};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;
use std::time::{Duration, Instant};

fn final_model(run: &Path) -> Vec<u8> {
    std::fs::read(run.join("checkpoints/step-00000060/model.safetensors")).unwrap()
}

#[test]
fn killed_runs_end_with_the_same_networks() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("tiny.toml");
    std::fs::write(&config, TINY).unwrap();
    let whole = folder.path().join("whole");
    let began = Instant::now();
    assert!(start(&config, &whole, 2).status().unwrap().success());
    let duration = began.elapsed();
    let expected = final_model(&whole);

    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for threads in [1, 2] {
        let run = folder.path().join(format!("killed-{threads}"));
        // On a busy machine a run may be killed before there is anything to resume.
        let go_on = || match run.join("config.toml").exists() {
            true => resume(&run, threads),
            false => start(&config, &run, threads),
        };
        for kill in 0..2 {
            let mut child = go_on().spawn().unwrap();
            // Loading takes most of such a short run: the later two thirds are where saves happen.
            std::thread::sleep(
                duration.mul_f64(rng.random_range(0.3..1.0)) + Duration::from_millis(20 * kill),
            );
            let _ = child.kill();
            child.wait().unwrap();
        }
        assert!(go_on().status().unwrap().success());
        assert!(final_model(&run) == expected, "{threads} threads");
        let leftovers = std::fs::read_dir(run.join("checkpoints")).unwrap().flatten();
        let leftovers: Vec<_> =
            leftovers.filter(|e| e.file_name().to_string_lossy().ends_with(".tmp")).collect();
        assert!(leftovers.is_empty(), "{leftovers:?}");
    }
}
