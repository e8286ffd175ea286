//! The sample picture of a run: validation scenes before and after the networks, front and back.

use crate::dataset::{Dataset, PreparedScene, ValidationGroup};
use crate::evaluation::ValidationSet;
use crate::inference::Draped;
use crate::inference::networks::Networks;
use crate::picture::{
    BODY_COLOUR, Figure, LegendEntry, Sheet, SheetRow, View, layer_colour, render, save_png,
};
use miette::{IntoDiagnostic, Report};
use std::path::Path;

/// Width and height of one picture [pixels].
const CELL: [u32; 2] = [300, 460];

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
    let mut rows = Vec::new();
    for group in [ValidationGroup::Single, ValidationGroup::Layered] {
        let draws = validation.draws(group);
        let count = count.min(draws.len());
        for i in 0..count {
            // One further in each part: layer counts come in turn, and equal strides would always meet the same one.
            let draw = &draws[(i * draws.len() / count + i) % draws.len()];
            rows.push(row(networks, &validation.prepare(dataset, draw)?)?);
        }
    }
    let heading = |m: &str, v: &str| format!("{m}, {v}");
    let columns = ["LBS", "network"].iter().flat_map(|m| ["front", "back"].map(|v| heading(m, v))).collect();
    let sheet = Sheet { title: String::new(), columns, rows };
    save_png(&sheet.compose(), path).into_diagnostic()
}

fn row(networks: &Networks, scene: &PreparedScene) -> Result<SheetRow, Report> {
    let names: Vec<&str> = scene.garments.iter().map(|g| g.garment.name.as_str()).collect();
    let skinned = networks.skin(scene)?;
    let draped = networks.drape(scene)?;
    let cells = [&skinned, &draped]
        .into_iter()
        .flat_map(|d| [View::Front, View::Back].map(|view| picture_of(scene, d, view, &layer_colour)))
        .collect();
    let legend = names
        .iter()
        .enumerate()
        .map(|(i, name)| LegendEntry { colour: layer_colour(i), name: (*name).to_owned() })
        .collect();
    let label = match names.len() {
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
    let wide = |p: &[[f32; 3]]| p.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
    let body = &scene.bodies[0].energy.body;
    let body_positions = wide(&body.positions);
    let positions = wide(&draped.posed);
    let mut figures = vec![Figure { positions: &body_positions, faces: &body.faces, colour: BODY_COLOUR }];
    for (layer, (garment, positions)) in scene.garments.iter().zip(scene.parts(&positions)).enumerate() {
        figures.push(Figure { positions, faces: garment.garment.rest.faces(), colour: colour(layer) });
    }
    render(&figures, view, CELL)
}
