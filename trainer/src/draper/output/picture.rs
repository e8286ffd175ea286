//! The picture of a drape: front, back and three-quarter; of a motion some frames, one below the other.

use super::Show;
use crate::draper::Drape;
use crate::picture::{BODY_COLOUR, Figure, LegendEntry, Sheet, SheetRow, View, layer_colour, render};
use image::RgbImage;
use rayon::prelude::*;

/// Width and height of one view [pixels].
const CELL: [u32; 2] = [340, 540];
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
    let legend = || {
        let entry =
            |(layer, name): (usize, &str)| LegendEntry { colour: layer_colour(layer), name: name.to_owned() };
        show.outfit.names().enumerate().map(entry).collect::<Vec<_>>()
    };
    let rows =
        shown.iter().zip(cells.chunks(VIEWS.len())).enumerate().map(|(row, (frame, cells))| SheetRow {
            label: match show.moments.get(*frame) {
                Some(moment) => format!("frame {}, {:.2} s", moment.frame, moment.seconds),
                None => "inner to outer".to_owned(),
            },
            legend: if row == 0 { legend() } else { Vec::new() },
            cells: cells.to_vec(),
        });
    let columns = VIEWS.iter().map(|view| view.name().to_owned()).collect();
    Sheet { title: show.title.to_owned(), columns, rows: rows.collect() }.compose()
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
