//! `clothcombo bench operators`: what preparing a garment for DiffusionNet costs, and how exact the eigenpairs are.

use crate::cli::table::{row, table};
use crate::cli::values::{at_least_one, measuring_seconds};
use crate::dataset::DatasetError;
use crate::evaluation::median_ms;
use clap::Parser;
use clothcombo_data::asset::Category;
use clothcombo_data::format::{load_tri_mesh, obj};
use clothcombo_data::generate::{GarmentGenerator, GarmentSettings, mannequin};
use clothcombo_physics::mesh::TriMesh;
use clothcombo_physics::operators::{SurfaceOperators, cotangent_laplacian};
use miette::{IntoDiagnostic, Report, miette};
use serde_json::json;
use std::path::PathBuf;

/// Time of mass, Laplacian, eigenpairs and gradients of a garment on one core, and the error of the eigenpairs
#[derive(Parser)]
#[command(after_help = "Examples:\n  clothcombo bench operators --vertices 8000 --eigen-count 128\n  \
        clothcombo bench operators --garment shirt.obj --json\n\n\
        scripts/bench_operators.py times DiffusionNet's published preparation on the same mesh (--export).")]
pub struct Arguments {
    /// Garment mesh; default: a generated T-shirt
    #[arg(long, value_name = "FILE")]
    garment: Option<PathBuf>,
    /// Vertices of the generated one, about
    #[arg(long, default_value_t = 8000)]
    vertices: usize,
    /// Eigenpairs k
    #[arg(long, default_value_t = 128, value_parser = at_least_one)]
    eigen_count: usize,
    /// Time spent on the measurement [s]
    #[arg(long, default_value_t = 5.0, value_parser = measuring_seconds)]
    seconds: f64,
    /// Writes the mesh (OBJ)
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Print JSON instead of a table, eigenvalues included
    #[arg(long)]
    json: bool,
}

/// Runs the bench.
///
/// # Errors
/// When the mesh cannot be read, written or prepared.
pub fn run(arguments: &Arguments) -> Result<(), Report> {
    let mesh = match &arguments.garment {
        Some(path) => load_tri_mesh(path).map_err(DatasetError::data)?,
        None => {
            let settings =
                GarmentSettings { target_vertices: arguments.vertices, ..GarmentSettings::default() };
            let body = mannequin();
            let generator = GarmentGenerator::new(&body).into_diagnostic()?;
            generator.generate(Category::TShirt, 0, &settings).into_diagnostic()?.rest
        }
    };
    if arguments.eigen_count > mesh.vertex_count() {
        return Err(miette!(
            help = "lower --eigen-count",
            "{} eigenpairs of a mesh of {} vertices",
            arguments.eigen_count,
            mesh.vertex_count()
        ));
    }
    if let Some(path) = &arguments.export {
        obj::save(path, mesh.positions(), mesh.faces(), &[]).into_diagnostic()?;
    }
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().into_diagnostic()?;
    let count = arguments.eigen_count;
    let ms = one_core
        .install(|| median_ms(arguments.seconds, || SurfaceOperators::new(&mesh, count)))
        .into_diagnostic()?;
    let operators = SurfaceOperators::new(&mesh, count).into_diagnostic()?;
    let (residual, orthogonality) = errors(&mesh, &operators);
    if arguments.json {
        let found = json!({
            "vertices": mesh.vertex_count(),
            "eigen_count": operators.eigen_count,
            "milliseconds": ms,
            "residual": residual,
            "orthogonality": orthogonality,
            "eigenvalues": operators.eigenvalues,
        });
        println!("{}", serde_json::to_string_pretty(&found).into_diagnostic()?);
        return Ok(());
    }
    let row = row! {
        "vertices" => mesh.vertex_count(),
        "eigenpairs" => operators.eigen_count,
        "time, one core [ms]" => ms,
        "largest residual" => residual,
        "off orthonormal" => orthogonality,
    };
    print!("{}", table(&[row]));
    println!("residual: |L φ − λ M φ| over (λ of the last pair) |M φ|; vectors are stored in f32");
    Ok(())
}

/// Largest relative residual of an eigenpair, and largest deviation of ΦᵀMΦ from one.
fn errors(mesh: &TriMesh, operators: &SurfaceOperators) -> (f64, f64) {
    let laplacian = cotangent_laplacian(mesh);
    let (count, vertices) = (operators.eigen_count, operators.vertex_count);
    let total: f64 = operators.mass.iter().sum();
    let column = |k: usize| -> Vec<f64> {
        (0..vertices).map(|v| f64::from(operators.eigenvectors[v * count + k])).collect()
    };
    let columns: Vec<Vec<f64>> = (0..count).map(column).collect();
    let weighted: Vec<Vec<f64>> =
        columns.iter().map(|c| c.iter().zip(&operators.mass).map(|(x, m)| x * m).collect()).collect();
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let last = operators.eigenvalues.last().copied().unwrap_or(1.0).max(1.0 / total);
    let mut residual: f64 = 0.0;
    let mut orthogonality: f64 = 0.0;
    for k in 0..count {
        let difference: Vec<f64> = laplacian
            .apply(&columns[k])
            .iter()
            .zip(&weighted[k])
            .map(|(l, m)| l - operators.eigenvalues[k] * m)
            .collect();
        residual = residual.max(norm(&difference) / (last * norm(&weighted[k])));
        for j in 0..=k {
            let product: f64 = columns[j].iter().zip(&weighted[k]).map(|(a, b)| a * b).sum();
            orthogonality = orthogonality.max((product - f64::from(u8::from(j == k))).abs());
        }
    }
    (residual, orthogonality)
}
