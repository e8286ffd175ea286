//! Damaged files: how they are made, and what reading them may cost.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts what is held, and the most that ever was.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let held = HELD.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        MOST.fetch_max(held, Ordering::Relaxed);
        // SAFETY: the caller's guarantees are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's guarantees are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// One test at a time: what is counted belongs to the process.
static ALONE: Mutex<()> = Mutex::new(());

/// Damaged files per format.
pub const ROUNDS: usize = 10_000;

/// Reads [`ROUNDS`] damaged copies of `seeds`, one after the other; `read` says why a file was refused. A share of them within
/// `expected` must be, each with a reason that holds `name`, within 5 s, and with less than `memory` bytes held at any time.
pub fn survive(
    name: &str,
    seeds: &[Vec<u8>],
    expected: Range<f64>,
    memory: usize,
    mut damage: impl FnMut(&[u8], &mut ChaCha8Rng) -> Vec<u8>,
    mut read: impl FnMut(&[u8]) -> Result<(), String>,
) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let (mut refused, mut slowest) = (0, Duration::ZERO);
    for (i, seed) in seeds.iter().enumerate() {
        if let Err(error) = read(seed) {
            panic!("{name}, whole file {i}: {error}");
        }
    }
    let before = HELD.load(Ordering::Relaxed);
    MOST.store(before, Ordering::Relaxed);
    for round in 0..ROUNDS {
        let bytes = damage(&seeds[round % seeds.len()], &mut rng);
        let start = Instant::now();
        if let Err(error) = read(&bytes) {
            refused += 1;
            assert!(error.contains(name), "{name}: a reason that does not name the file: {error}");
        }
        slowest = slowest.max(start.elapsed());
    }
    let share = refused as f64 / ROUNDS as f64;
    let most = MOST.load(Ordering::Relaxed) - before;
    println!("{name}: {:.1} % refused, slowest {slowest:?}, most memory {} KiB", 100.0 * share, most >> 10);
    assert!(expected.contains(&share), "{name}: {refused} of {ROUNDS} refused");
    assert!(slowest < Duration::from_secs(5), "{name}: {slowest:?}");
    assert!(most < memory, "{name}: {most} bytes");
}

/// Flips bits, cuts, doubles and overwrites parts, or turns a number into an absurd one.
pub fn damaged(whole: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    const ABSURD: [&[u8]; 8] = [
        b"99999999999",
        b"-1",
        b"nan",
        b"1e999",
        b"18446744073709551615",
        b"4294967295",
        b"0",
        b"\xff\xff\xff\xff",
    ];
    let mut bytes = whole.to_vec();
    for _ in 0..rng.random_range(1..5) {
        if bytes.is_empty() {
            break;
        }
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..6) {
            0 | 1 => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => bytes.truncate(at),
            3 => {
                let end = (at + rng.random_range(1..40)).min(bytes.len());
                let part = bytes[at..end].to_vec();
                bytes.splice(at..at, part);
            }
            4 => {
                // A whole number of the text, where there is one.
                let start = (at..bytes.len()).find(|i| bytes[*i].is_ascii_digit()).unwrap_or(at);
                let end = (start..bytes.len()).find(|i| !bytes[*i].is_ascii_digit()).unwrap_or(bytes.len());
                bytes.splice(start..end, ABSURD[rng.random_range(0..ABSURD.len())].iter().copied());
            }
            _ => {
                let end = (at + 4).min(bytes.len());
                let absurd: u8 = [0, 0x7f, 0x80, 0xff][rng.random_range(0..4)];
                bytes[at..end].fill(absurd);
            }
        }
    }
    bytes
}
