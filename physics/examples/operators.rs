//! Time of the surface operators of a garment on one core, and the error of its eigenpairs, as JSON.
//!
//! `cargo run --release -p clothcombo-physics --example operators -- --vertices 8000 --eigen-count 128`. `--export FILE`
//! writes the mesh (OBJ); `scripts/bench_operators.py` times DiffusionNet's published preparation on it.

#[path = "../benches/scenes/mod.rs"]
mod scenes;

use std::error::Error;
use std::io::Write;

use clothcombo_physics::TriMesh;
use clothcombo_physics::operators::{SurfaceOperators, cotangent_laplacian};
use scenes::Growth;

const USAGE: &str = "usage: operators [--vertices N] [--eigen-count K] [--seconds S] [--export FILE]";

fn export(path: &str, mesh: &TriMesh) -> std::io::Result<()> {
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    for [x, y, z] in mesh.positions() {
        writeln!(file, "v {x} {y} {z}")?;
    }
    for [a, b, c] in mesh.faces().iter().map(|face| face.map(|v| v + 1)) {
        writeln!(file, "f {a} {b} {c}")?;
    }
    file.flush()
}

/// Largest residual `|L φ − λ M φ|` relative to `(λ of the last pair)·|M φ|`, and largest deviation of `ΦᵀMΦ` from one; the
/// vectors are stored in `f32`.
fn errors(mesh: &TriMesh, operators: &SurfaceOperators) -> (f64, f64) {
    let laplacian = cotangent_laplacian(mesh);
    let (count, vertices) = (operators.eigen_count, operators.vertex_count);
    let column = |k: usize| -> Vec<f64> {
        (0..vertices).map(|v| f64::from(operators.eigenvectors[v * count + k])).collect()
    };
    let columns: Vec<Vec<f64>> = (0..count).map(column).collect();
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let last = operators.eigenvalues[count - 1].max(1.0 / mesh.area());
    let (mut residual, mut orthogonality) = (0.0f64, 0.0f64);
    for (k, column) in columns.iter().enumerate() {
        let weighted: Vec<f64> = column.iter().zip(&operators.mass).map(|(x, m)| x * m).collect();
        let image = laplacian.apply(column);
        let difference: Vec<f64> =
            image.iter().zip(&weighted).map(|(l, m)| l - operators.eigenvalues[k] * m).collect();
        residual = residual.max(norm(&difference) / (last * norm(&weighted)));
        for (j, other) in columns[..=k].iter().enumerate() {
            let product: f64 = other.iter().zip(&weighted).map(|(a, b)| a * b).sum();
            orthogonality = orthogonality.max((product - f64::from(u8::from(j == k))).abs());
        }
    }
    (residual, orthogonality)
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut vertices, mut eigen_count, mut seconds, mut path) = (8000, 128, 5.0, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(name) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{name} needs a value\n{USAGE}"))?;
        match name.as_str() {
            "--vertices" => vertices = value.parse()?,
            "--eigen-count" => eigen_count = value.parse()?,
            "--seconds" => seconds = value.parse()?,
            "--export" => path = Some(value),
            _ => return Err(format!("unknown option {name}\n{USAGE}").into()),
        }
    }
    let mesh = scenes::garment(vertices, Growth::FixedArea, 0.0).rest;
    if eigen_count == 0 || eigen_count > mesh.vertex_count() {
        return Err(format!("{eigen_count} eigenpairs of {} vertices\n{USAGE}", mesh.vertex_count()).into());
    }
    if let Some(path) = path {
        export(&path, &mesh)?;
    }
    let operators = SurfaceOperators::new(&mesh, eigen_count)?;
    let milliseconds =
        scenes::median_ms(seconds, scenes::wall_ms(), || SurfaceOperators::new(&mesh, eigen_count));
    let (residual, orthogonality) = errors(&mesh, &operators);
    println!(
        "{{\"vertices\": {}, \"eigen_count\": {eigen_count}, \"milliseconds\": {milliseconds}, \"residual\": {residual}, \
         \"orthogonality\": {orthogonality}, \"eigenvalues\": {:?}}}",
        mesh.vertex_count(),
        operators.eigenvalues
    );
    Ok(())
}
