//! Table 5: the time of every phase per garment.

use super::subject::Subject;
use super::table::{Table, number};
use crate::dataset::HeldOut;
use crate::evaluation::certificates::Dressing;
use crate::inference::Draped;
use crate::inference::contact_features::LayerInteraction;
use crate::inference::networks::{OnBody, drape_on};
use crate::run::spread::Spread;
use clothcombo_model::Mode;
use clothcombo_physics::contact::resolve::ResolveSettings;
use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use std::time::{Duration, Instant};

/// Wall time per garment [ms], all cores, one outfit at a time.
#[derive(Clone, Debug, Serialize)]
pub struct Times {
    /// Outfits measured.
    pub outfits: usize,
    /// Garments in each.
    pub layers: usize,
    /// Vertices of a garment, mean.
    pub vertices: f64,
    /// Threads the work was shared among.
    pub threads: usize,
    /// Clothes embedding, once per garment.
    pub embedding: Spread,
    /// Single draping and skinning.
    pub draping: Spread,
    /// Untangling.
    pub untangling: Spread,
    /// The correction networks.
    pub correcting: Spread,
    /// Post-process, its share of the body's preparation left out where it needs no way from the T-pose.
    pub post: Spread,
    /// Preparation of the body for the post-process, once per outfit.
    pub body: Spread,
}

/// Garments of an outfit that is timed.
const LAYERS: usize = 3;

/// Times `outfits` random outfits of three garments.
///
/// # Errors
/// When a scene cannot be draped or resolved.
pub fn ask(
    subject: &Subject,
    question: usize,
    outfits: usize,
    settings: &ResolveSettings,
    done: &(dyn Fn() + Sync),
) -> Result<Times, Report> {
    let all: Vec<usize> = (0..subject.dataset.garments.len()).collect();
    let networks = subject.networks();
    let dressing = Dressing::new(&subject.dataset, &subject.config.losses, Some(&networks));
    let mut parts: [Vec<f64>; 6] = Default::default();
    let (mut vertices, mut garments) = (0, 0);
    // The first outfit warms up: buffers, threads, files.
    for index in 0..=outfits {
        let at = [question, index];
        let draw = subject.draw(at, &all, LAYERS, HeldOut::Windows);
        let scene = subject.prepare(draw)?;
        let outfit = subject.tensors.outfit(&scene)?;
        let count = scene.garments.len() as f64;
        let ms = |time: Duration| 1e3 * time.as_secs_f64() / count;
        let clock = Instant::now();
        let embeddings = subject.tensors.embed(
            &subject.model,
            &scene,
            &outfit,
            &subject.tensors.embeddings(),
            Mode::Layered,
        )?;
        // Reading a result waits for it on devices that compute behind the caller's back.
        let _ = embeddings.garment.clone().into_data();
        let embedding = ms(clock.elapsed());
        let (body, start) = subject.tensors.body(&scene.bodies[0]).into_diagnostic()?;
        // Single draping by itself: what the forward pass takes longer is untangling.
        let clock = Instant::now();
        let single = subject.model.forward(&outfit, &embeddings, &body, start.clone(), Mode::Single);
        let _ = Draped::of(single.last());
        let single = clock.elapsed();
        let on_body = OnBody { scene: &scene, outfit: &outfit, embeddings: &embeddings, body: &body, start };
        let (found, networks) = drape_on(&subject.model, &on_body, LayerInteraction::Together);
        let draped = dressing.of(&scene, &found.posed);
        let resolved = draped.resolved(settings)?;
        let post: Duration = resolved.garments.iter().map(|g| g.time).sum();
        if index > 0 {
            let [draping, untangling, correcting] =
                [single, networks.forward.saturating_sub(single), networks.corrections].map(ms);
            let body = ms(resolved.body_time) * count;
            let times = [embedding, draping, untangling, correcting, ms(post), body];
            parts.iter_mut().zip(times).for_each(|(part, time)| part.push(time));
            vertices += scene.garments.iter().map(|w| w.vertex_count()).sum::<usize>();
            garments += scene.garments.len();
            done();
        }
    }
    let [embedding, draping, untangling, correcting, post, body] = parts.map(Spread::of);
    Ok(Times {
        outfits,
        layers: LAYERS,
        vertices: vertices as f64 / garments.max(1) as f64,
        threads: rayon::current_num_threads(),
        embedding,
        draping,
        untangling,
        correcting,
        post,
        body,
    })
}

impl Times {
    /// As a table with the paper's numbers.
    pub fn table(&self) -> Table {
        let mut table = Table::new(
            format!(
                "Time per garment [ms]: {} outfits of {} garments, {:.0} vertices each in the mean",
                self.outfits, self.layers, self.vertices
            ),
            &[
                "",
                "embedding, once",
                "single draping",
                "untangling",
                "corrections",
                "post-process",
                "body of the post-process, once",
            ],
        )
        .with_note(format!(
            "Median (95th percentile), {} threads. The paper's times are for 8,000 vertices on a GPU.",
            self.threads
        ));
        let cell = |s: &Spread| format!("{} ({})", number(s.median), number(s.p95));
        let parts =
            [&self.embedding, &self.draping, &self.untangling, &self.correcting, &self.post, &self.body];
        table.rows.push([vec!["this model".to_owned()], parts.map(cell).to_vec()].concat());
        table.rows.push(["paper", "27", "0.6", "0.4", "–", "200–300", "–"].map(str::to_owned).to_vec());
        table
    }
}
