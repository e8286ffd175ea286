//! Several pictures on one labelled sheet: a row per scene, a column per method and view.

use image::{Rgb, RgbImage};

use super::font::{CAPITAL_HEIGHT, draw_text, fitted, text_size};

const PAPER: Rgb<u8> = Rgb([250, 250, 249]);
const INK: Rgb<u8> = Rgb([52, 56, 62]);
const SCALE: u32 = 2;
/// Space around text and between cells [pixels].
const GAP: u32 = 8;
const LINE: u32 = CAPITAL_HEIGHT * SCALE + 2 * GAP;
/// Side of the colour patch of a legend entry [pixels].
const PATCH: u32 = CAPITAL_HEIGHT * SCALE;

/// A colour and what it stands for.
#[derive(Clone, Debug)]
pub struct LegendEntry {
    /// Colour of the figure.
    pub colour: [u8; 3],
    /// Name of the figure.
    pub name: String,
}

/// One scene: a line of text and its pictures.
#[derive(Clone, Debug, Default)]
pub struct SheetRow {
    /// What the scene is, for example pose and shape.
    pub label: String,
    /// Colours of body and garments in this scene.
    pub legend: Vec<LegendEntry>,
    /// Pictures from left to right, of any size.
    pub cells: Vec<RgbImage>,
}

/// A grid of pictures with a title and a heading per column.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// First line; none if empty.
    pub title: String,
    /// Headings; a row may have more or fewer cells.
    pub columns: Vec<String>,
    /// Scenes from top to bottom.
    pub rows: Vec<SheetRow>,
}

impl Sheet {
    /// Draws the sheet. Columns are as wide as their widest picture, rows as high as their highest one; a label too
    /// long for its place ends in an ellipsis. An empty sheet is a small empty picture.
    pub fn compose(&self) -> RgbImage {
        let column_count =
            self.rows.iter().map(|row| row.cells.len()).max().unwrap_or(0).max(self.columns.len());
        let widths: Vec<u32> = (0..column_count)
            .map(|column| self.rows.iter().filter_map(|row| row.cells.get(column)).map(RgbImage::width).max())
            .map(|width| width.unwrap_or(0).max(60))
            .collect();
        let heights: Vec<u32> =
            self.rows.iter().map(|row| row.cells.iter().map(RgbImage::height).max().unwrap_or(0)).collect();
        let title_height = if self.title.is_empty() { 0 } else { LINE };
        let heading_height = if self.columns.is_empty() { 0 } else { LINE };
        let width = GAP + widths.iter().map(|width| width + GAP).sum::<u32>();
        let height =
            GAP + title_height + heading_height + heights.iter().map(|h| LINE + h + GAP).sum::<u32>();
        let mut sheet = RgbImage::from_pixel(width, height, PAPER);

        let left = i64::from(GAP);
        let inner = width - 2 * GAP.min(width / 2);
        let mut top = GAP;
        if !self.title.is_empty() {
            draw_text(&mut sheet, [left, i64::from(top)], &fitted(&self.title, inner, SCALE), SCALE, INK);
            top += title_height;
        }
        let mut x = GAP;
        for (heading, &column_width) in self.columns.iter().zip(&widths) {
            let heading = fitted(heading, column_width, SCALE);
            let indent = (column_width - text_size(&heading, SCALE)[0].min(column_width)) / 2;
            draw_text(&mut sheet, [i64::from(x + indent), i64::from(top + GAP)], &heading, SCALE, INK);
            x += column_width + GAP;
        }
        top += heading_height;

        for (row, row_height) in self.rows.iter().zip(heights) {
            row.draw_label(&mut sheet, [GAP, top + GAP], inner);
            top += LINE;
            let mut x = GAP;
            for (cell, column_width) in row.cells.iter().zip(&widths) {
                let indent = (column_width - cell.width()) / 2;
                image::imageops::replace(&mut sheet, cell, i64::from(x + indent), i64::from(top));
                x += column_width + GAP;
            }
            top += row_height + GAP;
        }
        sheet
    }
}

impl SheetRow {
    /// The label, then as many legend entries as fit into `width` pixels.
    fn draw_label(&self, sheet: &mut RgbImage, [left, top]: [u32; 2], width: u32) {
        let label = fitted(&self.label, width, SCALE);
        draw_text(sheet, [i64::from(left), i64::from(top)], &label, SCALE, INK);
        let mut x = left + text_size(&label, SCALE)[0] + if label.is_empty() { 0 } else { 3 * GAP };
        for entry in &self.legend {
            let entry_width = PATCH + GAP + text_size(&entry.name, SCALE)[0];
            if x + entry_width > left + width {
                break;
            }
            for dy in 0..PATCH {
                for dx in 0..PATCH {
                    if let Some(pixel) = sheet.get_pixel_mut_checked(x + dx, top + dy) {
                        *pixel = Rgb(entry.colour);
                    }
                }
            }
            draw_text(sheet, [i64::from(x + PATCH + GAP), i64::from(top)], &entry.name, SCALE, INK);
            x += entry_width + 3 * GAP;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: Rgb<u8> = Rgb([10, 200, 30]);

    fn count(picture: &RgbImage, colour: Rgb<u8>) -> usize {
        picture.pixels().filter(|pixel| **pixel == colour).count()
    }

    #[test]
    fn every_cell_is_whole_on_the_sheet_and_labels_do_not_cover_it() {
        let cell = |width, height| RgbImage::from_pixel(width, height, CELL);
        let legend = vec![LegendEntry { colour: [1, 2, 3], name: "skirt".into() }];
        let sheet = Sheet {
            title: "step 100".into(),
            columns: vec!["LBS".into(), "a heading too long for its column".into()],
            rows: vec![
                SheetRow { label: "a".into(), legend, cells: vec![cell(120, 40), cell(30, 70)] },
                SheetRow { label: String::new(), legend: vec![], cells: vec![cell(50, 50)] },
            ],
        };
        let picture = sheet.compose();
        assert_eq!(count(&picture, CELL), 120 * 40 + 30 * 70 + 50 * 50);
        assert_eq!(count(&picture, Rgb([1, 2, 3])), (PATCH * PATCH) as usize);
        assert!(count(&picture, INK) > 100);
    }

    #[test]
    fn a_legend_that_does_not_fit_is_left_out_and_emptiness_is_drawn() {
        let entry = LegendEntry { colour: [1, 2, 3], name: "a very long name of a garment".into() };
        let row = SheetRow { label: "scene".into(), legend: vec![entry], cells: vec![RgbImage::new(90, 20)] };
        let picture = Sheet { rows: vec![row], ..Sheet::default() }.compose();
        assert_eq!(count(&picture, Rgb([1, 2, 3])), 0);
        assert_eq!(count(&Sheet::default().compose(), INK), 0);
        let only_labels = Sheet { title: "t".into(), columns: vec![], rows: vec![SheetRow::default()] };
        assert!(only_labels.compose().width() > 0);
    }
}
