//! The picture of a drape: front, back and three-quarter; of a motion some frames, one below the other.

use super::Show;
use crate::draper::Drape;
use crate::picture::{BODY_COLOUR, Figure, LegendEntry, Sheet, SheetRow, View, layer_colour, render};
use image::RgbImage;
use rayon::prelude::*;

/// Width and height of one view [pixels].
const CELL: [u32; 2] = [340, 540];
/// Garments named on one line of the legend, from inner to outer.
const NAMES_PER_LINE: usize = 3;
/// Rows of a motion's picture.
const ROWS: usize = 4;
const VIEWS: [View; 3] = [View::Front, View::Back, View::ThreeQuarter];

pub(super) fn draw(show: &Show) -> RgbImage {
    let count = show.drapes.len();
    let shown: Vec<usize> = match count {
        0..=ROWS => (0..count).collect(),
        _ => (0..ROWS).map(|row| row * (count - 1) / (ROWS - 1)).collect(),
    };
    let cells: Vec<RgbImage> = shown
        .iter()
        .flat_map(|frame| VIEWS.map(|view| (*frame, view)))
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(frame, view)| cell(show, &show.drapes[frame], view))
        .collect();
    let entries: Vec<LegendEntry> = show
        .outfit
        .names()
        .enumerate()
        .map(|(layer, name)| LegendEntry { colour: layer_colour(layer), name: name.to_owned() })
        .collect();
    // Lines of the legend; the last one is that of the first frame.
    let mut rows: Vec<SheetRow> = entries
        .chunks(NAMES_PER_LINE)
        .map(|names| SheetRow { label: String::new(), legend: names.to_vec(), cells: Vec::new() })
        .collect();
    for (row, (frame, cells)) in shown.iter().zip(cells.chunks(VIEWS.len())).enumerate() {
        match (row, show.moments.get(*frame)) {
            (0, None) => rows.last_mut().into_iter().for_each(|last| last.cells = cells.to_vec()),
            (_, moment) => rows.push(SheetRow {
                label: moment.map_or(String::new(), |m| format!("frame {}, {:.2} s", m.frame, m.seconds)),
                legend: Vec::new(),
                cells: cells.to_vec(),
            }),
        }
    }
    let columns = VIEWS.iter().map(|view| view.name().to_owned()).collect();
    Sheet { title: show.title.to_owned(), columns, rows }.compose()
}

fn cell(show: &Show, drape: &Drape, view: View) -> RgbImage {
    // Front is where the body faces.
    let (azimuth, elevation) = view.angles();
    let view = View::Orbit { azimuth: azimuth + drape.heading, elevation };
    let faces = &show.draper.body().faces;
    let mut figures = vec![Figure { positions: &drape.body, faces, colour: BODY_COLOUR }];
    for (layer, (piece, garment)) in show.outfit.pieces.iter().zip(&drape.garments).enumerate() {
        figures.push(Figure {
            positions: &garment.positions,
            faces: piece.worn.garment.rest.faces(),
            colour: layer_colour(layer),
        });
    }
    render(&figures, view, CELL)
}
