//! Times of the networks, forward and with the backward pass, and of the fused operations next to burn's own.
//!
//! `cargo bench -p clothcombo-model --features flex [-- FILTER]`; `RAYON_NUM_THREADS` sets the threads.

use std::time::Duration;

use burn::module::Module;
use burn::tensor::{Device, Distribution, Tensor};
use clothcombo_model::ops::{Activation, activate_residual, product};
use clothcombo_model::{
    BodyTensors, ClothCombo, Dimensions, GarmentArrays, GarmentTensors, Mode, ModelConfig, OutfitTensors,
};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion};

const DIMENSIONS: Dimensions = Dimensions { joints: 22, shape: 16, pose: 132 };

fn random(count: usize, range: f32) -> Vec<f32> {
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..count).map(|_| range * (2.0 * next() - 1.0)).collect()
}

fn garment(vertices: usize, eigen: usize, device: &Device) -> GarmentTensors {
    let basis = random(vertices * eigen, 2.0);
    let arrays = GarmentArrays {
        rest: &random(vertices * 3, 0.6),
        mass: &vec![1.0 / vertices as f64; vertices],
        eigenvalues: &(0..eigen).map(|i| 15.0 * i as f64).collect::<Vec<_>>(),
        eigenvectors: &basis,
        gradient_x_basis: &basis,
        gradient_y_basis: &basis,
        skin_weights: &vec![1.0 / DIMENSIONS.joints as f32; vertices * DIMENSIONS.joints],
    };
    GarmentTensors::new(&arrays, DIMENSIONS.joints, device).expect("consistent sizes")
}

fn config(width: usize, eigen_count: usize, diffusion_blocks: usize) -> ModelConfig {
    let skinning_width = width.min(128);
    let (embedding, diffusion_width, siren_width) = (width, width, width);
    ModelConfig {
        width,
        embedding,
        diffusion_blocks,
        diffusion_width,
        eigen_count,
        siren_width,
        skinning_width,
        ..ModelConfig::default()
    }
}

fn networks(criterion: &mut Criterion, vertices: usize, config: &ModelConfig) {
    let device = device();
    let model = ClothCombo::new(config, &DIMENSIONS, 1, &device).expect("valid sizes");
    let bone = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let body = BodyTensors::new(
        &random(DIMENSIONS.shape, 2.0),
        &random(DIMENSIONS.pose, 1.0),
        &vec![bone; DIMENSIONS.joints],
        &random(30 * DIMENSIONS.joints, 1.0),
        &DIMENSIONS,
        &device,
    )
    .expect("consistent sizes");
    let one = garment(vertices, config.eigen_count, &device);
    let name = format!("width {} vertices {vertices}", config.width);
    let mut group = criterion.benchmark_group(&name);
    group.sample_size(15).measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(500));

    let plain = model.valid();
    time(&mut group, "encode forward", 1, || plain.encode(&one).vertex.into_data());
    time(&mut group, "encode forward+backward", 1, || model.encode(&one).vertex.sum().backward());
    for count in [1, 3] {
        let garments = vec![&one; count];
        let outfit = OutfitTensors::new(&garments, &OutfitTensors::all_pairs(count)).expect("valid outfit");
        let start = || outfit.rest.clone();
        let embedded: Vec<_> = (0..count).map(|_| plain.encode(&one)).collect();
        let packed = plain.pack(&outfit, &embedded, Mode::Layered).expect("matching");
        for mode in [Mode::Single, Mode::Layered] {
            time(&mut group, &format!("{mode:?} forward (packed)"), count, || {
                let states = plain.forward(&outfit, &packed, &body, start(), mode);
                states.last().posed.clone().into_data()
            });
            time(&mut group, &format!("{mode:?} forward+backward"), count, || {
                let embedded: Vec<_> = (0..count).map(|_| model.encode(&one)).collect();
                let packed = model.pack(&outfit, &embedded, mode).expect("matching");
                let states = model.forward(&outfit, &packed, &body, start(), mode);
                states.last().posed.clone().sum().backward()
            });
        }
    }
    group.finish();
}

/// Times a function of so many garments.
fn time<T>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    garments: usize,
    mut run: impl FnMut() -> T,
) {
    group.bench_function(BenchmarkId::new(name, garments), |bencher| bencher.iter(&mut run));
}

fn operations(criterion: &mut Criterion) {
    let device = device();
    for (rows, columns) in [(1_100, 64), (1_100, 128), (8_000, 64), (8_000, 128), (8_000, 512)] {
        let tensor = |rows: usize| {
            Tensor::<2>::random([rows, columns], Distribution::Normal(0.0, 1.0), &device).require_grad()
        };
        let (input, bias, gate) = (tensor(rows), tensor(1), tensor(rows));
        let arguments = || (input.clone(), bias.clone(), gate.clone());
        let mut group = criterion.benchmark_group(format!("operation {rows}x{columns}"));
        group
            .sample_size(10)
            .measurement_time(Duration::from_secs(1))
            .warm_up_time(Duration::from_millis(200));
        let mut time = |name: &str, operation: &dyn Fn() -> Tensor<2>| {
            group.bench_function(name, |bencher| bencher.iter(|| operation().sum().backward()));
        };
        time("gelu, fused", &|| {
            let (input, bias, gate) = arguments();
            activate_residual(Activation::Gelu, input, bias, gate)
        });
        time("gelu, composed", &|| {
            let (input, bias, gate) = arguments();
            burn::tensor::activation::gelu(input + bias) + gate
        });
        group.finish();
    }
}

/// Multiplications and additions per second are 2·2000·W² by the time.
fn products(criterion: &mut Criterion) {
    let device = device().inner();
    for width in [64, 128, 512] {
        let tensor =
            |rows: usize| Tensor::<2>::random([rows, width], Distribution::Normal(0.0, 1.0), &device);
        let (rows, weight) = (tensor(2_000), tensor(width));
        let mut group = criterion.benchmark_group(format!("product 2000x{width}x{width}"));
        group.sample_size(10).measurement_time(Duration::from_secs(1));
        group.bench_function("ours", |bencher| bencher.iter(|| product(rows.clone(), weight.clone())));
        group.bench_function("burn's", |bencher| bencher.iter(|| rows.clone().matmul(weight.clone())));
        group.finish();
    }
}

fn device() -> Device {
    #[cfg(feature = "flex")]
    let device = Device::flex();
    #[cfg(not(feature = "flex"))]
    let device = Device::default();
    device.autodiff()
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    operations(&mut criterion);
    products(&mut criterion);
    networks(&mut criterion, 1_100, &config(64, 48, 4));
    networks(&mut criterion, 2_000, &config(128, 64, 4));
    if std::env::var_os("CLOTHCOMBO_BENCH_PAPER").is_some() {
        networks(&mut criterion, 8_000, &config(512, 128, 8));
    }
    criterion.final_summary();
}
