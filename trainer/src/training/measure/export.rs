//! A scene, the networks and their results, as files for an independent implementation.

use super::benchmark_run::BenchmarkRun;
use crate::config::Trains;
use crate::dataset::PreparedScene;
use crate::system::files::write_json;
use burn::store::{ModuleSnapshot, SafetensorsStore};
use clothcombo_data::format::NpzWriter;
use clothcombo_physics::energy::{ContactSamples, SceneEnergy, Term, TermMap};
use clothcombo_physics::mesh::Topology;
use clothcombo_physics::operators::{SparseMatrix, surface_gradient};
use clothcombo_physics::query::Distance;
use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Prefixes of the parameters' names, network by network.
pub const NETWORKS: [&str; 4] = ["garment_encoder", "draping", "skinning", "untangling"];

/// Writes the first scene of the stage, on the first of its bodies, into `folder`: `model.safetensors` (parameters by their
/// documented names), `scene.npz` (body, garments, operators, and the positions our networks find) and `scene.json` (sizes,
/// settings, weights, switches, and our loss and gradient norms: of all networks and of each, 0 for one that is not trained).
///
/// # Errors
/// When a file cannot be written, or the scene cannot be draped.
pub fn export(run: &BenchmarkRun, folder: &Path) -> Result<(), Report> {
    let mut scene = run.scene(0)?;
    scene.bodies.truncate(1);
    std::fs::create_dir_all(folder)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", folder.display()))?;
    let mut model =
        SafetensorsStore::from_file(folder.join("model.safetensors")).overwrite(true).clear_metadata();
    run.model().save_into(&mut model).map_err(|error| miette!("{}: {error}", folder.display()))?;
    arrays(run, &scene)?.save(&folder.join("scene.npz")).into_diagnostic()?;
    write_json(&folder.join("scene.json"), &description(run, &scene)?)
}

fn arrays(run: &BenchmarkRun, scene: &PreparedScene) -> Result<NpzWriter, Report> {
    let body = &scene.bodies[0];
    let mut file = NpzWriter::new();
    let mut positions = |key: &str, values: &[[f32; 3]]| {
        file.f32(key, &[values.len(), 3], values.as_flattened());
    };
    positions("body.positions", &body.energy.body.positions);
    positions("start", &body.start);
    let [posed, canonical] = run.host_drape(scene)?;
    positions("expected.posed", &posed);
    positions("expected.canonical", &canonical);
    let faces = &body.energy.body.faces;
    file.u32("body.faces", &[faces.len(), 3], faces.as_flattened());
    file.f32("shape", &[body.shape.len()], &body.shape);
    file.f32("pose", &[body.pose.len()], &body.pose);
    let bones: Vec<f32> = body.bones.iter().flatten().flatten().map(|v| *v as f32).collect();
    file.f32("bones", &[body.bones.len(), 12], &bones);
    for (layer, ((&index, garment), scene_garment)) in
        scene.sample.garments.iter().zip(&scene.garments).zip(&body.energy.garments).enumerate()
    {
        let key = |name: &str| format!("garment{layer}.{name}");
        let rest = &garment.garment.rest;
        let (vertices, joints) = (rest.vertex_count(), body.bones.len());
        file.f64(&key("rest"), &[vertices, 3], rest.positions().as_flattened());
        file.u32(&key("faces"), &[rest.face_count(), 3], rest.faces().as_flattened());
        file.f32(&key("skin_weights"), &[vertices, joints], &garment.skin_weights);
        let reference = &scene_garment.holding_reference;
        file.f32(&key("holding_reference"), &[reference.len(), 3], reference.as_flattened());
        let operators = run.dataset().garments.operators(index)?;
        let k = operators.eigen_count;
        file.f64(&key("mass"), &[vertices], &operators.mass);
        file.f64(&key("eigenvalues"), &[k], &operators.eigenvalues);
        file.f32(&key("eigenvectors"), &[vertices, k], &operators.eigenvectors);
        let gradient = surface_gradient(rest, &Topology::new(rest));
        for (axis, matrix) in [("x", &gradient.x), ("y", &gradient.y)] {
            let (rows, columns, values) = triplets(matrix);
            file.u32(&key(&format!("gradient_{axis}.rows")), &[rows.len()], &rows);
            file.u32(&key(&format!("gradient_{axis}.columns")), &[columns.len()], &columns);
            file.f64(&key(&format!("gradient_{axis}.values")), &[values.len()], &values);
        }
    }
    Ok(file)
}

fn triplets(matrix: &SparseMatrix) -> (Vec<u32>, Vec<u32>, Vec<f64>) {
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..matrix.rows() {
        let (in_row, of_row) = matrix.row(row);
        rows.extend(std::iter::repeat_n(row as u32, in_row.len()));
        columns.extend_from_slice(in_row);
        values.extend_from_slice(of_row);
    }
    (rows, columns, values)
}

fn description(run: &BenchmarkRun, scene: &PreparedScene) -> Result<Value, Report> {
    let energy = &scene.bodies[0].energy;
    let (loss, gradients) = run.loss_and_gradients(scene)?;
    let squares = |values: &[f32]| values.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    let norm_below = |prefix: &str| {
        let below = gradients.iter().filter(|(name, _)| name.starts_with(prefix));
        below.map(|(_, values)| squares(values)).sum::<f64>().sqrt()
    };
    let norms: Map<String, Value> =
        NETWORKS.into_iter().map(|name| (name.to_owned(), json!(norm_below(&format!("{name}."))))).collect();
    let garments: Vec<Value> = scene
        .garments
        .iter()
        .zip(&energy.garments)
        .map(|(garment, scene_garment)| {
            json!({
                "name": garment.garment.name,
                "vertices": garment.vertex_count(),
                "held": scene_garment.energies.has_holding(),
                "held_posed": scene_garment.pull_back.is_some(),
                "weights": weights(&scene_garment.weights),
            })
        })
        .collect();
    let layers: Vec<Value> = energy
        .layers
        .iter()
        .map(|pair| json!({ "inner": pair.inner, "outer": pair.outer, "weights": weights(&pair.weights) }))
        .collect();
    let config = run.config();
    Ok(json!({
        "model": config.model,
        "optimizer": config.optimizer,
        "garments": garments,
        "contacts": scene.contacts,
        "layers": layers,
        "settings": settings(energy),
        "trains": run.trains(),
        "single_garments": if run.trains() == Trains::All { scene.single_garments } else { 0.0 },
        "expected": { "loss": loss, "gradient_norm": norm_below(""), "gradient_norms": norms },
    }))
}

fn weights(map: &TermMap<f64>) -> Value {
    Term::ALL
        .into_iter()
        .filter(|term| map[*term] != 0.0)
        .map(|term| (term.name().to_owned(), json!(map[term])))
        .collect()
}

fn settings(energy: &SceneEnergy<f32>) -> Value {
    let s = &energy.settings;
    json!({
        "thickness": s.material.thickness,
        "density": s.material.density,
        "lambda": s.material.lambda,
        "mu": s.material.mu,
        "bending_stiffness": s.material.bending_stiffness,
        "gravity": s.gravity_acceleration,
        "body_epsilon": s.body_collision_epsilon,
        "layer_epsilon": s.layer_collision_epsilon,
        "radius": s.repulsion_radius,
        "layer_radius": s.layer_distance_radius,
        "holding_fraction": s.holding_fraction,
        "gate_depth": s.layer_gate.map(|gate| gate.depth),
        "gate_edges": s.layer_gate.map(|gate| gate.tangential_edges),
        "distance": match s.distance {
            Distance::NearestVertex => "nearest_vertex",
            Distance::ClosestPoint => "closest_point",
            Distance::Union => "union",
        },
        "repulsion_per_vertex": s.repulsion_normalised,
        "repulsion_subset": s.repulsion_subset,
        "body_samples_between_vertices": s.body_samples != ContactSamples::Vertices,
        "layer_samples_between_vertices": s.layer_samples != ContactSamples::Vertices,
    })
}
