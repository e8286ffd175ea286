//! A contact sheet: garments on the body they were made for, a row per category.

use crate::picture::{BODY_COLOUR, Camera, Figure, Sheet, SheetRow, View, layer_colour, render_with_camera};
use clothcombo_data::asset::{Body, Category, Garment};
use image::RgbImage;

/// Garments in a row.
pub const PER_ROW: usize = 8;
/// Largest sides of one picture (pixels).
const CELL: [f64; 2] = [190.0, 210.0];

/// Up to [`PER_ROW`] garments of each category, seen from the front left.
pub fn garment_sheet(body: &Body, garments: &[Garment]) -> RgbImage {
    let mut sheet = Sheet::default();
    for category in Category::ALL {
        let row: Vec<&Garment> = garments.iter().filter(|g| g.category == category).take(PER_ROW).collect();
        if row.is_empty() {
            continue;
        }
        // One camera per row, so that sizes compare.
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for garment in &row {
            let bounds = garment.rest.bounds();
            for axis in 0..3 {
                low[axis] = low[axis].min(bounds.0[axis]);
                high[axis] = high[axis].max(bounds.1[axis]);
            }
        }
        let corners: Vec<[f64; 3]> =
            (0..8).map(|c| std::array::from_fn(|a| if c >> a & 1 == 0 { low[a] } else { high[a] })).collect();
        let frame = Figure { positions: &corners, faces: &[], colour: BODY_COLOUR };
        let (width, height) = (high[0] - low[0] + 0.3 * (high[2] - low[2]), high[1] - low[1]);
        let scale = (CELL[0] / width).min(CELL[1] / height);
        let size = [width * scale, height * scale].map(|side| side.round().max(1.0) as u32);
        let camera = Camera::framing(&[frame], View::ThreeQuarter, size);
        let cells = row.iter().map(|garment| {
            let figures = [
                Figure { positions: &body.template, faces: &body.faces, colour: BODY_COLOUR },
                Figure {
                    positions: garment.rest.positions(),
                    faces: garment.rest.faces(),
                    colour: layer_colour(category as usize),
                },
            ];
            render_with_camera(&figures, &camera, size)
        });
        sheet.rows.push(SheetRow {
            label: category.name().replace('_', " "),
            legend: Vec::new(),
            cells: cells.collect(),
        });
    }
    sheet.compose()
}
