//! Times of all energies, one line per term and size, tab-separated.
//!
//! `cargo run --release --example energy_times -- --sizes 5000,50000 --growth area --subset 16`
//! (`RAYON_NUM_THREADS` sets the threads). `--export FOLDER` writes the meshes of the scenes as raw little-endian arrays for
//! `scripts/bench_energies_torch.py` instead. `--processor-time` sums the time that all threads
//! ran, for a machine that has other work.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use std::error::Error;
use std::path::Path;

use clothcombo_physics::Term;
use scenes::{Growth, Scene};

struct Options {
    sizes: Vec<usize>,
    growth: Growth,
    subset: Option<usize>,
    export: Option<String>,
    seconds: f64,
    processor_time: bool,
}

const USAGE: &str = "usage: energy_times [--sizes N,N,…] [--growth area|edge] [--subset K] [--seconds S] [--processor-time] [--export FOLDER]";

fn options() -> Result<Options, Box<dyn Error>> {
    let mut options = Options {
        sizes: scenes::SIZES.to_vec(),
        growth: Growth::FixedArea,
        subset: None,
        export: None,
        seconds: 0.5,
        processor_time: false,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{name} needs a value\n{USAGE}"));
        match name.as_str() {
            "--sizes" => {
                options.sizes = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?;
            }
            "--growth" => {
                options.growth = match value()?.as_str() {
                    "area" => Growth::FixedArea,
                    "edge" => Growth::FixedEdge,
                    other => return Err(format!("--growth {other}: area or edge\n{USAGE}").into()),
                };
            }
            "--subset" => options.subset = Some(value()?.parse()?),
            "--seconds" => options.seconds = value()?.parse()?,
            "--processor-time" => options.processor_time = true,
            "--export" => options.export = Some(value()?),
            _ => return Err(format!("unknown option {name}\n{USAGE}").into()),
        }
    }
    Ok(options)
}

/// Median time (ms) of `run`; with `processor_time` of the time that this process had a processor, which other work on the
/// machine hardly changes.
fn time_ms<R>(options: &Options, run: impl FnMut() -> R) -> f64 {
    match options.processor_time {
        true => scenes::median_ms(options.seconds, processor_ms, run),
        false => scenes::median_ms(options.seconds, scenes::wall_ms(), run),
    }
}

/// Time (ms) that the threads of this process have run; NaN where the system does not tell.
fn processor_ms() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let run_time = |thread: std::fs::DirEntry| {
        let line = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        line.split(' ').next()?.parse::<f64>().ok()
    };
    1e-6 * threads.flatten().filter_map(run_time).sum::<f64>()
}

fn report(name: &str, scene: &Scene, terms: &[Term], options: &Options) {
    let energy = scene.energy(terms);
    let value = time_ms(options, || energy.value(&scene.posed, &scene.canonical));
    let gradient = time_ms(options, || energy.evaluate(&scene.posed, &scene.canonical));
    let total = energy.value(&scene.posed, &scene.canonical).total;
    let vertices = scene.dressed[0].rest.vertex_count();
    println!("{name}\t{vertices}\t{value:.4}\t{gradient:.4}\t{total:.9e}");
}

fn export(folder: &Path, name: &str, vertices: usize, growth: Growth) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let floats = |part: &str, positions: &[[f32; 3]]| {
        let bytes: Vec<u8> = positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(folder.join(format!("{name}_{part}.f32")), bytes)
    };
    let integers = |part: &str, faces: &[[u32; 3]]| {
        let bytes: Vec<u8> = faces.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
        std::fs::write(folder.join(format!("{name}_{part}.u32")), bytes)
    };
    let scene = Scene::new(vertices, growth, 2, None);
    for (layer, dressed) in scene.dressed.iter().enumerate() {
        floats(&format!("rest{layer}"), &scenes::narrowed(dressed.rest.positions()))?;
        floats(&format!("posed{layer}"), &scenes::narrowed(&dressed.posed))?;
    }
    integers("faces", scene.dressed[0].rest.faces())?;
    floats("canonical", &scene.canonical[..scene.dressed[0].rest.vertex_count()])?;
    let body = scenes::body(vertices, growth);
    floats("body", &scenes::narrowed(body.positions()))?;
    integers("body_faces", body.faces())?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = options()?;
    if let Some(folder) = &options.export {
        for &size in &options.sizes {
            export(Path::new(folder), &size.to_string(), size, options.growth)?;
        }
        return Ok(());
    }
    println!("term\tvertices\tvalue_ms\tgradient_ms\ttotal");
    for &size in &options.sizes {
        let single = Scene::new(size, options.growth, 1, options.subset);
        for term in scenes::single_terms() {
            report(term.name(), &single, &[term], &options);
        }
        report("all single-garment terms", &single, &scenes::single_terms(), &options);
        let layered = Scene::new(size, options.growth, 2, options.subset);
        for term in scenes::layer_terms() {
            report(term.name(), &layered, &[term], &options);
        }
    }
    Ok(())
}
