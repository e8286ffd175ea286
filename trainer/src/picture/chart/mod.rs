//! Charts as SVG: inline in a page, or drawn as a picture.

pub(crate) mod axis;
mod lines;
mod steps;

pub use lines::ChartLine;
pub(crate) use steps::median_of_last;
pub use steps::{Baseline, RunSteps, StageBoundary};

use super::svg::{draw_elements, escape, fitted, text_width, write_text};
use axis::ChartAxis;
use image::{Rgb, RgbImage};
use std::fmt::Write;

/// Width and height of a chart; all lengths are in its units.
const SIZE: [f64; 2] = [350.0, 200.0];
/// Pixels per unit in a picture.
const SCALE: f64 = 1.6;
/// Space around the axes.
const LEFT: f64 = 46.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 22.0;
/// Space between the edge and text.
const INSET: f64 = 8.0;
/// Space for the title of an axis.
const AXIS_TITLE: f64 = 13.0;
/// Font sizes, and the height of a line.
const TITLE_SIZE: f64 = 12.0;
const TEXT_SIZE: f64 = 10.0;
const LINE_HEIGHT: f64 = 15.0;
/// Ticks of an axis, at most about.
const TICKS: usize = 7;

const CHART_PAPER: Rgb<u8> = Rgb([255; 3]);

/// A chart: a title, a legend, two axes and marks.
pub struct Chart {
    title: String,
    unit: String,
    /// Where the marks end, as SVG text.
    latest: String,
    axes: [ChartAxis; 2],
    /// Below the horizontal axis and beside the vertical one; none if empty.
    axis_titles: [String; 2],
    legend: Vec<LegendKey>,
    /// Where the vertical axis ends.
    top: f64,
    /// Where the axes meet.
    origin: [f64; 2],
    marks: String,
}

impl Chart {
    fn new(title: &str, unit: &str, axes: [ChartAxis; 2], legend: Vec<LegendKey>) -> Self {
        let top = TOP + legend_height(&legend, SIZE[0]);
        let [title, unit] = [title, unit].map(str::to_owned);
        let (latest, axis_titles, marks) = (String::new(), [const { String::new() }; 2], String::new());
        Self { title, unit, latest, axes, axis_titles, legend, top, origin: [LEFT, SIZE[1] - BOTTOM], marks }
    }

    /// The same with titles of the axes, before anything is drawn.
    fn with_axis_titles(self, titles: [&str; 2]) -> Self {
        let origin = [LEFT + AXIS_TITLE, SIZE[1] - BOTTOM - AXIS_TITLE];
        Self { axis_titles: titles.map(str::to_owned), origin, ..self }
    }

    /// Where a point stands; one outside the axes stands at their ends.
    fn place(&self, (x, y): (f64, f64)) -> [f64; 2] {
        let (right, [left, bottom]) = (SIZE[0] - RIGHT, self.origin);
        let [x, y] = [self.axes[0].share(x), self.axes[1].share(y)];
        [left + x * (right - left), bottom - y * (bottom - self.top)]
    }

    /// Adds a line through `points` with the given attributes.
    fn line(&mut self, attributes: &str, points: &[(f64, f64)]) {
        let path = self.path(points.iter());
        let _ = write!(self.marks, r#"<path {attributes} d="{path}"/>"#);
    }

    /// Adds the area between two lines.
    fn area(&mut self, attributes: &str, upper: &[(f64, f64)], lower: &[(f64, f64)]) {
        if !upper.is_empty() {
            let path = self.path(upper.iter().chain(lower.iter().rev()));
            let _ = write!(self.marks, r#"<path {attributes} d="{path}Z"/>"#);
        }
    }

    fn path<'a>(&self, points: impl Iterator<Item = &'a (f64, f64)>) -> String {
        let places = points.map(|&point| self.place(point)).enumerate();
        places.map(|(i, [x, y])| format!("{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" })).collect()
    }

    /// As an element of a page.
    pub fn svg(&self) -> String {
        element(SIZE, &self.title, &self.elements())
    }

    fn elements(&self) -> String {
        let mut svg = String::new();
        let (right, [left, bottom]) = (SIZE[0] - RIGHT, self.origin);
        let [x, y] = &self.axes;
        for tick in y.ticks(TICKS) {
            let at = bottom - y.share(tick) * (bottom - self.top);
            let _ = write!(svg, r#"<path class="grid" d="M{left} {at:.1}H{right}"/>"#);
            write_text(&mut svg, "y", [left - 6.0, at + 3.5], TEXT_SIZE, &y.label(tick));
        }
        for tick in x.ticks(TICKS) {
            let at = left + x.share(tick) * (right - left);
            let _ = write!(svg, r#"<path class="grid" d="M{at:.1} {}V{bottom}"/>"#, self.top);
            write_text(&mut svg, "x", [at, bottom + 14.0], TEXT_SIZE, &x.label(tick));
        }
        let _ = write!(svg, r#"<path class="frame" d="M{left} {}V{bottom}H{right}"/>"#, self.top);
        let [below, beside] = &self.axis_titles;
        let middle = [0.5 * (left + right), 0.5 * (self.top + bottom)];
        if !below.is_empty() {
            write_text(&mut svg, "x", [middle[0], SIZE[1] - 6.0], TEXT_SIZE, below);
        }
        if !beside.is_empty() {
            let _ = write!(svg, r#"<g transform="translate({INSET} {:.1}) rotate(-90)">"#, middle[1]);
            write_text(&mut svg, "x", [0.0, 6.0], TEXT_SIZE, beside);
            svg += "</g>";
        }
        svg += &self.marks;
        let unit = if self.unit.is_empty() { String::new() } else { format!("({})", self.unit) };
        let after =
            format!(r#"<tspan class="unit" dx="4" font-size="{TEXT_SIZE}">{}</tspan>"#, escape(&unit));
        let _ = write!(
            svg,
            r#"<text class="title" x="{INSET}" y="16" font-size="{TITLE_SIZE}">{}{after}</text>"#,
            escape(&self.title)
        );
        let _ = write!(
            svg,
            r#"<text class="latest" x="{right}" y="16" font-size="{TEXT_SIZE}">{}</text>"#,
            self.latest
        );
        svg + &legend(&self.legend, [INSET, TOP], SIZE[0])
    }
}

/// What a mark stands for.
pub struct LegendKey {
    /// A sample of the mark.
    swatch: String,
    /// What it stands for.
    pub name: String,
}

impl LegendKey {
    /// Width and height of a swatch.
    const SWATCH: [f64; 2] = [20.0, 10.0];

    fn line(attributes: &str, name: &str) -> Self {
        Self { swatch: format!(r#"<path {attributes} d="M0 5h20"/>"#), name: name.to_owned() }
    }

    fn area(attributes: &str, name: &str) -> Self {
        Self { swatch: format!(r#"<path {attributes} d="M0 0h20v10h-20Z"/>"#), name: name.to_owned() }
    }

    /// The swatch as an element of a page.
    fn svg(&self) -> String {
        element(Self::SWATCH, &self.name, &self.swatch)
    }
}

/// Keys as elements of a page.
pub(crate) fn legend_html(keys: &[LegendKey]) -> String {
    keys.iter().map(|key| format!("<span>{}{}</span> ", key.svg(), escape(&key.name))).collect()
}

/// Corners of the swatches of a legend as wide as `width`, relative to the first, with a margin on both sides.
fn legend_places(keys: &[LegendKey], width: f64) -> Vec<[f64; 2]> {
    let [mut x, mut y] = [0.0; 2];
    keys.iter()
        .map(|key| {
            let own = LegendKey::SWATCH[0] + 5.0 + text_width(&key.name, TEXT_SIZE);
            if x > 0.0 && x + own > width - 2.0 * INSET {
                [x, y] = [0.0, y + LINE_HEIGHT];
            }
            x += own + 14.0;
            [x - own - 14.0, y]
        })
        .collect()
}

fn legend_height(keys: &[LegendKey], width: f64) -> f64 {
    legend_places(keys, width).last().map_or(0.0, |[_, y]| y + LINE_HEIGHT + 4.0)
}

fn legend(keys: &[LegendKey], [left, top]: [f64; 2], width: f64) -> String {
    let mut svg = String::new();
    for (LegendKey { swatch, name }, [x, y]) in keys.iter().zip(legend_places(keys, width)) {
        let _ = write!(svg, r#"<g transform="translate({:.1} {})">{swatch}"#, left + x, top + y);
        write_text(&mut svg, "key", [LegendKey::SWATCH[0] + 5.0, 8.5], TEXT_SIZE, name);
        svg += "</g>";
    }
    svg
}

fn element([width, height]: [f64; 2], label: &str, elements: &str) -> String {
    format!(
        r#"<svg viewBox="0 0 {width} {height}" role="img" aria-label="{}">{elements}</svg>"#,
        escape(label)
    )
}

/// Charts side by side under a title and the legend that they share.
pub struct ChartGrid {
    /// Above the charts.
    pub title: String,
    /// Under the title.
    pub legend: Vec<LegendKey>,
    /// From left to right, then from top to bottom.
    pub charts: Vec<Chart>,
}

impl ChartGrid {
    /// As elements of a page, which puts as many charts side by side as it has space for.
    pub fn html(&self) -> String {
        let figures: String =
            self.charts.iter().map(|chart| format!("<figure>{}</figure>", chart.svg())).collect();
        format!("<p class=\"legend\">{}</p><div class=\"grid-of\">{figures}</div>", legend_html(&self.legend))
    }

    /// As a picture.
    pub fn draw(&self) -> RgbImage {
        let [width, height] = self.size().map(|side| (SCALE * side).round() as u32);
        let mut picture = RgbImage::from_pixel(width, height, CHART_PAPER);
        draw_elements(&mut picture, &self.elements(), SCALE as f32);
        picture
    }

    fn columns(&self) -> usize {
        match self.charts.len() {
            0 | 1 => 1,
            2 | 4 => 2,
            _ => 3,
        }
    }

    fn header(&self) -> f64 {
        26.0 + legend_height(&self.legend, SIZE[0] * self.columns() as f64)
    }

    fn size(&self) -> [f64; 2] {
        let columns = self.columns();
        let rows = self.charts.len().div_ceil(columns);
        [SIZE[0] * columns as f64, self.header() + SIZE[1] * rows as f64]
    }

    fn elements(&self) -> String {
        let [width, _] = self.size();
        let mut svg = String::new();
        let title = fitted(&self.title, width - 2.0 * INSET, 14.0);
        write_text(&mut svg, "title", [INSET, 19.0], 14.0, &title);
        svg += &legend(&self.legend, [INSET, 28.0], width);
        for (index, chart) in self.charts.iter().enumerate() {
            let x = SIZE[0] * (index % self.columns()) as f64;
            let y = self.header() + SIZE[1] * (index / self.columns()) as f64;
            let _ = write!(svg, r#"<g transform="translate({x} {y})">{}</g>"#, chart.elements());
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_fill_a_grid() {
        for (number, columns, rows) in [(1, 1, 1), (2, 2, 1), (3, 3, 1), (4, 2, 2), (9, 3, 3), (10, 3, 4)] {
            let chart = |_| {
                Chart::of_lines("a", ["b", "c"], &[ChartLine { name: "b".into(), points: vec![(1.0, 2.0)] }])
            };
            let grid = ChartGrid {
                title: "run".into(),
                legend: Vec::new(),
                charts: (0..number).map(chart).collect(),
            };
            let pixels = SIZE.map(|side| (SCALE * side) as u32);
            let header = (SCALE * grid.header()).round() as u32;
            assert_eq!(grid.draw().dimensions(), (columns * pixels[0], rows * pixels[1] + header));
        }
    }
}
