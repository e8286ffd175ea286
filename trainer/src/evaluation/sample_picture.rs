//! The sample picture of a run: validation scenes before and after the networks, front and back.

use super::scene_evaluation::drape_by;
use super::validation::ValidationSet;
use crate::dataset::{Dataset, PreparedScene, ValidationGroup};
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::inference::reference::wide;
use crate::picture::{
    BODY_COLOUR, Figure, LegendEntry, PictureSheet, SheetRow, View, layer_colour, render, save_png,
};
use crate::run::validation::Method;
use miette::{IntoDiagnostic, Report};
use std::path::Path;

/// Width and height of one picture (pixels).
const PICTURE_SIZE: [u32; 2] = [300, 460];
const SAMPLE_VIEWS: [View; 2] = [View::Front, View::Back];

/// Draws `count` single and `count` layered validation scenes, evenly chosen, to `path`.
///
/// # Errors
/// When a scene cannot be draped or the picture not written.
pub fn draw(
    dataset: &Dataset,
    validation: &ValidationSet,
    networks: &Networks,
    count: usize,
    path: &Path,
) -> Result<(), Report> {
    let methods = [validation.skinning(), Method::Network];
    let mut rows = Vec::new();
    for group in [ValidationGroup::Single, ValidationGroup::Layered] {
        let samples = validation.samples(group);
        let count = count.min(samples.len());
        for i in 0..count {
            // One further in each part: layer counts are round-robin, and equal steps would always meet the same one.
            let sample = &samples[(i * samples.len() / count + i) % samples.len()];
            rows.push(row(networks, &methods, &validation.prepare(dataset, sample)?)?);
        }
    }
    let columns =
        methods.iter().flat_map(|m| SAMPLE_VIEWS.map(|v| format!("{}, {}", m.name(), v.name()))).collect();
    let sheet = PictureSheet { title: String::new(), columns, rows };
    save_png(&sheet.compose(), path).into_diagnostic()
}

fn row(networks: &Networks, methods: &[Method], scene: &PreparedScene) -> Result<SheetRow, Report> {
    let drapes = drape_by(networks, methods, scene)?;
    let pictures = |d| SAMPLE_VIEWS.map(|view| picture_of(scene, d, view, &layer_colour));
    let cells = drapes.iter().flat_map(pictures).collect();
    let garments = scene.garments.iter().enumerate();
    let legend = garments
        .map(|(i, garment)| LegendEntry { colour: layer_colour(i), name: garment.garment.name.clone() })
        .collect();
    let label = match scene.garments.len() {
        1 => "1 garment".to_owned(),
        several => format!("{several} garments, inner to outer"),
    };
    Ok(SheetRow { label, legend, cells })
}

/// A drape of `scene` on its first body; `colour` of a layer, 0 the innermost.
pub(crate) fn picture_of(
    scene: &PreparedScene,
    draped: &Draped,
    view: View,
    colour: &dyn Fn(usize) -> [u8; 3],
) -> image::RgbImage {
    let body = &scene.bodies[0].energy.body;
    let body_positions = wide(&body.positions);
    let positions = wide(&draped.posed);
    let mut figures = vec![Figure { positions: &body_positions, faces: &body.faces, colour: BODY_COLOUR }];
    for (layer, (garment, positions)) in scene.garments.iter().zip(scene.parts(&positions)).enumerate() {
        figures.push(Figure { positions, faces: garment.garment.rest.faces(), colour: colour(layer) });
    }
    render(&figures, view, PICTURE_SIZE)
}
