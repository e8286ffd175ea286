//! Vector graphics and text as pixels. The font is embedded, because a system font may not exist.

use image::RgbImage;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};
use std::fmt::Write;
use std::sync::{Arc, LazyLock};

/// How the classes of the elements look, for pages that hold charts as well as for pictures.
pub(crate) const STYLE: &str = include_str!("svg.css");

/// The font is Inter 4.1, cut to Latin, Greek, arrows and mathematical signs.
static OPTIONS: LazyLock<Options<'static>> = LazyLock::new(|| {
    let mut fonts = fontdb::Database::new();
    fonts.load_font_data(include_bytes!("font/Inter-Regular.ttf").to_vec());
    Options { fontdb: Arc::new(fonts), style_sheet: Some(STYLE.to_owned()), ..Options::default() }
});

/// Draws SVG `elements` onto `picture`; their unit is `scale` pixels.
pub(super) fn draw_elements(picture: &mut RgbImage, elements: &str, scale: f32) {
    let (width, height) = picture.dimensions();
    let Some(mut canvas) = Pixmap::new(width, height) else { return };
    for (rgba, rgb) in canvas.data_mut().chunks_exact_mut(4).zip(picture.chunks_exact(3)) {
        rgba[..3].copy_from_slice(rgb);
        rgba[3] = u8::MAX;
    }
    resvg::render(&parsed(elements), Transform::from_scale(scale, scale), &mut canvas.as_mut());
    for (rgba, rgb) in canvas.data().chunks_exact(4).zip(picture.chunks_exact_mut(3)) {
        rgb.copy_from_slice(&rgba[..3]);
    }
}

fn parsed(elements: &str) -> Tree {
    let svg = format!(r#"<svg xmlns="http://www.w3.org/2000/svg">{elements}</svg>"#);
    Tree::from_str(&svg, &OPTIONS).expect("elements with escaped text are well-formed")
}

/// A colour as the value of an attribute.
pub(super) fn css_colour([red, green, blue]: [u8; 3]) -> String {
    format!("rgb({red},{green},{blue})")
}

/// Writes `text` with its baseline starting, centred or ending at a point, as the CSS class says.
pub(super) fn write_text(svg: &mut String, class: &str, [x, y]: [f64; 2], size: f64, text: &str) {
    let text = escape(text);
    let _ = write!(svg, r#"<text class="{class}" x="{x:.1}" y="{y:.1}" font-size="{size}">{text}</text>"#);
}

/// Width of `text` in the units of its font size.
pub(super) fn text_width(text: &str, size: f64) -> f64 {
    let mut svg = String::new();
    write_text(&mut svg, "label", [0.0; 2], size, text);
    f64::from(parsed(&svg).root().bounding_box().width())
}

/// `text`, or as much of it as fits into `width` with a trailing ellipsis.
pub(super) fn fitted(text: &str, width: f64, size: f64) -> String {
    let whole = text_width(text, size);
    if whole <= width {
        return text.to_owned();
    }
    let length = text.chars().count();
    // Characters differ in width: the estimate is a few too many.
    let estimate = (length as f64 * width / whole) as usize + 8;
    (0..length.min(estimate))
        .rev()
        .map(|kept| text.chars().take(kept).chain(['…']).collect::<String>())
        .find(|cut| text_width(cut, size) <= width)
        .unwrap_or_else(|| "…".to_owned())
}

/// `text` with the characters that mean something in SVG and HTML replaced, and those that may not stand there.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | '\r' => out.push(c),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c if c.is_control() => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    #[test]
    fn nothing_breaks_out() {
        assert_eq!(escape("<a b=\"c\">&'"), "&lt;a b=&quot;c&quot;&gt;&amp;&#39;");
        let wild: String =
            (0..0x300).filter_map(char::from_u32).chain(['\u{fffe}', '\u{ffff}', '網']).collect();
        assert!(text_width(&wild, 10.0) > 4000.0, "what the font lacks is a box");
    }

    #[test]
    fn text_stays_inside_its_width_and_leaves_the_rest_alone() {
        for (text, size) in [("Wgβ?", 18.0), ("step 12,345 → 3·10⁻⁵ m²", 30.0)] {
            let mut picture = RgbImage::from_fn(500, 60, |x, y| Rgb([x as u8, y as u8, 7]));
            let before = picture.clone();
            let mut svg = String::new();
            write_text(&mut svg, "label", [10.0, 40.0], size, text);
            draw_elements(&mut picture, &svg, 1.0);
            let changed = picture.enumerate_pixels().zip(before.pixels()).filter(|((.., a), b)| a != b);
            let changed: Vec<[f64; 2]> = changed.map(|((x, y, _), _)| [f64::from(x), f64::from(y)]).collect();
            let right = 10.0 + text_width(text, size);
            assert!(changed.len() > 200, "{}", changed.len());
            assert!(changed.iter().all(|[x, y]| (9.0..right).contains(x) && (40.0 - y).abs() < size));
            assert!(
                changed.iter().any(|[x, _]| *x > right - 0.2 * size),
                "the width is no wider than the text"
            );
        }
        assert_eq!(text_width("", 18.0), 0.0);
    }

    #[test]
    fn the_font_has_the_characters_of_labels() {
        let unknown = text_width("網", 100.0);
        for c in (' '..='~').chain("·×²³°±µβθ→…–—−äéßø".chars()).filter(|c| *c != ' ')
        {
            assert!(text_width(&c.to_string(), 100.0) != unknown, "{c:?}");
        }
    }

    #[test]
    fn long_text_is_cut_with_an_ellipsis() {
        assert_eq!(fitted("short", 100.0, 18.0), "short");
        let cut = fitted("a long label of a row", 100.0, 18.0);
        assert!(cut.ends_with('…') && cut.starts_with("a long"), "{cut}");
        assert!((80.0..=100.0).contains(&text_width(&cut, 18.0)), "{cut}");
        assert_eq!(fitted("ab", 0.0, 18.0), "…");
    }
}
