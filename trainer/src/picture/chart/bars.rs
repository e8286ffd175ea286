//! Stacked bars: what a whole consists of, a bar per whole.

use super::{CHART_PAPER, INSET, LegendKey, SCALE, TEXT_SIZE, legend, legend_height};
use crate::picture::palette::{LAYER_COLOURS, layer_colour};
use crate::picture::svg::{css_colour, draw_elements, fitted, write_text};
use image::RgbImage;
use std::fmt::Write;

const BARS_WIDTH: f64 = 775.0;
/// Space for a bar's label on its left and its total on its right.
const LABEL: f64 = 300.0;
const TOTAL: f64 = 85.0;
const BAR: f64 = 20.0;
const BAR_STEP: f64 = BAR + 8.0;

/// One whole and its parts.
#[derive(Clone, Debug, Default)]
pub struct Bar {
    /// What it is.
    pub label: String,
    /// Size of every part, in the order of the legend; negative ones and those that are not finite count as zero.
    pub parts: Vec<f64>,
    /// Written behind the bar, for example the sum with its unit.
    pub total: String,
}

/// Draws a bar of equal length per whole, divided by the shares of its parts, under a legend of the `parts`' names.
pub fn draw_bars(title: &str, parts: &[&str], bars: &[Bar]) -> RgbImage {
    let keys: Vec<LegendKey> =
        parts.iter().enumerate().map(|(part, name)| LegendKey::area(&colour(part), name)).collect();
    let top = 30.0 + legend_height(&keys, BARS_WIDTH);
    let bottom = top + BAR_STEP * bars.len() as f64;
    let (left, length) = (INSET + LABEL, BARS_WIDTH - 2.0 * INSET - LABEL - TOTAL);
    let mut svg = legend(&keys, [INSET, 30.0], BARS_WIDTH);
    write_text(&mut svg, "title", [INSET, 19.0], 14.0, &fitted(title, BARS_WIDTH - 2.0 * INSET, 14.0));
    for percent in [0, 25, 50, 75, 100] {
        let x = left + length * f64::from(percent) / 100.0;
        let _ = write!(svg, r#"<path class="grid" d="M{x} {top}V{bottom}"/>"#);
        write_text(&mut svg, "x", [x, bottom + 12.0], TEXT_SIZE, &format!("{percent} %"));
    }
    for (row, bar) in bars.iter().enumerate() {
        let y = top + BAR_STEP * row as f64 + 0.5 * (BAR_STEP - BAR);
        let label = fitted(&bar.label, LABEL - INSET, TEXT_SIZE);
        write_text(&mut svg, "label", [INSET, y + 13.5], TEXT_SIZE, &label);
        write_text(&mut svg, "label", [left + length + INSET, y + 13.5], TEXT_SIZE, &bar.total);
        let sizes = bar.parts.iter().map(|part| if part.is_finite() { part.max(0.0) } else { 0.0 });
        let sum: f64 = sizes.clone().sum();
        let mut x = left;
        for (part, size) in sizes.enumerate().filter(|(_, size)| *size > 0.0) {
            let width = length * size / sum;
            let _ = write!(svg, r#"<path {} d="M{x:.2} {y}h{width:.2}v{BAR}h-{width:.2}Z"/>"#, colour(part));
            x += width;
        }
    }
    let [width, height] = [BARS_WIDTH, bottom + 24.0].map(|side| (SCALE * side).round() as u32);
    let mut picture = RgbImage::from_pixel(width, height, CHART_PAPER);
    draw_elements(&mut picture, &svg, SCALE as f32);
    picture
}

/// Attributes with the colour of a part: the palette, and when that is used up the same darker.
fn colour(part: usize) -> String {
    let divisor = if part < LAYER_COLOURS.len() { 1 } else { 2 };
    let colour = layer_colour(part).map(|channel| channel / divisor);
    format!(r#"class="patch" fill="{}""#, css_colour(colour))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn parts_cover_the_bar_by_their_shares() {
        let draw = |bars: &[Bar]| draw_bars("title", &["one", "none", "two"], bars);
        let bar = Bar { label: "a".into(), parts: vec![3.0, f64::NAN, 1.0], total: "4 ms".into() };
        let (full, legend) = (draw(&[bar, Bar::default()]), draw(&[]));
        let count = |part: usize| {
            let colour = Rgb(layer_colour(part));
            let [all, keys] =
                [&full, &legend].map(|picture| picture.pixels().filter(|p| **p == colour).count());
            (all - keys) as f64
        };
        let length = SCALE * (BARS_WIDTH - 2.0 * INSET - LABEL - TOTAL);
        let bar = length * SCALE * BAR;
        assert!(((count(0) + count(2)) / bar - 1.0).abs() < 3e-3 && count(1) == 0.0);
        assert!((count(0) / bar - 0.75).abs() < 3e-3);
    }
}
