//! Several pictures on one labelled sheet: a row per scene, a column per method and view.

use image::{Rgb, RgbImage};
use std::fmt::Write;

use super::svg::{css_colour, draw_elements, fitted, text_width, write_text};

const SHEET_PAPER: Rgb<u8> = Rgb([250, 250, 249]);
/// Space around text and between cells (pixels).
const GAP: u32 = 8;
/// Font size, height of capitals and of a line (pixels).
const TEXT: f64 = 18.0;
const CAPITAL: u32 = 14;
const SHEET_LINE: u32 = CAPITAL + 2 * GAP;

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
pub struct PictureSheet {
    /// First line; none if empty.
    pub title: String,
    /// Headings; a row may have more or fewer cells.
    pub columns: Vec<String>,
    /// Scenes from top to bottom.
    pub rows: Vec<SheetRow>,
}

impl PictureSheet {
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
        let title_height = if self.title.is_empty() { 0 } else { SHEET_LINE };
        let heading_height = if self.columns.is_empty() { 0 } else { SHEET_LINE };
        let width = GAP + widths.iter().map(|width| width + GAP).sum::<u32>();
        let height =
            GAP + title_height + heading_height + heights.iter().map(|h| SHEET_LINE + h + GAP).sum::<u32>();
        let mut sheet = RgbImage::from_pixel(width, height, SHEET_PAPER);

        let mut labels = String::new();
        let left = f64::from(GAP);
        let inner = f64::from(width) - 2.0 * left;
        let mut top = GAP;
        if !self.title.is_empty() {
            let title = fitted(&self.title, inner, TEXT);
            write_text(&mut labels, "label", [left, f64::from(top + CAPITAL)], TEXT, &title);
            top += title_height;
        }
        let mut x = GAP;
        for (heading, &column_width) in self.columns.iter().zip(&widths) {
            let heading = fitted(heading, f64::from(column_width), TEXT);
            let middle = f64::from(x) + 0.5 * f64::from(column_width);
            write_text(&mut labels, "heading", [middle, f64::from(top + GAP + CAPITAL)], TEXT, &heading);
            x += column_width + GAP;
        }
        top += heading_height;

        for (row, row_height) in self.rows.iter().zip(heights) {
            row.write_label(&mut labels, [left, f64::from(top + GAP)], inner);
            top += SHEET_LINE;
            let mut x = GAP;
            for (cell, column_width) in row.cells.iter().zip(&widths) {
                let indent = (column_width - cell.width()) / 2;
                image::imageops::replace(&mut sheet, cell, i64::from(x + indent), i64::from(top));
                x += column_width + GAP;
            }
            top += row_height + GAP;
        }
        draw_elements(&mut sheet, &labels, 1.0);
        sheet
    }
}

impl SheetRow {
    /// The label, then as many legend entries as fit into `width` pixels.
    fn write_label(&self, labels: &mut String, [left, top]: [f64; 2], width: f64) {
        let [gap, patch] = [GAP, CAPITAL].map(f64::from);
        let baseline = top + patch;
        let label = fitted(&self.label, width, TEXT);
        write_text(labels, "label", [left, baseline], TEXT, &label);
        let mut x =
            (left + text_width(&label, TEXT) + if label.is_empty() { 0.0 } else { 3.0 * gap }).round();
        for LegendEntry { colour, name } in &self.legend {
            let entry_width = patch + gap + text_width(name, TEXT);
            if x + entry_width > left + width {
                break;
            }
            let fill = css_colour(*colour);
            let square = format!("M{x} {top}h{patch}v{patch}h-{patch}Z");
            let _ = write!(labels, r#"<path class="patch" fill="{fill}" d="{square}"/>"#);
            write_text(labels, "label", [x + patch + gap, baseline], TEXT, name);
            x = (x + entry_width + 3.0 * gap).round();
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
        let sheet = PictureSheet {
            title: "step 100".into(),
            columns: vec!["LBS".into(), "a heading too long for its column".into()],
            rows: vec![
                SheetRow { label: "a".into(), legend, cells: vec![cell(120, 40), cell(30, 70)] },
                SheetRow { label: String::new(), legend: vec![], cells: vec![cell(50, 50)] },
            ],
        };
        let picture = sheet.compose();
        assert_eq!(count(&picture, CELL), 120 * 40 + 30 * 70 + 50 * 50);
        assert_eq!(count(&picture, Rgb([1, 2, 3])), (CAPITAL * CAPITAL) as usize);
        assert!(picture.pixels().filter(|p| p.0[0] < 70 && p.0[2] > p.0[0]).count() > 100, "text");
    }

    #[test]
    fn a_legend_that_does_not_fit_is_left_out_and_emptiness_is_drawn() {
        let entry = LegendEntry { colour: [1, 2, 3], name: "a very long name of a garment".into() };
        let row = SheetRow { label: "scene".into(), legend: vec![entry], cells: vec![RgbImage::new(90, 20)] };
        let picture = PictureSheet { rows: vec![row], ..PictureSheet::default() }.compose();
        assert_eq!(count(&picture, Rgb([1, 2, 3])), 0);
        let empty = PictureSheet::default().compose();
        assert_eq!(count(&empty, SHEET_PAPER), (empty.width() * empty.height()) as usize);
        let only_labels =
            PictureSheet { title: "t".into(), columns: vec![], rows: vec![SheetRow::default()] };
        assert!(only_labels.compose().width() > 0);
    }
}
