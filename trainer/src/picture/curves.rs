//! Loss curves of a run as one picture: a panel per series.

use image::{Rgb, RgbImage};
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::Circle;
use plotters::series::{DashedLineSeries, LineSeries};
use plotters::style::{Color, FontFamily, IntoFont, RGBColor, ShapeStyle};

use super::PictureError;
use super::axis::{Axis, DRAWABLE_LIMIT, number_text};
use super::canvas::Canvas;
use super::font::{CAPITAL_HEIGHT, draw_text, fitted, text_size};

/// Everything is drawn this much larger and then averaged, because `plotters` places lines on whole pixels.
const OVERSAMPLING: u32 = 2;
/// Size of a panel in the finished picture [pixels].
const PANEL: [u32; 2] = [560, 320];
const HEADER_HEIGHT: u32 = 64;
/// Dot sizes of text before averaging.
const TEXT: u32 = 4;
const SMALL_TEXT: u32 = 3;

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([44, 48, 54]);
const FAINT_INK: Rgb<u8> = Rgb([120, 126, 134]);
const GRID: RGBColor = RGBColor(228, 231, 235);
const FRAME: RGBColor = RGBColor(150, 155, 162);
const CURVE: RGBColor = RGBColor(36, 84, 148);
const POINTS: RGBColor = RGBColor(150, 186, 224);
const BASELINE: RGBColor = RGBColor(214, 104, 36);
const STAGE: RGBColor = RGBColor(140, 120, 160);

/// Raw points drawn at most per panel, and points of the smoothed curve.
const RAW_LIMIT: usize = 4000;
const CURVE_POINTS: usize = 500;

/// One quantity over the steps of a run.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name, for example of an energy term.
    pub name: String,
    /// Unit shown in brackets; empty for none.
    pub unit: String,
    /// (step, value) in any order; points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
    /// The same quantity for linear blend skinning alone, drawn as a dashed line.
    pub baseline: Option<f64>,
}

/// Where a stage of the schedule begins.
#[derive(Clone, Debug)]
pub struct StageBoundary {
    /// First step of the stage.
    pub step: f64,
    /// Name of the stage.
    pub name: String,
}

/// Draws a panel per series, each with its own vertical axis (logarithmic where no value is negative and they spread
/// widely) and a common horizontal axis of steps: raw points, their moving median, the baseline, stage boundaries, and
/// the latest median beside the name. No series gives a picture that says so.
///
/// # Errors
/// [`PictureError::Plot`] if the plotting library refuses a panel.
pub fn draw_curves(
    title: &str,
    series: &[Series],
    stages: &[StageBoundary],
) -> Result<RgbImage, PictureError> {
    let columns = match series.len() {
        0 | 1 => 1,
        2 | 4 => 2,
        _ => 3,
    };
    let rows = series.len().div_ceil(columns).max(1);
    let panel = PANEL.map(|side| side * OVERSAMPLING);
    let header = HEADER_HEIGHT * OVERSAMPLING;
    let size = [panel[0] * columns as u32, panel[1] * rows as u32 + header];
    let mut picture = RgbImage::from_pixel(size[0], size[1], PAPER);
    draw_header(&mut picture, title);
    if series.is_empty() {
        draw_text(&mut picture, [32, i64::from(header) + 40], "no series", TEXT, FAINT_INK);
    }

    let steps = step_axis(series, stages);
    for (index, series) in series.iter().enumerate() {
        let column = (index % columns) as u32;
        let row = (index / columns) as u32;
        let origin = [column * panel[0], header + row * panel[1]];
        Panel::new(series).draw(&mut picture, origin, &steps, stages)?;
    }
    Ok(image::imageops::thumbnail(&picture, size[0] / OVERSAMPLING, size[1] / OVERSAMPLING))
}

/// Title and the meaning of the marks.
fn draw_header(picture: &mut RgbImage, title: &str) {
    let width = picture.width();
    draw_text(picture, [32, 22], &fitted(title, width.saturating_sub(64), TEXT), TEXT, INK);
    let marks: [(&str, RGBColor, u32); 4] = [
        ("step", POINTS, 1),
        ("moving median", CURVE, 3),
        ("LBS alone", BASELINE, 2),
        ("stage begins", STAGE, 2),
    ];
    let mut x = 32;
    for (name, RGBColor(red, green, blue), style) in marks {
        for dx in 0..44_u32 {
            // Points, a line and dashes, as in the panels.
            let is_inked = match style {
                1 => dx % 16 < 6,
                2 => dx % 16 < 10,
                _ => true,
            };
            for dy in 0..6 {
                if is_inked && let Some(pixel) = picture.get_pixel_mut_checked(x + dx, 86 + dy) {
                    *pixel = Rgb([red, green, blue]);
                }
            }
        }
        draw_text(picture, [i64::from(x + 56), 78], name, SMALL_TEXT, FAINT_INK);
        x += 56 + text_size(name, SMALL_TEXT)[0] + 48;
    }
}

/// The common axis of steps.
fn step_axis(series: &[Series], stages: &[StageBoundary]) -> Axis {
    let mut low = f64::INFINITY;
    let mut high = f64::NEG_INFINITY;
    let steps = series.iter().flat_map(|series| series.points.iter().map(|point| point.0));
    for step in steps.chain(stages.iter().map(|stage| stage.step)).filter(|step| is_drawable(*step)) {
        low = low.min(step);
        high = high.max(step);
    }
    if low > high { Axis::linear(0.0, 1.0) } else { Axis::linear(low, high) }
}

fn is_drawable(value: f64) -> bool {
    value.abs() < DRAWABLE_LIMIT
}

/// A series ready to draw.
struct Panel<'a> {
    series: &'a Series,
    /// Drawable points by step.
    points: Vec<(f64, f64)>,
    median: Vec<(f64, f64)>,
    values: Axis,
}

impl<'a> Panel<'a> {
    fn new(series: &'a Series) -> Self {
        let drawable = |point: &&(f64, f64)| is_drawable(point.0) && is_drawable(point.1);
        let mut points: Vec<(f64, f64)> = series.points.iter().filter(drawable).copied().collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let median = moving_median(&points);

        // Single outliers must not press the curve flat: the axis shows the middle 98 % of the raw points.
        let mut ordered: Vec<f64> = points.iter().map(|point| point.1).collect();
        ordered.sort_by(f64::total_cmp);
        let cut = ordered.len() / 100;
        let shown = ordered.get(cut..ordered.len() - cut).unwrap_or_default();
        let baseline = series.baseline.filter(|value| is_drawable(*value));
        let extremes = shown.iter().copied().chain(median.iter().map(|point| point.1)).chain(baseline);
        Self { series, values: Axis::fitting(extremes), points, median }
    }

    fn draw(
        &self,
        picture: &mut RgbImage,
        origin: [u32; 2],
        steps: &Axis,
        stages: &[StageBoundary],
    ) -> Result<(), PictureError> {
        let size = PANEL.map(|side| side * OVERSAMPLING);
        let title_height = 56;
        self.draw_title(picture, [origin[0] + 32, origin[1] + 8], size[0] - 64);
        let refused = |reason: String| PictureError::Plot { series: self.series.name.clone(), reason };
        let area = Canvas::new(picture)
            .into_drawing_area()
            .shrink((origin[0], origin[1] + title_height), (size[0], size[1] - title_height));
        self.draw_chart(&area, steps, stages).map_err(refused)?;
        drop(area);
        if self.points.is_empty() {
            let middle = [origin[0] + size[0] / 2 - 90, origin[1] + size[1] / 2];
            draw_text(picture, middle.map(i64::from), "no values", TEXT, FAINT_INK);
        }
        Ok(())
    }

    /// Name and unit on the left; the latest median and its ratio to the baseline on the right.
    fn draw_title(&self, picture: &mut RgbImage, [left, top]: [u32; 2], width: u32) {
        let Series { name, unit, baseline, .. } = self.series;
        let latest = self.median.last().map(|&(_, value)| {
            let text = number_text(value, 3);
            match baseline {
                Some(baseline) if *baseline > 0.0 && value >= 0.0 => {
                    format!("{text} = {} × LBS", number_text(value / baseline, 2))
                }
                _ => text,
            }
        });
        let latest = latest.unwrap_or_default();
        let latest_width = text_size(&latest, SMALL_TEXT)[0];
        let name = if unit.is_empty() { name.clone() } else { format!("{name} [{unit}]") };
        let name = fitted(&name, width.saturating_sub(latest_width + 24), TEXT);
        draw_text(picture, [left, top].map(i64::from), &name, TEXT, INK);
        let right = left + width.saturating_sub(latest_width);
        draw_text(picture, [right, top + 4].map(i64::from), &latest, SMALL_TEXT, FAINT_INK);
    }

    fn draw_chart(
        &self,
        area: &DrawingArea<Canvas<'_>, Shift>,
        steps: &Axis,
        stages: &[StageBoundary],
    ) -> Result<(), String> {
        let mut chart = ChartBuilder::on(area)
            .margin_right(36)
            .margin_bottom(20)
            .x_label_area_size(48)
            .y_label_area_size(140)
            .build_cartesian_2d(steps.clone(), self.values.clone())
            .map_err(|error| error.to_string())?;
        let font = (FontFamily::Monospace, f64::from(CAPITAL_HEIGHT * SMALL_TEXT)).into_font();
        let Rgb([red, green, blue]) = FAINT_INK;
        chart
            .configure_mesh()
            .x_labels(8)
            .y_labels(7)
            .max_light_lines(0)
            .bold_line_style(GRID.stroke_width(2))
            .light_line_style(GRID.stroke_width(1))
            .axis_style(FRAME.stroke_width(2))
            .set_all_tick_mark_size(8)
            .label_style(font.color(&RGBColor(red, green, blue)))
            .x_label_formatter(&|step| step_text(*step))
            .draw()
            .map_err(|error| error.to_string())?;
        self.draw_marks(&mut chart, steps, stages).map_err(|error| error.to_string())
    }

    fn draw_marks(
        &self,
        chart: &mut ChartContext<'_, Canvas<'_>, Cartesian2d<Axis, Axis>>,
        steps: &Axis,
        stages: &[StageBoundary],
    ) -> Result<(), plotters::drawing::DrawingAreaErrorKind<std::convert::Infallible>> {
        use plotters::coord::ranged1d::Ranged;
        let (low, high) = (self.values.range().start, self.values.range().end);
        let stride = self.points.len().div_ceil(RAW_LIMIT).max(1);
        chart.draw_series(self.points.iter().step_by(stride).map(|&(step, value)| {
            Circle::new((step, self.values.clamped(value)), 2, ShapeStyle::from(POINTS.mix(0.55)).filled())
        }))?;
        for stage in stages.iter().filter(|stage| is_drawable(stage.step)) {
            let line = [(stage.step, low), (stage.step, high)];
            chart.draw_series(DashedLineSeries::new(line, 6, 6, STAGE.stroke_width(2)))?;
            let (x, y) = chart.backend_coord(&(stage.step, high));
            let room = chart.backend_coord(&(steps.range().end, high)).0 - x - 12;
            let name = fitted(&stage.name, room.max(0) as u32, SMALL_TEXT);
            // A stage that begins at the right edge has no room for its name there.
            if name.chars().count() > 2 || name == stage.name {
                let font = (FontFamily::Monospace, f64::from(CAPITAL_HEIGHT * SMALL_TEXT)).into_font();
                chart.plotting_area().strip_coord_spec().draw_text(
                    &name,
                    &font.color(&STAGE),
                    self.relative(chart, (x + 10, y + 8)),
                )?;
            }
        }
        if let Some(baseline) = self.series.baseline.filter(|value| is_drawable(*value)) {
            let line = [(steps.range().start, baseline), (steps.range().end, baseline)];
            chart.draw_series(DashedLineSeries::new(line, 16, 10, BASELINE.stroke_width(4)))?;
        }
        chart.draw_series(LineSeries::new(
            self.median.iter().map(|&(step, value)| (step, self.values.clamped(value))),
            CURVE.stroke_width(4),
        ))?;
        Ok(())
    }

    /// Position in the plotting area of a position in the picture.
    fn relative(
        &self,
        chart: &ChartContext<'_, Canvas<'_>, Cartesian2d<Axis, Axis>>,
        (x, y): (i32, i32),
    ) -> (i32, i32) {
        let (left, top) = chart.plotting_area().get_base_pixel();
        (x - left, y - top)
    }
}

/// Median over a window of a fortieth of the points (five at least) at up to [`CURVE_POINTS`] evenly spaced points.
fn moving_median(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let half = (points.len() / 80).max(2);
    let count = points.len().min(CURVE_POINTS);
    let mut window = Vec::new();
    (0..count)
        .filter_map(|k| {
            let centre = if count > 1 { k * (points.len() - 1) / (count - 1) } else { 0 };
            // At the ends the window is cut, not shrunk: the latest value must not be a single raw point.
            let (first, last) = (centre.saturating_sub(half), (centre + half).min(points.len() - 1));
            window.clear();
            window.extend(points.get(first..=last)?.iter().map(|point| point.1));
            let middle = window.len() / 2;
            let (_, median, _) = window.select_nth_unstable_by(middle, f64::total_cmp);
            Some((points.get(centre)?.0, *median))
        })
        .collect()
}

/// Steps in a few characters: 500, 1.5k, 200k, 1M.
fn step_text(step: f64) -> String {
    let (value, unit) = match step.abs() {
        size if size >= 1e6 => (step / 1e6, "M"),
        size if size >= 1e4 => (step / 1e3, "k"),
        _ => (step, ""),
    };
    format!("{}{unit}", number_text(value, 4))
}

#[cfg(test)]
mod tests;
