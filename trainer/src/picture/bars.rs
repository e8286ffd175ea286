//! Stacked bars: what a whole consists of, a bar per whole.

use image::{Rgb, RgbImage};

use super::font::{CAPITAL_HEIGHT, draw_text, fitted, text_size};
use super::palette::{LAYER_COLOURS, layer_colour};

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([44, 48, 54]);
const FAINT_INK: Rgb<u8> = Rgb([120, 126, 134]);
const SCALE: u32 = 2;
const WIDTH: u32 = 1240;
const MARGIN: u32 = 24;
/// Space for a bar's label on its left and its total on its right [pixels].
const LABEL: u32 = 470;
const TOTAL: u32 = 130;
const BAR: u32 = 30;
const STEP: u32 = BAR + 14;
const LINE: u32 = CAPITAL_HEIGHT * SCALE + 12;
const PATCH: u32 = CAPITAL_HEIGHT * SCALE;

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
    let legend = legend_places(parts);
    let legend_lines = legend.last().map_or(0, |[_, line]| line + 1);
    let top = MARGIN + LINE + legend_lines * LINE + 8;
    let height = top + STEP * bars.len() as u32 + LINE + MARGIN;
    let mut picture = RgbImage::from_pixel(WIDTH, height, PAPER);
    text(&mut picture, [MARGIN, MARGIN], &fitted(title, WIDTH - 2 * MARGIN, SCALE), INK);
    for (part, (name, [x, line])) in parts.iter().zip(&legend).enumerate() {
        let y = MARGIN + LINE + line * LINE;
        fill(&mut picture, [*x, y], [PATCH, PATCH], part_colour(part));
        text(&mut picture, [x + PATCH + 8, y], name, FAINT_INK);
    }
    let (left, length) = (MARGIN + LABEL, WIDTH - 2 * MARGIN - LABEL - TOTAL);
    for (row, bar) in bars.iter().enumerate() {
        let y = top + STEP * row as u32;
        let middle = y + (BAR - PATCH) / 2;
        text(&mut picture, [MARGIN, middle], &fitted(&bar.label, LABEL - 16, SCALE), INK);
        text(&mut picture, [left + length + 12, middle], &fitted(&bar.total, TOTAL - 12, SCALE), INK);
        let size = |part: &f64| if part.is_finite() { part.max(0.0) } else { 0.0 };
        let sum: f64 = bar.parts.iter().map(size).sum();
        let mut before = 0.0;
        for (part, value) in bar.parts.iter().map(size).enumerate().filter(|(_, value)| *value > 0.0) {
            // Both ends are rounded, so that neighbours meet and the last part ends where the bar does.
            let place = |share: f64| (share / sum * f64::from(length)).round() as u32;
            let (start, end) = (place(before), place(before + value));
            fill(&mut picture, [left + start, y], [end - start, BAR], part_colour(part));
            before += value;
        }
    }
    let y = top + STEP * bars.len() as u32;
    for percent in [0, 25, 50, 75, 100] {
        let name = format!("{percent} %");
        let x = left + length * percent / 100;
        fill(&mut picture, [x.min(left + length - 1), y - 6], [1, 6], [120, 126, 134]);
        text(&mut picture, [x.saturating_sub(text_size(&name, SCALE)[0] / 2), y + 4], &name, FAINT_INK);
    }
    picture
}

/// Left edge and line of every legend entry.
fn legend_places(parts: &[&str]) -> Vec<[u32; 2]> {
    let (mut x, mut line) = (MARGIN, 0);
    let mut places = Vec::with_capacity(parts.len());
    for name in parts {
        let width = PATCH + 8 + text_size(name, SCALE)[0];
        if x > MARGIN && x + width > WIDTH - MARGIN {
            (x, line) = (MARGIN, line + 1);
        }
        places.push([x, line]);
        x += width + 28;
    }
    places
}

fn text(picture: &mut RgbImage, origin: [u32; 2], text: &str, colour: Rgb<u8>) {
    draw_text(picture, origin.map(i64::from), text, SCALE, colour);
}

fn fill(picture: &mut RgbImage, [left, top]: [u32; 2], [width, height]: [u32; 2], colour: [u8; 3]) {
    for y in top..top + height {
        for x in left..left + width {
            if let Some(pixel) = picture.get_pixel_mut_checked(x, y) {
                *pixel = Rgb(colour);
            }
        }
    }
}

/// Colour of a part: the palette, and when that is used up the same darker.
fn part_colour(part: usize) -> [u8; 3] {
    let colour = layer_colour(part);
    if part < LAYER_COLOURS.len() { colour } else { colour.map(|channel| channel / 2) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_the_bar_by_their_shares() {
        let bar = Bar { label: "a".into(), parts: vec![3.0, f64::NAN, 1.0], total: "4 ms".into() };
        let picture = draw_bars("title", &["one", "none", "two"], &[bar, Bar::default()]);
        let count = |part: usize| {
            let colour = Rgb(part_colour(part));
            picture.pixels().filter(|pixel| **pixel == colour).count() as u32 - PATCH * PATCH
        };
        let length = WIDTH - 2 * MARGIN - LABEL - TOTAL;
        assert_eq!((count(0) + count(2), count(1)), (length * BAR, 0));
        assert!((f64::from(count(0)) / f64::from(length * BAR) - 0.75).abs() < 2e-3);
    }
}
