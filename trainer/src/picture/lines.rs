//! Measured quantities over a size, several lines to a panel.

use image::{Rgb, RgbImage};
use plotters::chart::ChartBuilder;
use plotters::drawing::IntoDrawingArea;
use plotters::element::Circle;
use plotters::series::LineSeries;
use plotters::style::{Color, FontFamily, IntoFont, RGBColor, ShapeStyle};

use super::PictureError;
use super::axis::{Axis, DRAWABLE_LIMIT, number_text};
use super::canvas::Canvas;
use super::font::{CAPITAL_HEIGHT, draw_text, fitted, text_size};
use super::palette::layer_colour;

/// Everything is drawn this much larger and then averaged, because `plotters` places lines on whole pixels.
const OVERSAMPLING: u32 = 2;
/// Size of a panel in the finished picture [pixels].
const PANEL: [u32; 2] = [560, 380];
const HEADER: u32 = 64;
/// Height above the chart for a panel's title and its lines' names, before averaging.
const TITLE: u32 = 60;
const LINE: u32 = 30;
const TEXT: u32 = 4;
const SMALL_TEXT: u32 = 3;
const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([44, 48, 54]);
const FAINT_INK: Rgb<u8> = Rgb([120, 126, 134]);
const GRID: RGBColor = RGBColor(228, 231, 235);
const FRAME: RGBColor = RGBColor(150, 155, 162);

/// One measured quantity.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// What it is, with its unit.
    pub name: String,
    /// (size, value); points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// A chart of several quantities over one size; both axes are logarithmic where their values spread widely.
#[derive(Clone, Debug, Default)]
pub struct LinePanel {
    /// What is on the horizontal axis.
    pub title: String,
    /// The quantities; their values share the vertical axis.
    pub lines: Vec<Line>,
}

/// Draws the panels two to a row under a title.
///
/// # Errors
/// [`PictureError::Plot`] if the plotting library refuses a panel.
pub fn draw_lines(title: &str, panels: &[LinePanel]) -> Result<RgbImage, PictureError> {
    let columns = panels.len().clamp(1, 2) as u32;
    let rows = (panels.len() as u32).div_ceil(columns).max(1);
    let [width, height] = PANEL.map(|side| side * OVERSAMPLING);
    let size = [width * columns, height * rows + HEADER];
    let mut picture = RgbImage::from_pixel(size[0], size[1], PAPER);
    draw_text(&mut picture, [32, 22], &fitted(title, size[0] - 64, TEXT), TEXT, INK);
    for (index, panel) in (0..).zip(panels) {
        let origin = [index % columns * width, index / columns * height + HEADER];
        panel
            .draw(&mut picture, origin, [width, height])
            .map_err(|reason| PictureError::Plot { series: panel.title.clone(), reason })?;
    }
    Ok(image::imageops::thumbnail(&picture, size[0] / OVERSAMPLING, size[1] / OVERSAMPLING))
}

impl LinePanel {
    fn draw(
        &self,
        picture: &mut RgbImage,
        [left, top]: [u32; 2],
        [width, height]: [u32; 2],
    ) -> Result<(), String> {
        draw_text(
            picture,
            [left + 32, top + 8].map(i64::from),
            &fitted(&self.title, width - 64, TEXT),
            TEXT,
            INK,
        );
        for (line, index) in self.lines.iter().zip(0..) {
            let y = top + TITLE + index * LINE;
            for (dx, dy) in (0..40).flat_map(|dx| (0..6).map(move |dy| (dx, dy))) {
                if let Some(pixel) = picture.get_pixel_mut_checked(left + 40 + dx, y + 8 + dy) {
                    *pixel = Rgb(layer_colour(index as usize));
                }
            }
            let name = fitted(&line.name, width - 160, SMALL_TEXT);
            draw_text(picture, [left + 92, y].map(i64::from), &name, SMALL_TEXT, FAINT_INK);
        }
        let above = TITLE + LINE * self.lines.len() as u32 + 8;
        let drawable = |point: &&(f64, f64)| point.0.abs() < DRAWABLE_LIMIT && point.1.abs() < DRAWABLE_LIMIT;
        let points = || self.lines.iter().flat_map(|line| line.points.iter().filter(drawable));
        if points().next().is_none() {
            let name = "no values";
            let x = left + (width - text_size(name, TEXT)[0]) / 2;
            draw_text(picture, [x, top + height / 2].map(i64::from), name, TEXT, FAINT_INK);
            return Ok(());
        }
        let horizontal = Axis::fitting(points().map(|point| point.0));
        let vertical = Axis::fitting(points().map(|point| point.1));
        let area =
            Canvas::new(picture).into_drawing_area().shrink((left, top + above), (width, height - above));
        let mut chart = ChartBuilder::on(&area)
            .margin_right(36)
            .margin_bottom(20)
            .x_label_area_size(48)
            .y_label_area_size(140)
            .build_cartesian_2d(horizontal, vertical)
            .map_err(|error| error.to_string())?;
        let font = (FontFamily::Monospace, f64::from(CAPITAL_HEIGHT * SMALL_TEXT)).into_font();
        let Rgb([red, green, blue]) = FAINT_INK;
        chart
            .configure_mesh()
            .x_labels(7)
            .y_labels(7)
            .max_light_lines(0)
            .bold_line_style(GRID.stroke_width(2))
            .light_line_style(GRID.stroke_width(1))
            .axis_style(FRAME.stroke_width(2))
            .set_all_tick_mark_size(8)
            .label_style(font.color(&RGBColor(red, green, blue)))
            .x_label_formatter(&|size| number_text(*size, 3))
            .draw()
            .map_err(|error| error.to_string())?;
        for (line, index) in self.lines.iter().zip(0..) {
            let [red, green, blue] = layer_colour(index);
            let colour = RGBColor(red, green, blue);
            let points: Vec<(f64, f64)> = line.points.iter().filter(drawable).copied().collect();
            let marks = points.iter().map(|&point| Circle::new(point, 7, ShapeStyle::from(colour).filled()));
            chart.draw_series(marks).map_err(|error| error.to_string())?;
            chart
                .draw_series(LineSeries::new(points.clone(), colour.stroke_width(4)))
                .map_err(|error| error.to_string())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_drawn_in_its_colour_and_emptiness_is_said() {
        let line = |factor: f64| Line {
            name: format!("{factor} ms"),
            points: vec![(1e3, factor), (2e3, 2.0 * factor), (2e4, 20.0 * factor), (f64::NAN, 1.0)],
        };
        let full = LinePanel { title: "vertices".into(), lines: vec![line(1.0), line(3.0)] };
        let picture = draw_lines("growth", &[full, LinePanel::default()]).unwrap();
        assert_eq!(picture.dimensions(), (2 * PANEL[0], PANEL[1] + HEADER / OVERSAMPLING));
        for index in 0..2 {
            let colour = Rgb(layer_colour(index));
            let right: usize =
                picture.enumerate_pixels().filter(|(x, y, p)| *x > 150 && *y > 130 && **p == colour).count();
            assert!(right > 100, "line {index}: {right} pixels");
        }
    }
}
