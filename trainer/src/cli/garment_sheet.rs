//! A contact sheet: garments on the body they were made for, by category, in rows of equally many.

use crate::picture::{BODY_COLOUR, Camera, Figure, Sheet, SheetRow, View, layer_colour, render_with_camera};
use clothcombo_data::asset::{Body, Category, Garment};
use image::RgbImage;

/// Most garments of a category.
pub const PER_CATEGORY: usize = 8;
/// Fewest and most garments in a row.
const COLUMNS: [usize; 2] = [4, 8];
/// Sides of one picture (pixels).
const CELL: [u32; 2] = [190, 200];

/// Up to [`PER_CATEGORY`] garments of each category, seen from the front left; as many of them as fill rows evenly.
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
        let camera = Camera::framing(&[frame], View::ThreeQuarter, CELL);
        cells.extend(of(category).map(|garment| {
            let figures = [
                Figure { positions: &body.template, faces: &body.faces, colour: BODY_COLOUR },
                Figure {
                    positions: garment.rest.positions(),
                    faces: garment.rest.faces(),
                    colour: layer_colour(category as usize),
                },
            ];
            (category, render_with_camera(&figures, &camera, CELL))
        }));
    }
    let columns = columns(cells.len());
    let rows = cells.chunks_exact(columns.max(1)).map(|row| {
        let mut names: Vec<String> =
            row.iter().map(|(category, _)| category.name().replace('_', " ")).collect();
        names.dedup();
        SheetRow {
            label: names.join(", "),
            legend: Vec::new(),
            cells: row.iter().map(|(_, picture)| picture.clone()).collect(),
        }
    });
    Sheet { rows: rows.collect(), ..Sheet::default() }.compose()
}

/// Garments in a row, of `count`: what shows most of them in full rows, and of that the widest.
fn columns(count: usize) -> usize {
    let [fewest, most] = COLUMNS;
    match count {
        _ if count <= most => count,
        _ => (fewest..=most).max_by_key(|columns| (count / columns * columns, *columns)).unwrap_or(most),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clothcombo_data::generate::{GarmentGenerator, GarmentSettings, mannequin};

    #[test]
    fn rows_are_full_and_leave_out_few() {
        let rows = |count: usize| (columns(count), count / columns(count));
        assert_eq!([1, 7, 8, 12, 48].map(rows), [(1, 1), (7, 1), (8, 1), (6, 2), (8, 6)]);
        assert_eq!(columns(0), 0);
        for count in 1..=48 {
            let (columns, rows) = rows(count);
            assert!(columns <= 8 && count - columns * rows <= 3, "{count}: {rows} rows of {columns}");
        }
    }

    #[test]
    fn every_cell_is_as_large_as_the_others() {
        let body = mannequin();
        let generator = GarmentGenerator::new(&body).unwrap();
        let settings = GarmentSettings { target_vertices: 300, ..GarmentSettings::default() };
        let garments =
            [Category::Trousers, Category::TShirt].map(|c| generator.generate(c, 3, &settings).unwrap());
        let [one, two] = [&garments[..1], &garments].map(|some| garment_sheet(&body, some).dimensions());
        assert_eq!((one.1, one.0 < two.0), (two.1, true));
        assert!(garment_sheet(&body, &[]).width() < CELL[0]);
    }
}
