//! The pictures of a drape: all garments, of a motion in some frames, one below the other; and each garment alone.

use super::show::Show;
use crate::picture::{DressedRow, draw_dressed};
use image::RgbImage;

/// Rows of a motion's picture.
const PICTURE_ROWS: usize = 4;

pub(super) fn draw(show: &Show) -> RgbImage {
    let count = show.drapes.len();
    let shown: Vec<usize> = match count {
        0..=PICTURE_ROWS => (0..count).collect(),
        _ => (0..PICTURE_ROWS).map(|row| row * (count - 1) / (PICTURE_ROWS - 1)).collect(),
    };
    let rows: Vec<DressedRow> = shown.into_iter().map(|frame| row(show, frame)).collect();
    let names: Vec<&str> = show.outfit.names().collect();
    draw_dressed(show.title, &names, &rows)
}

/// Each garment alone, in the first frame.
pub(super) fn draw_layers(show: &Show) -> RgbImage {
    let names: Vec<&str> = show.outfit.names().collect();
    draw_dressed(show.title, &names, &row(show, 0).layers(&names))
}

fn row<'a>(show: &'a Show, frame: usize) -> DressedRow<'a> {
    let drape = &show.drapes[frame];
    let garments = show.outfit.garments.iter().zip(&drape.garments);
    DressedRow {
        label: show
            .bodies
            .moments
            .get(frame)
            .map_or(String::new(), |m| format!("frame {}, {:.2} s", m.frame, m.seconds)),
        body: (&drape.body, &show.draper.body().faces),
        heading: drape.heading,
        garments: garments
            .map(|(garment, g)| (&g.positions[..], garment.prepared.garment.rest.faces()))
            .collect(),
        innermost: 0,
    }
}
