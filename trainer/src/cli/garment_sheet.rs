//! A contact sheet: garments on the body they were made for, by category.

use crate::picture::{
    BODY_COLOUR, Camera, Figure, PictureSheet, SheetRow, View, layer_colour, render_with_camera,
};
use clothcombo_data::asset::{Body, Category, Garment};
use image::RgbImage;

/// Most garments of a category.
pub const PER_CATEGORY: usize = 8;
/// Garments in a row.
const GARMENTS_IN_ROW: usize = 8;
/// Sides of one picture (pixels).
const CELL_SIDES: [u32; 2] = [190, 200];

/// Up to [`PER_CATEGORY`] garments of each category, seen from the front left.
pub fn garment_sheet(body: &Body, garments: &[Garment]) -> RgbImage {
    let of = |category| garments.iter().filter(move |g: &&Garment| g.category == category).take(PER_CATEGORY);
    let mut cells: Vec<(Category, RgbImage)> = Vec::new();
    for category in Category::ALL {
        // One camera per category, so that sizes compare.
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for garment in of(category) {
            let bounds = garment.rest.bounds();
            for axis in 0..3 {
                low[axis] = low[axis].min(bounds.0[axis]);
                high[axis] = high[axis].max(bounds.1[axis]);
            }
        }
        let corners: Vec<[f64; 3]> =
            (0..8).map(|c| std::array::from_fn(|a| if c >> a & 1 == 0 { low[a] } else { high[a] })).collect();
        let frame = Figure { positions: &corners, faces: &[], colour: BODY_COLOUR };
        let camera = Camera::framing(&[frame], View::ThreeQuarter, CELL_SIDES);
        cells.extend(of(category).map(|garment| {
            let figures = [
                Figure { positions: &body.template, faces: &body.faces, colour: BODY_COLOUR },
                Figure {
                    positions: garment.rest.positions(),
                    faces: garment.rest.faces(),
                    colour: layer_colour(category as usize),
                },
            ];
            (category, render_with_camera(&figures, &camera, CELL_SIDES))
        }));
    }
    let rows = cells.chunks(GARMENTS_IN_ROW).map(|row| {
        let mut names: Vec<String> =
            row.iter().map(|(category, _)| category.name().replace('_', " ")).collect();
        names.dedup();
        SheetRow {
            label: names.join(", "),
            legend: Vec::new(),
            cells: row.iter().map(|(_, picture)| picture.clone()).collect(),
        }
    });
    PictureSheet { rows: rows.collect(), ..PictureSheet::default() }.compose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::generate::{GarmentGenerator, mannequin};

    #[test]
    fn every_cell_is_as_large_as_the_others() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let garments = [Category::Trousers, Category::TShirt].map(|c| generator.generate(c, 3, 300).unwrap());
        let [one, two] = [&garments[..1], &garments].map(|some| garment_sheet(&body, some).dimensions());
        assert_eq!((one.1, one.0 < two.0), (two.1, true));
        assert!(garment_sheet(&body, &[]).width() < CELL_SIDES[0]);
        // Nine are a whole row and one more.
        let nine: Vec<Garment> = garments.iter().cycle().take(9).cloned().collect();
        assert!(garment_sheet(&body, &nine).height() >= 2 * CELL_SIDES[1]);
    }
}
