//! Ten thousand damaged files per mesh format: no panic, no hang, no memory beyond the file's worth, always a reason.

use clothcombo_data::format::mesh::parse_mesh;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
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
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const POINTS: [[f32; 3]; 4] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.5]];

fn ply(encoding: &str, big: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    if encoding == "ascii" {
        bytes.extend(b"0 0 0\n1 0 0\n1 1 0\n0 1 0.5\n4 0 1 2 3\n3 2 1 0\n");
        return bytes;
    }
    let mut word = |raw: [u8; 4]| bytes.extend(if big { [raw[3], raw[2], raw[1], raw[0]] } else { raw });
    POINTS.iter().flatten().for_each(|x| word(x.to_le_bytes()));
    for face in [&[0u32, 1, 2, 3][..], &[2, 1, 0]] {
        bytes.push(face.len() as u8);
        for v in face {
            bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() });
        }
    }
    bytes
}

fn stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2u32.to_le_bytes());
    for corners in [[0, 1, 2], [0, 2, 3]] {
        bytes.extend([0u8; 12]);
        corners.iter().flat_map(|c| POINTS[*c]).for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

fn glb() -> Vec<u8> {
    let mut binary: Vec<u8> = POINTS.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    [0u16, 1, 2, 0, 2, 3].iter().for_each(|i| binary.extend(i.to_le_bytes()));
    let mut json = br#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[1],"scale":[2,2,2]},{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],"bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],"buffers":[{"byteLength":60}]}"#.to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (kind, chunk) in [(0x4E4F_534Au32, &json), (0x004E_4942, &binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    bytes
}

/// Flips bits, cuts, doubles and overwrites parts, or turns a number into an absurd one.
fn damaged(whole: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
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

#[test]
fn damaged_files_give_a_mesh_or_a_reason() {
    let obj = b"g a\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0.5\nf 1/1 2/2 3/3 4/4\ng b\nf -4 -3 -2\n".to_vec();
    let text_stl = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid a\n".to_vec();
    let formats: [(&str, Vec<Vec<u8>>); 4] = [
        ("x.obj", vec![obj]),
        (
            "x.ply",
            vec![ply("ascii", false), ply("binary_little_endian", false), ply("binary_big_endian", true)],
        ),
        ("x.stl", vec![stl(), text_stl]),
        ("x.glb", vec![glb()]),
    ];
    for (name, seeds) in formats {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut refused, mut slowest) = (0, Duration::ZERO);
        for seed in &seeds {
            assert!(parse_mesh(seed, Path::new(name)).is_ok(), "{name}");
        }
        MOST.store(HELD.load(Ordering::Relaxed), Ordering::Relaxed);
        let before = HELD.load(Ordering::Relaxed);
        for round in 0..10_000 {
            let bytes = damaged(&seeds[round % seeds.len()], &mut rng);
            let start = Instant::now();
            if let Err(error) = parse_mesh(&bytes, Path::new(name)) {
                refused += 1;
                assert!(error.to_string().contains(name), "{error}");
            }
            slowest = slowest.max(start.elapsed());
        }
        assert!((2_000..10_000).contains(&refused), "{name}: {refused} refused");
        assert!(slowest < Duration::from_secs(5), "{name}: {slowest:?}");
        let most = MOST.load(Ordering::Relaxed) - before;
        assert!(most < 16 << 20, "{name}: {most} bytes for files of a few hundred");
    }
}
