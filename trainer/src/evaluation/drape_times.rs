//! Table 5: the time of every phase per garment.

use super::{Evaluator, Section, Table};
use crate::inference::Draped;
use crate::inference::networks::drape_on;
use crate::inference::on_body::OnBody;
use crate::run::report::table::{Column, median_and_p95, plain};
use crate::run::spread::Spread;
use clothcombo_model::Mode;
use miette::{IntoDiagnostic, Report};
use serde_json::json;
use std::time::{Duration, Instant};

/// The phases. Times are per garment, but for the preparation of the body, which is once per outfit.
const PHASE_COLUMNS: [Column<'_>; 6] = [
    ("embedding, once", "/milliseconds/embedding", median_and_p95),
    ("single draping", "/milliseconds/single", median_and_p95),
    ("untangling", "/milliseconds/untangling", median_and_p95),
    ("acceptance", "/milliseconds/acceptance", median_and_p95),
    ("post-process", "/milliseconds/post_process", median_and_p95),
    ("body of the post-process, once", "/milliseconds/body", median_and_p95),
];
/// The paper's Table 5.
const PAPER_TABLE_5: [&str; 7] = ["paper", "27", "0.6", "0.4", "–", "200–300", "–"];

/// Garments of an outfit that is timed.
const TIMED_LAYERS: usize = 3;

/// Wall time of every phase of random outfits, all threads, one outfit at a time.
pub fn sections(evaluator: &Evaluator<'_>) -> Result<Vec<Section>, Report> {
    let Evaluator { model, post_process, settings, counts, .. } = evaluator;
    let outfits = counts.timed;
    let tensors = &model.tensors;
    let mut times: [Vec<f64>; PHASE_COLUMNS.len()] = Default::default();
    let (mut vertices, mut garments) = (0, 0);
    // The first outfit warms up: buffers, threads, files.
    for index in 0..=outfits {
        let scene = model.prepare(&model.sample_outfit([6, index], TIMED_LAYERS))?;
        let outfit = tensors.outfit(&scene)?;
        let count = scene.garments.len();
        let milliseconds = |time: Duration| 1e3 * time.as_secs_f64();
        let per_garment = |time: Duration| milliseconds(time) / count as f64;
        let clock = Instant::now();
        let embeddings =
            tensors.embed(&model.model, &scene, &outfit, &tensors.embeddings(), Mode::Layered)?;
        // Reading a result waits for it on devices that compute behind the caller's back.
        let _ = embeddings.garment.clone().into_data();
        let embedding = clock.elapsed();
        let (body, start) = tensors.body(&scene.bodies[0]).into_diagnostic()?;
        // Single draping by itself: what the forward pass takes longer is untangling.
        let clock = Instant::now();
        let single = model.model.forward(&outfit, &embeddings, &body, start.clone(), Mode::Single);
        let _ = Draped::of(single.last());
        let single = clock.elapsed();
        let on_body = OnBody { scene: &scene, outfit: &outfit, embeddings: &embeddings, body: &body, start };
        let (draped, networks) = drape_on(&model.model, &on_body, Mode::Layered);
        let resolved = post_process.of(&scene, &draped.posed).resolved(settings)?;
        if index > 0 {
            // The body's preparation is part of the garments' time only where a continuation path needs it again.
            let post_process = resolved.garments.iter().map(|g| g.time).sum();
            let untangling = networks.forward.saturating_sub(single);
            let phases = [embedding, single, untangling, networks.acceptance, post_process];
            let phases = phases.map(per_garment).into_iter().chain([milliseconds(resolved.body_time)]);
            times.iter_mut().zip(phases).for_each(|(times, time)| times.push(time));
            vertices += scene.garments.iter().map(|garment| garment.vertex_count()).sum::<usize>();
            garments += count;
            evaluator.scene_done();
        }
    }
    let vertices = vertices as f64 / garments.max(1) as f64;
    let threads = rayon::current_num_threads();
    let [embedding, single, untangling, acceptance, post_process, body] = times.map(Spread::of);
    let numbers = json!({
        "name": "this model",
        "outfits": outfits,
        "layers": TIMED_LAYERS,
        "vertices": vertices,
        "threads": threads,
        "milliseconds": {
            "embedding": embedding,
            "single": single,
            "untangling": untangling,
            "acceptance": acceptance,
            "post_process": post_process,
            "body": body,
        },
    });
    let title = format!(
        "Time per garment [ms]: {outfits} outfits of {TIMED_LAYERS} garments, {vertices:.0} vertices each in the mean"
    );
    let columns = [[("", "/name", plain as fn(&_) -> _)].as_slice(), &PHASE_COLUMNS].concat();
    let table = Table::new(title, std::slice::from_ref(&numbers), &columns)
        .with_row(PAPER_TABLE_5)
        .with_note(format!(
            "Median (95th percentile), {threads} threads. The paper's times are for 8,000 vertices on a GPU."
        ));
    Ok(vec![Section::new("times", "Time per phase (Table 5)", "", numbers, vec![table])])
}
